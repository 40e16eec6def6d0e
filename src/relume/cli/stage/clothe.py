"""`relume stage clothe`: takes in white and in black clothing in, the subject in clothing of any colour out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import Colour
from relume.cli.stage.options import Exposure, require_picture, rounded


def clothe(
    black: Annotated[
        Path, Parameter(help="The radiance map of the subject in black clothing, relit or taken; or its stage.")
    ],
    white: Annotated[Path, Parameter(help="The same in white clothing, under the same light.")],
    /,
    *,
    albedo: Annotated[Colour, Parameter(help="Of the wanted cloth: a number or R,G,B, linear, 0 to 1.")],
    out: Annotated[
        Path, Parameter(alias="-o", help="The picture: .exr, .hdr, .png or .jpg; of two stages a store, *.zarr.")
    ],
    white_albedo: Annotated[Colour, Parameter(help="Of the white cloth.")] = (0.8, 0.8, 0.8),
    black_albedo: Annotated[Colour, Parameter(help="Of the black cloth.")] = (0.03, 0.03, 0.03),
    exposure: Exposure = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Recolour clothing, with the light that it throws on the subject (Debevec et al. 2000, Fig. 7).

    White minus black is the light that came by way of the cloth; it is tinted and added to the black take. Of two
    stages, every picture is recoloured, and the result can be relit.
    """
    with warnings_as_notes(output):
        stages = _is_stage(black)
        if stages != _is_stage(white):
            raise ValueError(f"{black}, {white}: a stage and a picture; give two stages, or two radiance maps")
        if stages:
            require_suffix(out, ".zarr")
        else:
            require_files([black, white])
            require_picture(out)
        refuse_input(out, [black, white])
        tint = rl.lightstage.ClothAlbedos(white_albedo, black_albedo).tint(albedo)
        if dry_run:
            print_facts(output, {"would write": str(out), "tint": tint.tolist()})
            return
        if stages:
            dark, bright = (rl.lightstage.read_stage(path) for path in (black, white))
            rl.lightstage.build_store(rl.lightstage.recolour_field(dark, bright, tint), out)
        else:
            made = rl.lightstage.recolour_clothing(rl.read_radiance(black), rl.read_radiance(white), tint)
            rl.lightstage.write_picture(out, made, exposure)
        print_facts(output, {"written": str(out), "tint": rounded(tint)})


def _is_stage(path: Path) -> bool:
    return path.is_dir() or path.suffix.lower() in (".json", ".lp")
