"""`relume panorama`: photographs in several directions in, one illumination map out."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes
from relume.errors import DoubtfulResult, UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.probe.panorama.crops import Crop
    from relume.probe.panorama.sources import Source
    from relume.probe.panorama.stitching import Panorama
    from relume.probe.panorama.views import PanoramaView

Angles = tuple[float, float, float]
"""Yaw, pitch and roll, degrees."""
HOLE = 0.02
"""Share of the sphere that may be unseen before the map is doubtful: what a tripod hides."""
COLUMNS = ("name", "yaw", "pitch", "roll", "field")


def panorama(
    photographs: Annotated[
        list[Path],
        Parameter(
            help="The views, each a photograph, a radiance map, or a folder with the bracket of one view.", negative=""
        ),
    ],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The lat-long illumination map to write, .exr or .hdr.")],
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
            help="A table .csv with the columns name, yaw (to the right), pitch (up), roll (clockwise) and, where it "
            "is known, field, in degrees; views it does not name are matched. Where the two have nothing in common, as "
            "with a clear sky, yaw counts from the first view that is matched, and pitch from the horizon found."
        ),
    ] = None,
    match: Annotated[
        bool, Parameter(negative="", help="Match views even where they remember how they were cropped out of a map.")
    ] = False,
    field: Annotated[
        float | None,
        Parameter(help="Field of view across, degrees; where the files tell none, or instead of what they tell."),
    ] = None,
    size: Annotated[
        int | None, Parameter(help="Rows of the map; as fine as the views unless given, 4096 at most.")
    ] = None,
    profile: Annotated[
        Path | None, Parameter(help="The camera's profile; recovered from brackets unless given, sRGB for photographs.")
    ] = None,
    distortion: Annotated[bool, Parameter(help="Find one radial term of the lens where views are matched.")] = True,
    level: Annotated[bool, Parameter(help="Find the horizon where no orientation is told.")] = True,
    balance: Annotated[
        bool | None,
        Parameter(
            help="Balance exposure and vignetting where views overlap, exposure where they only touch. Not done unless "
            "asked for with views in cd/m², whose scale was measured, and with crops of a light map, which share one."
        ),
    ] = None,
    colours: Annotated[
        bool, Parameter(negative="", help="Balance each channel: the camera chose its white anew for each view.")
    ] = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Put photographs taken from one place together into one light map.

    Where neither --faces, --turn nor --orientations tells how the camera was turned, nor the views themselves do, as
    crops of a light map, it is found from what the views have in common. A doubtful result is written all the same and
    told with exit code 4.
    """
    from relume.errors import NotAPanorama
    from relume.image import files
    from relume.probe.panorama.balance import Balancing
    from relume.probe.panorama.crops import remembered_crop
    from relume.probe.panorama.matching import Matching
    from relume.probe.panorama.sources import read_sources
    from relume.probe.panorama.stitching import mosaic
    from relume.sphere.environment_files import as_radiance_map

    with warnings_as_notes(output):
        require_suffix(out, ".exr", ".hdr")
        for path in photographs:
            if not path.exists():
                raise UnreadableFile(f"{path}: no such file or folder; check the path")
        if len(photographs) < 2:
            raise NotAPanorama(f"{photographs[0].name}: a panorama needs two views at least; give the others too")
        told = _told(photographs, faces, turn, orientations)
        response = None
        if profile is not None:
            from relume.capture.response.camera_profile import read_profile

            response = read_profile(profile).response
        if match and told:
            raise ValueError("--match finds the orientation that --faces, --turn or --orientations tells; give one")
        found = "matched" if match else "matched, where the views do not remember it"
        plan = {
            "views": [path.name for path in photographs],
            "orientation": found if not told else f"told of {len(told)} of {len(photographs)}",
        }
        if dry_run:
            print_facts(output, {"would write": str(out), **plan})
            return
        sources = read_sources(photographs, response=response)
        if assumed := [source.name for source in sources if source.assumed]:
            note(
                output,
                f"{len(assumed)} single photographs are taken to be sRGB, and show no more than their own exposure; "
                "--profile tells their camera's response, folders give whole brackets",
            )
        crops = [remembered_crop(source.picture, source.name) for source in sources]
        use = not (match or told)
        views = [
            _view(source, told.get(path, (None, None)), field, 90.0 if faces else None, crop, use)
            for source, path, crop in zip(sources, photographs, crops, strict=True)
        ]
        cropped = [c is not None and c.rotation is not None for c in crops]
        remarks = []
        if use and any(cropped):
            remarks.append(
                f"{sum(cropped)} of {len(views)} views remember how they were cropped out of a light map, and are put "
                "back there; --match finds their orientation anyway"
            )
        calibrated = sources[0].picture.unit != "relative"
        if balance is None and not colours and (calibrated or all(cropped)):
            balance = False
            why = "radiance in cd/m² was measured" if calibrated else "crops of a light map share its exposure"
            remarks.append(f"the views are not balanced: {why}; --balance does it")
        result = mosaic(
            views,
            size=size,
            matching=Matching(distortion=distortion, level=level),
            balancing=None if balance is False else Balancing(colours=colours),
        )
        files.write(out, as_radiance_map(result.light))
        print_facts(output, {"written": str(out), **_facts(result, output.json)})
        for remark in (*remarks, *result.remarks):
            note(output, remark)
        if result.saturated > 0:
            note(output, f"{result.saturated:.2g} sr are saturated in every view; add shorter exposures")
        if result.unseen > 0:
            note(output, f"{result.unseen:.2g} sr are seen by no view and were filled in smoothly")
        doubts = list(result.notes)
        if result.unseen > HOLE * 4 * math.pi:
            doubts.append(f"{100 * result.unseen / (4 * math.pi):.0f} % of the sphere is seen by no view; add views")
        if doubts:
            raise DoubtfulResult(f"{' | '.join(doubts)} (all was written)")


