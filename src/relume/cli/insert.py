"""`relume insert`: a shot file in, a composite out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import OutputOptions, force, note, print_facts, progress, warnings_as_notes

if TYPE_CHECKING:
    from relume.project.shot_file.shot import Shot


def insert(
    shot: Annotated[Path, Parameter(help="The shot file, .toml.")],
    /,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="The folder for composite.exr, composite.png, report.html and the rest.")
    ],
    samples: Annotated[int | None, Parameter(help="Rays a pixel, instead of the shot file's.")] = None,
    seed: Annotated[
        int | None, Parameter(help="Another seed for the renderer's noise, instead of the shot file's.")
    ] = None,
    noise: Annotated[
        float | None, Parameter(help="Stop once the error to be expected is below this share, like 0.01.")
    ] = None,
    to: Annotated[
        Literal["blender", "usd", "mitsuba"] | None,
        Parameter(help="Hand the shot over to this program instead of rendering it: its files go to the folder."),
    ] = None,
    restart: Annotated[bool, Parameter(negative="", help="Forget what an interrupted render kept.")] = False,
    threads: Threads = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Insert the objects of a shot into its photograph, lit by the light photographed there.

    Stages are kept in the output folder: a second run redoes only what changed, and a render that was interrupted goes
    on where it stopped. A shot with a [sequence] is made frame by frame.
    """
    from relume.project.shot_file.shot import read_shot

    with warnings_as_notes(output):
        table = read_shot(shot)
        changes = {k: v for k, v in (("samples", samples), ("seed", seed), ("noise", noise)) if v is not None}
        if changes:
            if samples is not None and samples < 2:
                raise ValueError(f"--samples is {samples}; give at least 2")
            if seed is not None and seed < 0:
                raise ValueError(f"--seed is {seed}; give 0 or more")
            if noise is not None and not noise > 0:
                raise ValueError(f"--noise is {noise}; give a share above 0, like 0.01")
            render = type(table.render).model_validate(table.render.model_dump() | changes)
            table = table.model_copy(update={"render": render})
        if dry_run:
            require_files(
                [*table.files(table.plate.photographs), *(table.folder / name for name in table.named_files())]
            )
            balls = [len(table.files(b.photographs)) for b in table.light.balls or ()]
            print_facts(
                output,
                {
                    "would write": str(out),
                    "plate": [p.name for p in table.files(table.plate.photographs)],
                    "ball photographs": balls,
                    "objects": [o.mesh for o in table.objects],
                    "samples": table.render.samples,
                },
            )
            return
        if to is not None:
            _hand_over(table, out, output, to)
        elif table.sequence is not None:
            _sequence(table, out, output, threads, restart)
        else:
            run(table, out, output, threads, restart)


def _hand_over(shot: Shot, out: Path, output: OutputOptions, to: str) -> None:
    """Do all but the render and write the shot for another program."""
    from relume.export import bundle as hand_over
    from relume.export.shot_formats import FORMATS
    from relume.project.insertion.insert import prepared

    if shot.sequence is not None:
        raise ValueError("--to hands one picture over, not a sequence; take [sequence] out of the shot file")
    with progress(output) as report:
        value = prepared(shot, out, report=report)
    lacking = hand_over(value, out, FORMATS[to])
    form = FORMATS[to]
    print_facts(output, {"written": str(out / form.main), **({"not held": list(lacking)} if output.json else {})})


def _sequence(shot: Shot, out: Path, output: OutputOptions, threads: int | None, restart: bool) -> None:
    """Make every frame that is not there yet."""
    from relume.project.insertion.frames import insert_frames

    with progress(output) as report:
        made = insert_frames(shot, out, threads=threads, report=report, restart=restart, force=force())
    for line in made.notes:
        note(output, line)
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


def run(shot: Shot, out: Path, output: OutputOptions, threads: int | None, restart: bool = False) -> None:
    """Do the job and tell what came of it."""
    from relume.project.insertion.insert import insert as inserted

    with progress(output) as report:
        result = inserted(shot, out, threads=threads, report=report, restart=restart, force=force())
    for line in result.notes:
        note(output, line)
    surfaces = result.recovered.surfaces if result.recovered is not None else ()
    recovered = [surface.reflectance for surface in surfaces if surface.reflectance is not None]
    print_facts(
        output,
        {
            "picture": str(out / "composite.png"),
            "radiance": str(out / "composite.exr"),
            "layers": str(out / "layers.exr"),
            "light": str(out / "light.exr"),
            "report": str(out / "report.html"),
            "camera": [round(float(v), 4) for v in result.camera.position],
            "reflectance": [[round(v, 4) for v in r] for r in recovered],
            "rays a pixel": result.change.samples,
            "seconds": round(sum(result.seconds.values()), 1),
            "kept from before": list(result.kept),
            **({"notes": list(result.notes)} if output.json else {}),
        },
    )
