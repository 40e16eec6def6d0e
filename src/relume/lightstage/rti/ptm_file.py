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

from relume.errors import FormatError, UnreadableFile
from relume.image.files import replacing
from relume.lightstage.rti.ptm import PolynomialTexture

_VERSIONS = ("PTM_1.1", "PTM_1.2")
_FORMATS = {"PTM_FORMAT_RGB": 18, "PTM_FORMAT_LRGB": 9}
"""Bytes a pixel."""
_HEADER = 4096


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


def read_ptm(path: str | os.PathLike[str]) -> PolynomialTexture:
    """The polynomial texture map in a .ptm file, RGB or LRGB.

    Raises UnreadableFile for what is none or is compressed, FormatError where it is damaged.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read: {error.strerror}") from None
    version, form, width, height, scales, biases, start = _header(path, content)
    needed, found = width * height * _FORMATS[form], len(content) - start
    if found < needed:
        raise FormatError(path, "PTM", f"after byte {start}", f"{needed} bytes of coefficients", f"{found}")
    body = np.frombuffer(content, np.uint8, needed, start)
    if form == "PTM_FORMAT_RGB":
        codes, colour = np.moveaxis(body.reshape(3, height, width, 6), 0, 2), None
    elif version == "PTM_1.1":
        both = body.reshape(height, width, 9)
        codes, colour = both[:, :, None, :6], both[..., 6:]
    else:
        size = width * height * 6
        codes, colour = body[:size].reshape(height, width, 1, 6), body[size:].reshape(height, width, 3)
    coefficients = ((codes[::-1].astype(np.float64) - biases) * scales / 255).astype(np.float32)
    return PolynomialTexture(coefficients, None if colour is None else (colour[::-1] / 255).astype(np.float32))


def _quantised(values: np.ndarray) -> tuple[float, int]:
    """The finest scale and the whole bias, 0 to 255, with which bytes reach all values."""
    lowest, highest = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    if highest == lowest:
        return 1.0, 0
    bias = round(255 * -lowest / (highest - lowest))
    # Where the range lies on one side of 0 for the most part, the bias still has to leave a step to the other.
    bias = min(max(bias, 1 if lowest < 0 else 0), 254 if highest > 0 else 255)
    return max(highest / (255 - bias) if bias < 255 else 0.0, -lowest / bias if bias else 0.0), bias


def _header(path: str | os.PathLike[str], content: bytes) -> tuple[str, str, int, int, np.ndarray, np.ndarray, int]:
    """Version, form, width, height, scales, biases, and where the bytes begin."""
    version = content[:7].decode("latin-1")
    if version not in _VERSIONS:
        raise UnreadableFile(f'{path}: no polynomial texture map: it begins with "{version!r}", not PTM_1.2')
    # Numbers may stand on one line or on several; the bytes begin after the line of the last.
    words: list[str] = []
    start = 0
    while len(words) < 16:
        end = content.find(b"\n", start, start + _HEADER)
        if end < 0:
            raise FormatError(path, "PTM", "header", "its version, form and 14 numbers", f"{len(words)} words")
        words += content[start:end].decode("latin-1").split()
        start = end + 1
        if len(words) > 1 and words[1] not in _FORMATS:
            raise UnreadableFile(
                f"{path}: a {words[1]}; only {' and '.join(_FORMATS)} are read: convert it with RTIViewer's tools"
            )
    try:
        width, height = int(words[2]), int(words[3])
        scales = np.array([float(word) for word in words[4:10]])
        biases = np.array([float(word) for word in words[10:16]])
    except ValueError:
        raise FormatError(path, "PTM", "header", "14 numbers after the form", " ".join(words[2:16])) from None
    if width < 1 or height < 1 or not np.all(np.isfinite(scales)) or not np.all(np.isfinite(biases)):
        raise FormatError(path, "PTM", "header", "a size of 1×1 or more and finite numbers", " ".join(words[2:16]))
    return version, words[1], width, height, scales, biases, start
