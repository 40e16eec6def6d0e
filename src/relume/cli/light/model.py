"""`relume model`: edges marked in photographs in, cameras and blocks of the place out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes


def model(
    place: Annotated[Path, Parameter(help="A place file, .toml; or a folder of photographs, to begin one.")],
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o", help="The place file to write, with what was found; beside the one that is read, or the same."
        ),
    ] = None,
    export: Annotated[
        Path | None, Parameter(help="Write the blocks as meshes without textures: .glb, .obj, .usda or .usd.")
    ] = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Find the cameras of photographs and the sizes of blocks together, from edges marked in the photographs."""
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        if out is not None:
            require_suffix(out, ".toml")
        if export is not None:
            require_suffix(export, ".glb", ".obj", ".usda", ".usd", option="--export")
        beginning = place.is_dir()
        if beginning and (out is None or export is not None):
            raise ValueError(f"{place} is a folder: give -o place.toml to begin a place file; export it when it is solved")
        written = [str(path) for path in (out, export) if path is not None]
        if dry_run:
            print_facts(output, {"would write": written})
            return
        if beginning and out is not None:
            rl.scene.new_place_file(place, out)
            note(output, f"name blocks and mark their edges in {out}, then run `relume model {out} -o {out}`")
            print_facts(output, {"written": written})
            return
        found = rl.model_place(place, out=out, export=export)
        print_facts(output, {"written": written, **found.facts()})
