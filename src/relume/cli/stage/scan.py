"""`relume stage scan`: photographs under a projector's patterns in, a mesh of the subject out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.options import Camera, place


def scan(
    photographs: Annotated[Path, Parameter(help="A folder of photographs named as the patterns, with projector.json.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The mesh, .glb.")],
    rig: Annotated[
        Path | None, Parameter(help="Where camera and projector stand, .json; with --boards it is written.")
    ] = None,
    boards: Annotated[
        Path | None, Parameter(help="A folder of folders, each of photographs of a board under the patterns.")
    ] = None,
    squares: Annotated[tuple[int, int], numbers("ALONG,ACROSS", like="9,7", above=0, help="The board's squares.")] = (
        9,
        7,
    ),
    square: Annotated[float, Parameter(help="Side of one of the board's squares, metres.")] = 0.03,
    stage: Annotated[
        Path | str | None,
        Parameter(converter=place, n_tokens=1, help="The stage whose camera took the photographs: the mesh's frame."),
    ] = None,
    camera: Camera = None,
    normals: Annotated[
        Path | None, Parameter(help="With --stage: maps.exr of `relume stage separate`, which fine detail is from.")
    ] = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Scan a subject's shape by structured light (Debevec et al. 2000, §4.5), in metres."""
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        require_suffix(out, ".glb")
        if rig is None and boards is None:
            raise ValueError("give --rig, or --boards to calibrate it with")
        if normals is not None and stage is None:
            raise ValueError("--normals are in their stage's frame; give --stage too")
        require_files([path for path in (normals, rig if boards is None else None) if path is not None])
        own = None if stage is None else rl.lightstage.read_stage(stage, camera).camera
        if stage is not None and own is None:
            raise ValueError(f"{stage}: has no camera, which places the mesh; add it to stage.json")
        # Camera and projector.
        if boards is None:
            assert rig is not None
            found = rl.lightstage.read_rig(rig)
        else:
            folders = sorted(path for path in boards.glob("*") if path.is_dir())
            found = rl.lightstage.calibrate_rig(folders, squares=squares, square=square)
        # The mesh.
        maps = None if normals is None else rl.lightstage.read_normals(normals)
        scanned = rl.lightstage.scan(photographs, found, camera=own, normals=maps)
        rl.lightstage.write_scan(out, scanned)
        if boards is not None and rig is not None:
            rl.lightstage.write_rig(rig, found)
        facts = {"written": str(out), **scanned.facts()}
        if found.residual is not None:
            facts["rig's residual, camera and projector, pixels"] = [float(f"{each:.2g}") for each in found.residual]
        print_facts(output, facts)
