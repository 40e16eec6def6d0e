"""Hemispherical harmonics as .rti files, those of RTIViewer and RelightLab.

A file is "#HSH1.2", "3", "width height 3", "terms 2 1", each a line that ends in CR LF, as the first fitter wrote it;
then a scale and a bias a term, float32 little-endian, and from the picture's upper row down, every pixel's terms of
red, of green and of blue, a byte each: a coefficient is byte / 255 · scale + bias (RTIViewer's and RelightLab's
readers).
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.image.files import replacing
from relume.lightstage.rti.hsh import HemisphericalHarmonics


def write_hsh(path: str | os.PathLike[str], harmonics: HemisphericalHarmonics) -> None:
    """Write a .rti, whole or not at all; coefficients are rounded to 1/255 of each term's range, nothing is cut off.

    Raises ValueError for another suffix or coefficients that are not finite, OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".rti":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; hemispherical harmonics are written to .rti')
    values = harmonics.coefficients.astype(np.float64)
    if not np.all(np.isfinite(values)):
        raise ValueError("a coefficient of the harmonics is not finite; mask out the pixels it comes from")
    bias = values.min(axis=(0, 1, 2)).astype("<f4")
    scale = (values.max(axis=(0, 1, 2)) - bias).astype("<f4")
    codes = np.clip(np.rint((values - bias) / np.where(scale > 0, scale, 1) * 255), 0, 255).astype(np.uint8)
    height, width = harmonics.shape
    header = f"#HSH1.2\r\n3\r\n{width} {height} 3\r\n{values.shape[3]} 2 1\r\n"
    # A term that is the same everywhere has scale 0, by which some readers divide.
    written = np.where(scale > 0, scale, np.float32(1)).astype("<f4")
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + written.tobytes() + bias.tobytes() + codes.tobytes())
