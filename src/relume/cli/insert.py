"""`relume insert`: a shot file in, a composite out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import Manner, note, progress, speaking, tell

if TYPE_CHECKING:
    from relume.shot.project import Shot


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
    threads: Threads = None,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Insert the objects of a shot into its photograph, lit by the light photographed there.

    Stages are kept in the output folder: a second run redoes only what changed.
    """
    from relume.shot.project import read_shot

    with speaking(manner):
        table = read_shot(shot)
        changes = {k: v for k, v in (("samples", samples), ("seed", seed)) if v is not None}
        if changes:
            if samples is not None and samples < 2:
                raise ValueError(f"--samples is {samples}; give at least 2")
            if seed is not None and seed < 0:
                raise ValueError(f"--seed is {seed}; give 0 or more")
            render = type(table.render).model_validate(table.render.model_dump() | changes)
            table = table.model_copy(update={"render": render})
        if dry_run:
            require_files([*table.files(table.plate.photographs), *(table.folder / o.mesh for o in table.objects)])
            balls = [len(table.files(b.photographs)) for b in table.light.balls or ()]
            tell(
                manner,
                {
                    "would write": str(out),
                    "plate": [p.name for p in table.files(table.plate.photographs)],
                    "ball photographs": balls,
                    "objects": [o.mesh for o in table.objects],
                    "samples": table.render.samples,
                },
            )
            return
        run(table, out, manner, threads)


def run(shot: Shot, out: Path, manner: Manner, threads: int | None) -> None:
    """Do the job and tell what came of it."""
    from relume.shot.insert import insert as inserted

    with progress(manner) as report:
        result = inserted(shot, out, threads=threads, report=report)
    for line in result.notes:
        note(manner, line)
    recovered = [r.reflectance for r in result.recovered if r is not None]
    tell(
        manner,
        {
            "picture": str(out / "composite.png"),
            "radiance": str(out / "composite.exr"),
            "layers": str(out / "layers.exr"),
            "light": str(out / "light.exr"),
            "report": str(out / "report.html"),
            "reflectance": [[round(v, 4) for v in r] for r in recovered],
            "rays a pixel": result.with_.samples,
            "seconds": round(sum(result.seconds.values()), 1),
            "kept from before": list(result.kept),
            **({"notes": list(result.notes)} if manner.json else {}),
        },
    )
