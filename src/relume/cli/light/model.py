"""`relume model`: edges marked in photographs in, cameras and blocks of the place out."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter
from cyclopts.validators import Path as FileThere

import relume as rl
from relume.cli.arguments import DryRun, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes
from relume.cli.option_types import numbers

ELSEWHERE = Group("Photogrammetry made elsewhere")
ON_IT = Group("Its photographs on it")
THERE = FileThere(exists=True, dir_okay=False)
OF_PHOTOGRAPHS = "Radiance maps for the blocks, or photographs with --profile; named as the place's photographs."


def model(
    place: Annotated[
        Path,
        Parameter(
            help="A place file, .toml. To begin one: a folder of photographs, or photogrammetry made elsewhere, "
            "COLMAP's folder, Meshroom's or OpenMVG's .json, or glTF."
        ),
    ],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(alias="-o", help="The place file to write, with what was found; it may be the one read.")
    ] = None,
    export: Annotated[
        Path | None,
        Parameter(help="Write the blocks as meshes: .glb, .obj, .usda or .usd; with textures .glb or .usda."),
    ] = None,
    textures: Annotated[
        tuple[Path, ...],
        Parameter(group=ON_IT, consume_multiple=True, negative=(), validator=THERE, help=OF_PHOTOGRAPHS),
    ] = (),
    profile: Annotated[
        Path | None, Parameter(group=ON_IT, validator=THERE, help="A camera profile, from merge --save-profile.")
    ] = None,
    texel: Annotated[float | None, Parameter(group=ON_IT, help="Metres a texel; as fine as seen unless given.")] = None,
    scale: Annotated[float | None, Parameter(group=ELSEWHERE, help="Metres to a unit of its model.")] = None,
    between: Annotated[
        tuple[str, str] | None,
        Parameter(
            group=ELSEWHERE, negative="", help="Two photographs, or two numbered points, whose distance --metres gives."
        ),
    ] = None,
    metres: Annotated[float | None, Parameter(group=ELSEWHERE, help="Their distance, metres.")] = None,
    up: Annotated[
        tuple[float, float, float] | None,
        numbers("X,Y,Z", like="0,-1,0"),
        Parameter(group=ELSEWHERE, help="What points up in its model's frame."),
    ] = None,
    mesh: Annotated[Path | None, Parameter(group=ELSEWHERE, help="The program's mesh, in its model's frame.")] = None,
    photographs: Annotated[Path | None, Parameter(group=ELSEWHERE, help="The folder of the photographs.")] = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Find the cameras of photographs and the sizes of blocks together, from edges marked in the photographs."""
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        if out is not None:
            require_suffix(out, ".toml")
        if export is not None:
            kinds = (".glb", ".usda") if textures else (".glb", ".obj", ".usda", ".usd")
            require_suffix(export, *kinds, option="--export")
        if (textures and export is None) or (not textures and (profile is not None or texel is not None)):
            raise ValueError("--textures go into --export place.glb; --profile and --texel are theirs")
        beginning = place.is_dir() or place.suffix.lower() != ".toml"
        if beginning and (out is None or export is not None):
            raise ValueError(f"{place} is no place file: give -o place.toml to begin one, and export that")
        if (between is None) != (metres is None) or (between is not None and scale is not None):
            raise ValueError("--between and --metres belong together, instead of --scale")
        # Without a file to write nothing is begun; what is solved may only be looked at.
        written = [str(path) for path in (out, export) if path is not None]
        if dry_run:
            return print_facts(output, {"would write": written})
        if beginning and out is not None:
            known = scale if between is None or metres is None else rl.scene.KnownDistance(*between, metres)
            begun = rl.scene.new_place_file(place, out, scale=known, up=up, mesh=mesh, photographs=photographs)
            if not begun.solved:
                where = f"in {out} (by the pointer: `relume studio {out}`)"
                note(output, f"name blocks and mark their edges {where}, then run `relume model {out} -o {out}`")
            return print_facts(output, {"written": written, **asdict(begun)})
        # Cameras and sizes, and the photographs laid on them.
        if textures and export is not None:
            textured = rl.report.texture_place(place, textures, export, out=out, profile=profile, texel=texel)
            return print_facts(output, {"written": written, **textured.place.facts(), **textured.facts()})
        print_facts(output, {"written": written, **rl.model_place(place, out=out, export=export).facts()})
