"""`relume stage drive`: a light map in, what each lamp of a real stage must give out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, read_rotation, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.stage.options import Camera, Stage

if TYPE_CHECKING:
    from relume.lightstage.driving.primaries import LampPrimaries


def drive(
    stage: Stage,
    /,
    *,
    light: Annotated[Path, Parameter(help="The illumination map that the stage is to look like.")],
    out: Annotated[Path, Parameter(alias="-o", help="The file to write, .csv or .json.")],
    subject: Annotated[
        Literal["diffuse", "glossy", "own"],
        Parameter(
            help="What is to look alike: a matte subject, a glossy one, or the stage's own, whose pictures count."
        ),
    ] = "diffuse",
    roughness: Annotated[float, Parameter(help="Of the glossy subject's highlights, 0 to 1.")] = 0.4,
    primary: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="NAME=R,G,B: linear colour of one of each lamp's LEDs at intensity 1; again for each. Red, green and "
            "blue unless given.",
        ),
    ] = None,
    white: Annotated[bool, Parameter(negative="", help="Lamps that have no colour and can only be dimmed.")] = False,
    maximum: Annotated[float | None, Parameter(help="Highest intensity of a primary; none unless given.")] = None,
    rotate: Annotated[
        str | None,
        Parameter(allow_leading_hyphen=True, help="Turn the map by YAW[,PITCH[,ROLL]] degrees, right-handed."),
    ] = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Find the intensities under which a subject in a stage looks as under a light map (Light Stage 3).

    Intensities are those that differ least, never negative nor above the maximum. What the stage cannot show, by level
    or by colour, is told.
    """
    from relume.lightstage.acquire.read_stage import read_stage
    from relume.lightstage.driving.drive_file import write_drive
    from relume.lightstage.driving.driving import drive as driven
    from relume.lightstage.driving.subjects import Given, Surface

    with warnings_as_notes(output):
        require_suffix(out, ".csv", ".json")
        require_files([light])
        primaries = read_primaries(primary, white, maximum)
        field = read_stage(stage, camera)
        if dry_run:
            print_facts(
                output, {"would write": str(out), "lights": len(field.lights), "primaries": list(primaries.names)}
            )
            return
        wanted = rl.read_environment(light)
        if rotate is not None:
            wanted = wanted.rotated(read_rotation(rotate, "--rotate"))
        chosen = (
            Surface() if subject == "diffuse" else Surface.glossy(roughness) if subject == "glossy" else Given(field)
        )
        found = driven(field.lights, wanted, primaries, chosen)
        write_drive(out, found)
        print_facts(
            output,
            {
                "written": str(out),
                "lights": len(field.lights),
                "primaries": list(primaries.names),
                "residual": [float(f"{value:.3g}") for value in found.residual],
                "at the maximum": found.clipped,
                "headroom": float(f"{found.headroom:.4g}") if found.headroom < float("inf") else None,
                "beyond gamut": float(f"{found.beyond_gamut:.3g}"),
            },
        )


def read_primaries(words: list[str] | None, white: bool, maximum: float | None) -> LampPrimaries:
    """The primaries that the options tell; raises ValueError naming the option."""
    import numpy as np

    from relume.lightstage.driving.primaries import LampPrimaries

    most = float("inf") if maximum is None else maximum
    if not most > 0:
        raise ValueError(f"--maximum is {maximum}; give a number above 0")
    if white and words:
        raise ValueError("--white and --primary: give one of them")
    if not words:
        return LampPrimaries.white(most) if white else LampPrimaries.rgb(most)
    names, colours = [], []
    for word in words:
        name, equals, colour = word.partition("=")
        try:
            numbers = [float(each) for each in colour.split(",")]
            if not (name and equals and len(numbers) == 3):
                raise ValueError
        except ValueError:
            raise ValueError(f'--primary: "{word}" is no primary; write NAME=R,G,B, like amber=1,0.6,0.05') from None
        names.append(name)
        colours.append(numbers)
    return LampPrimaries(tuple(names), np.array(colours, np.float64), most)
