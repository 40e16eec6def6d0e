"""Polynomial texture maps as .ptm files, the ones of RTIViewer, RelightLab and OpenLIME.

A text of six lines, PTM_1.2, PTM_FORMAT_RGB or PTM_FORMAT_LRGB, width, height, six scales, six biases (whole numbers),
then bytes, from the lowest row of the picture to the highest: a coefficient is (byte − bias) · scale, in units of code
values. RGB: a plane of red with six bytes a pixel, one of green, one of blue. LRGB: a plane of six bytes a pixel, then
a plane of red, green and blue; PTM_1.1 has all nine bytes of a pixel together. The layout is that of the format's
specification (PtmFormat12, Hewlett-Packard 2001), as RTIViewer's and RelightLab's readers have it.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.image.files import replacing
from relume.lightstage.rti.ptm import PolynomialTexture


def write_ptm(path: str | os.PathLike[str], texture: PolynomialTexture) -> None:
    """Write a .ptm of version 1.2, whole or not at all: RGB, or LRGB where the texture has a colour.

    Coefficients are rounded to 1/255 of the range that each of the six has over the picture; nothing is cut off.
    Raises ValueError for another suffix or coefficients that are not finite, OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".ptm":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; a polynomial texture map is written to .ptm')
    coefficients = texture.coefficients.astype(np.float64) * 255
    if not np.all(np.isfinite(coefficients)):
        raise ValueError("a coefficient of the polynomial texture map is not finite; mask out the pixels it comes from")
    scales, biases = zip(*(_quantised(coefficients[..., term]) for term in range(6)), strict=True)
    # The scales as the file holds them are those that the bytes are made with.
    scales = np.array([float(f"{scale:.7g}") for scale in scales])
    codes = np.clip(np.rint(coefficients / scales + np.array(biases)), 0, 255).astype(np.uint8)[::-1]
    height, width = texture.shape
    planes = [np.ascontiguousarray(codes[:, :, channel]) for channel in range(codes.shape[2])]
    if texture.colour is not None:
        planes.append(np.rint(np.clip(texture.colour[::-1], 0, 1) * 255).astype(np.uint8))
    form = "PTM_FORMAT_RGB" if texture.colour is None else "PTM_FORMAT_LRGB"
    lines = ["PTM_1.2", form, str(width), str(height), " ".join(f"{scale:.7g}" for scale in scales)]
    header = "\n".join([*lines, " ".join(str(bias) for bias in biases), ""])
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + b"".join(plane.tobytes() for plane in planes))


def _quantised(values: np.ndarray) -> tuple[float, int]:
    """The finest scale and the whole bias, 0 to 255, with which bytes reach all values."""
    lowest, highest = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    if highest == lowest:
        return 1.0, 0
    bias = round(255 * -lowest / (highest - lowest))
    # Where the range lies on one side of 0 for the most part, the bias still has to leave a step to the other.
    bias = min(max(bias, 1 if lowest < 0 else 0), 254 if highest > 0 else 255)
    return max(highest / (255 - bias) if bias < 255 else 0.0, -lowest / bias if bias else 0.0), bias