def _told(
    paths: Sequence[Path], faces: str | None, turn: float | None, table: Path | None
) -> dict[Path, tuple[Angles, float | None]]:
    """Yaw, pitch and roll of each view that something tells, degrees, and its field."""
    from relume.probe.panorama.views import FACES

    given = [
        name for name, value in (("--faces", faces), ("--turn", turn), ("--orientations", table)) if value is not None
    ]
    if len(given) > 1:
        raise ValueError(f"{given[0]} and {given[1]} both tell the orientation; give one")
    if faces is not None:
        names = [word.strip().lower() for word in faces.split(",")]
        for name in names:
            if name not in FACES:
                raise ValueError(f'--faces: "{name}" is no face; there are {", ".join(FACES)}')
        if len(set(names)) < len(names) or len(names) != len(paths):
            raise ValueError(f"--faces names {len(names)} faces for {len(paths)} views; name each once, in their order")
        return {path: ((*FACES[name], 0.0), None) for path, name in zip(paths, names, strict=True)}
    if turn is not None:
        return {path: ((index * turn, 0.0, 0.0), None) for index, path in enumerate(paths)}
    return {} if table is None else _of_table(paths, table)


def _of_table(paths: Sequence[Path], table: Path) -> dict[Path, tuple[Angles, float | None]]:
    try:
        with table.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UnreadableFile(f"{table}: no table could be read ({error}); give a .csv") from None
    found: dict[str, tuple[Angles, float | None]] = {}
    for number, row in enumerate(rows, start=2):
        words = {
            (key or "").strip().lower(): (value or "").strip() for key, value in row.items() if isinstance(key, str)
        }
        if "name" not in words or "yaw" not in words:
            raise UnreadableFile(f"{table}: the first line must name the columns {', '.join(COLUMNS[:4])}")
        try:
            yaw, pitch, roll = (float(words.get(key) or 0) for key in ("yaw", "pitch", "roll"))
            across = float(words["field"]) if words.get("field") else None
        except ValueError:
            raise UnreadableFile(f"{table}: line {number} holds something that is no number of degrees") from None
        if not all(map(math.isfinite, (yaw, pitch, roll))):
            raise UnreadableFile(f"{table}: line {number} holds something that is no number of degrees")
        found[words["name"]] = ((yaw, pitch, roll), across)
    told = {path: found.pop(path.name) for path in paths if path.name in found}
    if found:
        raise UnreadableFile(f"{table}: {', '.join(found)} is no view that was given; names are those of the files")
    if not told:
        raise UnreadableFile(f"{table}: names no view")
    return told


