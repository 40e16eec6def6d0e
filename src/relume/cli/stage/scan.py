"""`relume stage scan`: photographs under a projector's patterns in, a mesh of the subject out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.options import place


def scan(
    photographs: Annotated[
        list[Path],
        Parameter(help="A folder of photographs named as the patterns, with projector.json; several are merged."),
    ],
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
    camera: Annotated[
        list[str] | None,
        Parameter(negative="", help="The stage's camera, again for each folder; the first unless given."),
    ] = None,
    normals: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            help="With --stage: maps.exr of `relume stage separate`, which fine detail is from; again for each folder.",
        ),
    ] = None,
    register: Annotated[
        bool, Parameter(help="Lay several views on each other where they show the same; or leave them as placed.")
    ] = True,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Scan a subject's shape by structured light (Debevec et al. 2000, §4.5), in metres."""
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        require_suffix(out, ".glb")
        if rig is None and boards is None:
            raise ValueError("give --rig, or --boards to calibrate it with")
        if stage is None and (normals or camera):
            raise ValueError("--normals and --camera are in their stage's frame; give --stage too")
        if len(photographs) > 1 and (stage is None or camera is None):
            raise ValueError("several folders of photographs: give --stage, and --camera for each: one frame for all")
        for option, given in (("--camera", camera), ("--normals", normals)):
            if given is not None and len(given) != len(photographs):
                raise ValueError(
                    f"{len(photographs)} folders of photographs, but {len(given)} {option}; give one for each"
                )
        require_files([*(normals or []), *([rig] if rig is not None and boards is None else [])])
        cameras = [None if stage is None else rl.lightstage.stage_camera(stage, name) for name in camera or [None]]
        # Camera and projector.
        if boards is None:
            assert rig is not None
            found = rl.lightstage.read_rig(rig)
        else:
            found = rl.lightstage.calibrate_rig(boards, squares=squares, square=square)
        # The mesh.
        maps = [None] * len(photographs) if normals is None else [rl.lightstage.read_normals(path) for path in normals]
        scans = [
            rl.lightstage.scan(folder, found, camera=own, normals=given)
            for folder, own, given in zip(photographs, cameras, maps, strict=True)
        ]
        laid = rl.lightstage.register_scans(scans) if register and len(scans) > 1 else None
        scans = scans if laid is None else laid.scans
        scanned = scans[0] if len(scans) == 1 else rl.lightstage.merge_scans(scans)
        rl.lightstage.write_scan(out, scanned)
        if boards is not None and rig is not None:
            rl.lightstage.write_rig(rig, found)
        facts = {"written": str(out), **scanned.facts(), **({} if laid is None else laid.facts()), **found.facts()}
        print_facts(output, facts)
