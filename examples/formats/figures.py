"""The picture of docs/reference/formats.md: the scan lines of 24-bit LogLuv.

python examples/formats/figures.py docs/images
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from relume.image.colour import encode_srgb
from relume.image.files.logluv import codes as logluv_codes
from relume.image.primaries import REC709

SCALE, MARGIN = 1000, 20


def gamut() -> Image.Image:
    """Every cell of u′, v′ in its colour, as far as a screen has it; each eighth line marked."""
    starts, counts, _ = logluv_codes.lines()
    picture = Image.new("RGB", (int(0.65 * SCALE), int(0.62 * SCALE)), "white")
    draw = ImageDraw.Draw(picture)
    to_rec709 = np.linalg.inv(REC709.to_xyz())
    for (u, v), line in zip(
        logluv_codes.chromaticities(24)[: logluv_codes.CODES], np.repeat(np.arange(len(counts)), counts), strict=True
    ):
        xyz = np.array([9 * u, 4 * v, 12 - 3 * u - 20 * v]) / (4 * v)
        rgb = np.maximum(to_rec709 @ xyz, 0)
        shown = 255 * encode_srgb(rgb / rgb.max()) * (0.75 if line % 8 == 0 else 1.0)
        left, top = u - logluv_codes.CELL / 2, v + logluv_codes.CELL / 2
        corner = (MARGIN + SCALE * left, picture.height - MARGIN - SCALE * top)
        other = (corner[0] + SCALE * logluv_codes.CELL, corner[1] + SCALE * logluv_codes.CELL)
        draw.rectangle((corner, other), fill=tuple(int(value) for value in shown))
    draw.text((picture.width - 150, 8), "CIE 1976 u', v'", fill="black")
    draw.text((8, picture.height - 14), f"{len(starts)} lines, {logluv_codes.CODES} cells", fill="black")
    return picture


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    gamut().save(Path(sys.argv[1], "logluv_codes.jpg"), quality=92)
