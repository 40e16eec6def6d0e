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

from relume.errors import FormatError, UnreadableFile
from relume.image.files import replacing
from relume.lightstage.rti.hsh import DEGREES, HemisphericalHarmonics


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


def read_hsh(path: str | os.PathLike[str]) -> HemisphericalHarmonics:
    """The hemispherical harmonics in a .rti file; raises UnreadableFile, FormatError where it is damaged."""
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read: {error.strerror}") from None
    if not content.startswith(b"#HSH"):
        raise UnreadableFile(f"{path}: no hemispherical harmonics: it does not begin with #HSH1.2")
    lines, start = [], 0
    while len(lines) < 3:
        end = content.find(b"\n", start, start + 4096)
        if end < 0:
            raise FormatError(path, "HSH", "header", "type, size and terms", f"{len(lines)} lines of them")
        line, start = content[start:end].decode("latin-1").strip(), end + 1
        lines += [] if line.startswith("#") else [line]
    try:
        (kind,), (width, height, channels), (terms, _, size) = ([int(word) for word in line.split()] for line in lines)
    except ValueError:
        raise FormatError(path, "HSH", "header", "1, 3 and 3 whole numbers", " / ".join(lines)) from None
    known = [(l + 1) ** 2 for l in DEGREES]  # noqa: E741
    if (kind, channels, size) != (3, 3, 1) or terms not in known or width < 1 or height < 1:
        raise FormatError(path, "HSH", "header", "type 3, 3 channels, 4, 9 or 16 terms of a byte", " / ".join(lines))
    needed, found = 8 * terms + width * height * 3 * terms, len(content) - start
    if found < needed:
        raise FormatError(path, "HSH", f"after byte {start}", f"{needed} bytes", f"{found}")
    scale, bias = np.frombuffer(content, "<f4", 2 * terms, start).reshape(2, terms).astype(np.float64)
    if not (np.all(np.isfinite(scale)) and np.all(np.isfinite(bias))):
        raise FormatError(path, "HSH", f"byte {start}", "finite scales and biases", "others")
    codes = np.frombuffer(content, np.uint8, width * height * 3 * terms, start + 8 * terms)
    values = codes.reshape(height, width, 3, terms) / 255 * scale + bias
    return HemisphericalHarmonics(values.astype(np.float32))
