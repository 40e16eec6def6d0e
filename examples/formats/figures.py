"""The pictures of docs/formats.md: the scan lines of 24-bit LogLuv, and a light map as a JPEG with a gain map.

python examples/formats/figures.py out/demo/light.exr docs/images
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files.logluv import gamut as logluv_gamut
from relume.image.primaries import REC709

SCALE, MARGIN, GAP, NAME = 1000, 20, 8, 16
STOPS = -4.0


def gamut() -> Image.Image:
    """Every cell of u′, v′ in its colour, as far as a screen has it; each eighth line marked."""
    starts, counts, _ = logluv_gamut.lines()
    picture = Image.new("RGB", (int(0.65 * SCALE), int(0.62 * SCALE)), "white")
    draw = ImageDraw.Draw(picture)
    to_rec709 = np.linalg.inv(REC709.to_xyz())
    for (u, v), line in zip(
        logluv_gamut.chromaticities()[: logluv_gamut.CODES], np.repeat(np.arange(len(counts)), counts), strict=True
    ):
        xyz = np.array([9 * u, 4 * v, 12 - 3 * u - 20 * v]) / (4 * v)
        rgb = np.maximum(to_rec709 @ xyz, 0)
        shown = 255 * encode_srgb(rgb / rgb.max()) * (0.75 if line % 8 == 0 else 1.0)
        left, top = u - logluv_gamut.CELL / 2, v + logluv_gamut.CELL / 2
        corner = (MARGIN + SCALE * left, picture.height - MARGIN - SCALE * top)
        other = (corner[0] + SCALE * logluv_gamut.CELL, corner[1] + SCALE * logluv_gamut.CELL)
        draw.rectangle((corner, other), fill=tuple(int(value) for value in shown))
    draw.text((picture.width - 150, 8), "CIE 1976 u', v'", fill="black")
    draw.text((8, picture.height - 14), f"{len(starts)} lines, {logluv_gamut.CODES} cells", fill="black")
    return picture


def gain_map(source: Path) -> Image.Image:
    """A map at an exposure that shows its lamps, the base of its JPEG, and the light of that JPEG at that exposure."""
    light = files.read_radiance(source)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        path = Path(folder, "light.jpg")
        files.write(path, light)
        base, back = files.read_photograph(path).pixels, files.read_radiance(path)
    grey = float(np.exp(np.log(light.radiance[light.radiance > 0]).mean()))

    def seen(radiance: np.ndarray) -> np.ndarray:
        codes = encode_srgb(np.clip(radiance * (0.18 / grey * 2**STOPS), 0, 1))
        return np.rint(255 * codes).astype(np.uint8)

    named = {
        f"the map, {STOPS:g} stops": seen(light.radiance),
        "its base JPEG, as any program shows it": base,
        f"light read back from the JPEG, {STOPS:g} stops": seen(back.radiance),
    }
    tiles = [Image.fromarray(pixels).resize((512, 256), Image.Resampling.LANCZOS) for pixels in named.values()]
    sheet = Image.new("RGB", (3 * 512 + 2 * GAP, 256 + NAME), "white")
    for index, (name, tile) in enumerate(zip(named, tiles, strict=True)):
        sheet.paste(tile, (index * (512 + GAP), NAME))
        ImageDraw.Draw(sheet).text((index * (512 + GAP), 1), name, fill="black")
    return sheet


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    source, out = Path(sys.argv[1]), Path(sys.argv[2])
    gamut().save(out / "logluv_gamut.jpg", quality=92)
    gain_map(source).save(out / "gain_map.jpg", quality=92)