def _view(
    source: Source,
    told: tuple[Angles | None, float | None],
    field: float | None,
    supposed: float | None,
    crop: Crop | None,
    use: bool,
) -> PanoramaView:
    """The view with its lens and, where it is known, its rotation.

    told : yaw, pitch, roll and field, degrees
    field, supposed : across, degrees, that overrules what the file tells, and that only a crop's own overrules
    use : whether the rotation that a crop remembers is used
    """
    from relume.errors import NotAPanorama
    from relume.probe.panorama.views import PanoramaView, focal_length_of, orientation

    angles, own_field = told
    across = field if own_field is None else own_field
    if across is None and crop is None:
        across = supposed
    if across is not None:
        focal_length = focal_length_of(math.radians(across), source.picture.size[0])
    elif crop is not None:
        focal_length = crop.focal_length
    elif source.focal_length is not None:
        focal_length = source.focal_length
    else:
        raise NotAPanorama(f"{source.name}: no focal length in the file; tell the field of view across with --field")
    rotation = crop.rotation if use and crop is not None else None
    if angles is not None:
        rotation = orientation(*(math.radians(angle) for angle in angles))
    return PanoramaView(source.picture, focal_length, rotation, source.name)


def _facts(result: Panorama, listed: bool) -> dict[str, object]:
    """What was found; the views as a list for machines, else a line each."""

    views = [_view_facts(*each) for each in zip(result.views, result.gains, strict=True)]
    if listed:
        shown: dict[str, object] = {"views": views}
    else:
        names = [str(view["name"]) for view in views]
        shown = {
            f"view {name}" if names.count(name) == 1 else f"view {number} {name}": {
                key: _gain(value) if isinstance(value, list) else value for key, value in view.items() if key != "name"
            }
            for number, (name, view) in enumerate(zip(names, views, strict=True), start=1)
        }
    light = result.light.audit().facts()
    return {
        "size": f"{2 * result.light.size}×{result.light.size}",
        **shown,
        "distortion": _short(result.views[0].distortion, 5),
        "vignetting": [_short(a, 4) for a in result.vignetting.coefficients],
        "matches agree within": None if result.error is None else f"{math.degrees(result.error):.3f}°",
        "unseen sr": round(result.unseen, 4),
        "saturated sr": round(result.saturated, 6),
        **{key: light[key] for key in ("total", "irradiance", "peak", "peak direction")},
    }


def _view_facts(view: PanoramaView, gain: np.ndarray) -> dict[str, object]:
    from relume.probe.panorama.views import angles_of

    yaw, pitch, roll = (_short(math.degrees(angle), 3) for angle in angles_of(view.placed))
    across = math.degrees(2 * math.atan(view.picture.size[0] / 2 / view.focal_length))
    return {
        "name": view.name, "yaw": yaw, "pitch": pitch, "roll": roll, "field": _short(across, 3),
        "gain": [_short(float(g), 4) for g in gain],
    }  # fmt: skip


def _gain(channels: list[float]) -> str:
    """One number where all channels have the same."""
    return " ".join(f"{gain:.4f}" for gain in (channels[:1] if len(set(channels)) == 1 else channels))


def _short(value: float, digits: int) -> float:
    """Rounded, and never −0."""
    return round(value, digits) + 0.0
