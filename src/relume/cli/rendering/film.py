"""`relume film`: a film file in, frames and a movie out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, Threads, require_files
from relume.cli.console import OutputOptions, force, print_facts, spread, warnings_as_notes
from relume.cli.option_types import Size


def film(
    film: Annotated[Path, Parameter(help="The film file, .toml.")],
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o",
            help="The folder for frames, developed pictures, movie and contact sheet; the file's unless given.",
        ),
    ] = None,
    frames: Annotated[
        str | None,
        Parameter(help="Render these frames alone, as 3,5-8 or 1-100x2; nothing is developed, and no movie written."),
    ] = None,
    light: Annotated[
        Path | None, Parameter(help="The environment map (HDRI), .exr, .hdr or another format, instead of the file's.")
    ] = None,
    size: Annotated[Size | None, Parameter(help="Pixels, instead of the file's.")] = None,
    samples: Annotated[
        int | None, Parameter(validator=Number(gte=2), help="Rays a pixel, instead of the file's.")
    ] = None,
    restart: Annotated[bool, Parameter(negative="", help="Discard the saved state of an interrupted frame.")] = False,
    threads: Threads = None,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Make the film of a scene file's sequence: rendered, developed with one exposure, joined to a movie.

    Frames that are there, made from the same, are kept, and an interrupted one is resumed: given again, the command
    goes on. Frames are kept as radiance, so that other lenses, stocks and exposures develop them without rendering.
    """
    with warnings_as_notes(output):
        require_files([each for each in (film, light) if each is not None])
        with spread(None if dry_run else cluster, output) as (workers, report):
            made = rl.make_film(
                film, out, frames=frames, light=light, size=size, samples=samples, threads=threads, dry_run=dry_run,
                report=report, restart=restart, force=force, cluster=workers,
            )  # fmt: skip
    facts = {"renderer": made.renderer, "size": f"{made.size[0]}×{made.size[1]}", "frames": made.frames}
    facts |= {"kept from before": made.kept, "seconds": round(made.frames / made.rate, 3)}
    written = made.movie or made.folder / "frames"
    more = {} if made.sheet is None else {"contact sheet": str(made.sheet)}
    print_facts(output, {"would write" if dry_run else "written": str(written), **more, **facts})
