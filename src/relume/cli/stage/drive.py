"""`relume stage drive`: an environment map in, what each lamp of a real stage must give out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, MapsOptions, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.light import Rotate, read_turned, rotation_of
from relume.cli.stage.options import Camera, Stage, rounded


def drive(
    stage: Stage,
    /,
    *,
    light: Annotated[
        Path,
        Parameter(help="The environment map that the stage is to look like, or a folder of maps, one after the other."),
    ],
    out: Annotated[
        Path, Parameter(alias="-o", help="The file to write, .csv or .json; of a folder of maps a .csv of all frames.")
    ],
    maps: MapsOptions = MapsOptions(),
    smoothing: Annotated[
        float | None,
        Parameter(help="Of a folder of maps: smooth intensities by a Gaussian of so many frames; 0 unless given."),
    ] = None,
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
        several = light.is_dir()
        if several:
            require_suffix(out, ".csv")
        else:
            require_suffix(out, ".csv", ".json")
            require_files([light])
            maps.refuse()
            if smoothing is not None:
                raise ValueError("--smoothing is of maps that change with time; give a folder of them")
        primaries = read_primaries(primary, white, maximum)
        field = rl.lightstage.read_stage(stage, camera)
        names = list(primaries.names)
        if dry_run:
            print_facts(output, {"would write": str(out), "lights": len(field.lights), "primaries": names})
            return
        # What is to look alike under the light.
        if subject == "own":
            chosen = rl.lightstage.MeasuredSubject(field)
        else:
            surface = rl.lightstage.SurfaceSubject
            chosen = surface() if subject == "diffuse" else surface.glossy(roughness)
        if several:
            _drive_by_folder(field, maps.sequence(light).checked(), rotate, primaries, chosen, smoothing, out, output)
            return
        # The intensities, their file and how well they do.
        found = rl.lightstage.drive(field.lights, read_turned(light, rotate), primaries, chosen)
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


def _drive_by_folder(
    field: rl.lightstage.ReflectanceField,
    lights: rl.light.LightSequence,
    rotate: Rotate,
    primaries: rl.lightstage.LampPrimaries,
    subject: rl.lightstage.SurfaceSubject | rl.lightstage.MeasuredSubject,
    smoothing: float | None,
    out: Path,
    output: OutputOptions,
) -> None:
    """The table of a folder of maps, a frame a map or 24 a second."""
    turn, times = rotation_of(rotate), lights.times()
    with progress(output) as report:
        found = rl.lightstage.drive_sequence(
            field.lights,
            (lights.at(time) if turn is None else lights.at(time).rotated(turn) for time in times),
            primaries,
            subject,
            smoothing=smoothing or 0.0,
            progress=lambda done: report("driving", done / len(times)),
        )
    rl.lightstage.write_drive_sequence(out, found)
    facts: dict[str, object] = {"written": str(out), "frames": len(found.frames), "lights": len(field.lights)}
    facts |= {"primaries": list(primaries.names), "lamps at the maximum, frames": found.clipped}
    worst = float(f"{max(frame.residual.max() for frame in found.frames):.3g}")
    facts |= {"residual, worst frame": worst, "flicker": float(f"{found.flicker:.3g}")}
    print_facts(
        output, {**facts, "headroom": float(f"{found.headroom:.4g}") if found.headroom < float("inf") else None}
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
