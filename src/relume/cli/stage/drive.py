"""`relume stage drive`: an environment map in, what each lamp of a real stage must give out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.light import Rotate, read_turned
from relume.cli.stage.options import Camera, Stage, rounded


def drive(
    stage: Stage,
    /,
    *,
    light: Annotated[Path, Parameter(help="The environment map that the stage is to look like.")],
    out: Annotated[Path, Parameter(alias="-o", help="The file to write, .csv or .json.")],
    subject: Annotated[
        Literal["diffuse", "glossy", "own"],
        Parameter(
            help="What is to look alike: a matte subject, a glossy one, or the stage's own, whose pictures count."
        ),
    ] = "diffuse",
    roughness: Annotated[float, Parameter(help="Of the glossy subject's highlights, 0 to 1.")] = 0.4,
    primary: Annotated[
        list[tuple[str, tuple[float, float, float]]] | None,
        numbers(
            "NAME=R,G,B",
            like="amber=1,0.6,0.05",
            help="Linear colour of one of each lamp's LEDs at intensity 1; again for each. Red, green and blue unless "
            "given.",
        ),
    ] = None,
    white: Annotated[bool, Parameter(negative="", help="Lamps that have no colour and can only be dimmed.")] = False,
    maximum: Annotated[
        float, Parameter(show_default=False, help="Highest intensity of a primary; none unless given.")
    ] = float("inf"),
    rotate: Rotate = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Find the intensities under which a subject in a stage looks as under an environment map (Light Stage 3).

    Intensities are those that differ least, never negative nor above the maximum. The command warns of what the stage
    cannot show, by level or by colour.
    """
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        require_suffix(out, ".csv", ".json")
        require_files([light])
        primaries = read_primaries(primary, white, maximum)
        field = rl.lightstage.read_stage(stage, camera)
        names = list(primaries.names)
        if dry_run:
            print_facts(output, {"would write": str(out), "lights": len(field.lights), "primaries": names})
            return
        # The light, what is to look alike under it, and the solve.
        wanted = read_turned(light, rotate)
        if subject == "own":
            chosen = rl.lightstage.MeasuredSubject(field)
        else:
            surface = rl.lightstage.SurfaceSubject
            chosen = surface() if subject == "diffuse" else surface.glossy(roughness)
        # The intensities, their file and how well they do.
        found = rl.lightstage.drive(field.lights, wanted, primaries, chosen)
        rl.lightstage.write_drive(out, found)
        print_facts(
            output,
            {
                "written": str(out),
                "lights": len(field.lights),
                "primaries": names,
                "residual": rounded(found.residual, 3),
                "at the maximum": found.clipped,
                "headroom": float(f"{found.headroom:.4g}") if found.headroom < float("inf") else None,
                "beyond gamut": float(f"{found.beyond_gamut:.3g}"),
            },
        )


def read_primaries(
    primaries: list[tuple[str, tuple[float, float, float]]] | None, white: bool, maximum: float
) -> rl.lightstage.LampPrimaries:
    """The LEDs that the options give."""
    import numpy as np

    if not maximum > 0:
        raise ValueError(f"--maximum is {maximum}; give a number above 0")
    if white and primaries:
        raise ValueError("--white and --primary: give one of them")
    if not primaries:
        kind = rl.lightstage.LampPrimaries
        return kind.white(maximum) if white else kind.rgb(maximum)
    colours = np.array([colour for _, colour in primaries], np.float64)
    return rl.lightstage.LampPrimaries(tuple(name for name, _ in primaries), colours, maximum)
