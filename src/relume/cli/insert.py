"""`relume insert`: a shot file in, a composite out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import OutputOptions, force, note, print_facts, progress, warnings_as_notes


def insert(
    shot: Annotated[Path, Parameter(help="The shot file, .toml.")],
    /,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="The folder for composite.exr, composite.png, report.html and the rest.")
    ],
    samples: Annotated[
        int | None, Parameter(validator=Number(gte=2), help="Rays a pixel, instead of the shot file's.")
    ] = None,
    seed: Annotated[
        int | None, Parameter(validator=Number(gte=0), help="The renderer's seed, instead of the shot file's.")
    ] = None,
    noise: Annotated[
        float | None,
        Parameter(validator=Number(gt=0), help="Stop once the expected error is below this share, like 0.01."),
    ] = None,
    to: Annotated[
        Literal["blender", "usd", "mitsuba"] | None,
        Parameter(help="Export the shot for this program instead of rendering it: its files go to the folder."),
    ] = None,
    restart: Annotated[bool, Parameter(negative="", help="Discard the saved state of an interrupted render.")] = False,
    threads: Threads = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Insert the objects of a shot into its photograph, lit by the light photographed there.

    Stages are kept in the output folder: a second run redoes only what changed, and an interrupted render is resumed.
    A shot with a [sequence] is made frame by frame.
    """
    with warnings_as_notes(output):
        table = rl.read_shot(shot).with_render(samples=samples, seed=seed, noise=noise)
        if dry_run:
            _dry_run(table, out, output)
        elif to is not None:
            with progress(output) as report:
                prepared = rl.prepare_shot(table, out, progress=report)
            made = rl.export_shot(prepared, out, to)
            lacking = {"not held": list(made.not_held)} if output.json else {}
            print_facts(output, {"written": str(made.main), **lacking})
        elif table.sequence is not None:
            _sequence(table, out, output, threads, restart)
        else:
            run(table, out, output, threads, restart)


def _dry_run(shot: rl.Shot, out: Path, output: OutputOptions) -> None:
    require_files([*shot.files(shot.plate.photographs), *(shot.folder / name for name in shot.named_files())])
    print_facts(
        output,
        {
            "would write": str(out),
            "plate": [path.name for path in shot.files(shot.plate.photographs)],
            "ball photographs": [len(shot.files(ball.photographs)) for ball in shot.light.balls or ()],
            "objects": [each.mesh for each in shot.objects],
            "samples": shot.render.samples,
        },
    )


def _sequence(shot: rl.Shot, out: Path, output: OutputOptions, threads: int | None, restart: bool) -> None:
    """Make every frame that is not there yet."""
    with progress(output) as report:
        made = rl.insert_frames(
            shot, out, threads=threads, progress=report, restart=restart, force=force, finished=rl.write_report
        )
    rl.write_report(made, out)
    note(output, *made.notes)
    print_facts(
        output,
        {
            "frames": len(made.frames),
            "kept from before": sum(frame.kept for frame in made.frames),
            "movie": str(made.movie) if made.movie is not None else "none",
            "report": str(out / "report.html"),
            "seconds": round(sum(frame.seconds for frame in made.frames), 1),
        },
    )


def run(shot: rl.Shot, out: Path, output: OutputOptions, threads: int | None, restart: bool = False) -> None:
    """Insert the objects, write the report and print where everything is."""
    with progress(output) as report:
        result = rl.insert(shot, out, threads=threads, progress=report, restart=restart, force=force)
    rl.write_report(result, out)
    note(output, *result.notes)
    recovered = result.place.recovered
    surfaces = () if recovered is None else recovered.surfaces
    print_facts(
        output,
        {
            "picture": str(out / "composite.png"),
            "radiance": str(out / "composite.exr"),
            "layers": str(out / "layers.exr"),
            "light": str(out / "light.exr"),
            "report": str(out / "report.html"),
            "camera": [round(float(v), 4) for v in result.camera.position],
            "reflectance": [[round(v, 4) for v in each.reflectance] for each in surfaces if each.reflectance],
            "rays a pixel": result.change.samples,
            "seconds": round(sum(result.seconds.values()), 1),
            "kept from before": list(result.kept),
            **({"notes": list(result.notes)} if output.json else {}),
        },
    )
