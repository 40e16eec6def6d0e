"""`relume stage clothe`: takes in white and in black clothing in, the subject in clothing of any colour out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, read_point, refuse_input, require_files
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.stage.output import require_picture, write_picture

Albedo = tuple[float, float, float]


def clothe(
    black: Annotated[Path, Parameter(help="The radiance map of the subject in black clothing, relit or taken.")],
    white: Annotated[Path, Parameter(help="The same in white clothing, under the same light.")],
    /,
    *,
    albedo: Annotated[str, Parameter(help="Of the cloth that is wanted: a number or R,G,B, linear, 0 to 1.")],
    out: Annotated[Path, Parameter(alias="-o", help="The picture: .exr, .hdr, .png or .jpg.")],
    white_albedo: Annotated[str, Parameter(help="Of the white cloth.")] = "0.8",
    black_albedo: Annotated[str, Parameter(help="Of the black cloth.")] = "0.03",
    exposure: Annotated[float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png and .jpg by.")] = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Dye the subject's clothing, with the light that it throws on the subject (Debevec et al. 2000, Fig. 7).

    White minus black is the light that came by way of the cloth; it is tinted and added to the black take.
    """
    from relume.image import files
    from relume.lightstage.garment_recolouring import ClothAlbedos, recolour_clothing

    with warnings_as_notes(output):
        require_picture(out)
        require_files([black, white])
        refuse_input(out, [black, white])
        cloths = ClothAlbedos(read_albedo(white_albedo, "--white-albedo"), read_albedo(black_albedo, "--black-albedo"))
        tint = cloths.tint(read_albedo(albedo, "--albedo"))
        if dry_run:
            print_facts(output, {"would write": str(out), "tint": tint.tolist()})
            return
        made = recolour_clothing(files.read_radiance(black), files.read_radiance(white), tint)
        write_picture(out, made, exposure)
        print_facts(output, {"written": str(out), "tint": [float(f"{value:.4g}") for value in tint]})


def read_albedo(text: str, option: str) -> Albedo:
    """One number for all channels, or three."""
    if "," in text:
        return read_point(text, option)
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f'{option}: "{text}" is no albedo; write a number or R,G,B from 0 to 1, like 0.5') from None
    return value, value, value
