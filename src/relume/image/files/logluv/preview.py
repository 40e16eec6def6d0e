"""A LogLuv TIFF straight to pixels for a screen, by two look-ups a pixel (Larson 1998, "Raw I/O").

Luminance and colour are codes, and a power law of their product is the product of their power laws: both are looked up
in tables made beforehand, so that no pixel costs more than its decoding, three products and their rounding.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.image.files.logluv import runs as logluv_runs
from relume.image.files.logluv.logluv_tiff import header, tables, to_d65, upright, warn_of_strange
from relume.image.files.read_options import ReadOptions
from relume.image.files.tiff.attributes import scale_of
from relume.image.photograph import Photograph

_MOST = 1000  # stops, which float64 holds
_WHITE = 1e30  # far above 255, but no infinity, which times 0 would be NaN


def preview(
    path: str | os.PathLike[str], exposure: float = 0.0, gamma: float = 2.2, reading: ReadOptions = ReadOptions()
) -> Photograph:
    """A LogLuv or LogL TIFF as 8-bit Rec. 709 pixels, 255 · (2^exposure · radiance)^(1/gamma) rounded and clipped.

    exposure : stops by which the picture is brightened
    gamma : of the power law; 2.2, the paper's, is close to sRGB's curve
    Raises ValueError for a gamma that is not positive, and what `logluv_tiff.read` raises.
    """
    if not (gamma > 0 and abs(exposure) <= _MOST):
        raise ValueError(f"gamma is {gamma} and exposure {exposure}; give a gamma above 0 and up to {_MOST} stops")
    folder, blocks = header(path, reading)
    scale = scale_of(path, folder) or 1.0
    luminances, colours = tables(blocks, to_d65(path, folder, blocks)[0])
    rows = logluv_runs.find(path, blocks, reading)
    from relume.image.files.logluv import kernels

    # Negative luminance, and channels below 0 of colours that Rec. 709 does not have, show as black.
    with np.errstate(over="ignore"):
        bright = 255 * (np.maximum(luminances, 0) * scale * 2.0**exposure) ** (1 / gamma)
    shown = np.maximum(colours, 0) ** (1 / gamma)
    bright, shown = np.minimum(bright, _WHITE).astype(np.float32), shown.astype(np.float32)
    picture = np.empty((blocks.height, blocks.width, 3), np.uint8)
    strange = rows.paint(picture, lambda words, part: kernels.tone(words, bright, shown, part))
    warn_of_strange(path, strange, blocks)
    return Photograph(upright(picture, folder), name=Path(path).name)
