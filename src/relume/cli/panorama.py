"""`relume panorama`: photographs in several directions in, one environment map out."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import Accept, DryRun, LatLongOut, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, warnings_as_notes
from relume.cli.option_types import numbers


@Parameter(name="*")
@dataclass(frozen=True)
class FisheyeOptions:
    """What a user says of round views."""

    fisheye: Annotated[
        float | None,
        Parameter(help="The views are round: of a fisheye of about so many degrees across; their turns are found."),
    ] = None
    equisolid: Annotated[bool, Parameter(negative="", help="Such a fisheye has r ∝ sin(θ/2), not r ∝ θ.")] = False
    rim: Annotated[
        tuple[float, float, float] | None,
        numbers("X,Y,RADIUS", like="960,960,940", help="Of the round picture, pixels; in the middle unless given."),
    ] = None

    def lens(self) -> rl.probe.FisheyeLens | None:
        """The lens, None for perspective views; raises ValueError that names the option."""
        if self.fisheye is None and (self.equisolid or self.rim is not None):
            raise ValueError(f"--{'equisolid' if self.equisolid else 'rim'} is for --fisheye; give that too")
        return None if self.fisheye is None else rl.probe.FisheyeLens(radians(self.fisheye), self.equisolid)


def panorama(
    photographs: Annotated[
        list[Path],
        Parameter(
            help="The views, each a photograph, a radiance map, or a folder with the bracket of one view.", negative=""
        ),
    ],
    /,
    *,
    out: LatLongOut,
    faces: Annotated[
        str | None,
        Parameter(
            help="The views are faces of a cube, 90° across, in this order, like front,right,back,left,up,down "
            "(up and down are tilted from the front)."
        ),
    ] = None,
    turn: Annotated[
        float | None,
        Parameter(
            help="Degrees that the camera was turned to the right from each view to the next, held level.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    orientations: Annotated[
        Path | None,
        Parameter(
            help="A table, .csv, in degrees: columns name, yaw (right), pitch (up), roll (clockwise) and, where it is "
            "known, field. Views that it does not name are matched. Where the two groups share nothing, as under a "
            "clear sky, yaw counts from the first matched view, and pitch from the horizon that is found."
        ),
    ] = None,
    match: Annotated[
        bool, Parameter(negative="", help="Match views even where they hold how they were cropped out of a map.")
    ] = False,
    field: Annotated[
        float | None,
        Parameter(help="Field of view across, degrees; where the files hold none, or instead of what they hold."),
    ] = None,
    fisheye: FisheyeOptions = FisheyeOptions(),
    size: Annotated[
        int | None, Parameter(help="Rows of the map; as fine as the views unless given, 4096 at most.")
    ] = None,
    profile: Annotated[
        Path | None, Parameter(help="The camera's profile; recovered from brackets unless given, sRGB for photographs.")
    ] = None,
    distortion: Annotated[bool, Parameter(help="Find one radial term of the lens where views are matched.")] = True,
    level: Annotated[bool, Parameter(help="Find the horizon where no orientation is given.")] = True,
    balance: Annotated[
        bool | None,
        Parameter(
            help="Balance exposure and vignetting where views overlap, exposure alone where they only touch. Views "
            "in cd/m² and crops of one map are not balanced unless asked for: their scale is known."
        ),
    ] = None,
    colours: Annotated[
        bool, Parameter(negative="", help="Balance each channel: the camera chose its white anew for each view.")
    ] = False,
    accept: Accept = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Put photographs taken from one place together into one environment map.

    Where --faces, --turn and --orientations are not given, and the views are not crops of an environment map, which
    hold their orientation, it is found from what the views have in common. A doubtful result is written all the same,
    with exit code 4.
    """
    with warnings_as_notes(output):
        # What is to be done.
        require_suffix(out, ".exr", ".hdr")
        settings = rl.probe.PanoramaSettings(
            size=size, field=field, turn=turn, orientations=orientations, match=match,
            faces=tuple(word.strip().lower() for word in faces.split(",")) if faces else (),
            matching=rl.probe.Matching(distortion=distortion, level=level), balance=balance, colours=colours,
        )  # fmt: skip
        known, lens = settings.known(photographs), fisheye.lens()
        if lens is not None and (field is not None or colours or faces or match or not (distortion and level)):
            raise ValueError(
                "--fisheye has no use for --field, --faces, --colours, --match, --no-distortion, --no-level"
            )
        if dry_run:
            found = f"matched{'' if match else ', where the views do not hold it'}"
            where, names = f"given of {len(known)} of {len(photographs)}", [path.name for path in photographs]
            print_facts(output, {"would write": str(out), "views": names, "orientation": where if known else found})
            return
        # The work.
        camera = None if profile is None else rl.capture.read_profile(profile)
        if lens is None:
            result = rl.probe.panorama_from_files(photographs, profile=camera, settings=settings)
        else:
            result = rl.probe.fisheyes_from_files(
                photographs, lens, rim=fisheye.rim, turn=turn, orientations=orientations, profile=camera,
                size=size, balance=balance is not False,
            )  # fmt: skip
        rl.write(out, rl.as_radiance_map(result.light))
        # What came of it.
        print_facts(output, {"written": str(out), **result.facts(listed=output.json)})
        note(output, *result.notes)
        finish(output, result.warnings, accept=accept)
