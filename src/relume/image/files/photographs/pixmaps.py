"""Photographs without any metadata: Windows bitmaps (.bmp, by Pillow) and portable pixmaps (.ppm, .pgm; Netpbm)."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import FormatError
from relume.image.files.photographs.form import Form
from relume.image.files.signatures import one_line

_WORD = re.compile(rb"(?:\s|#[^\n\r]*[\n\r])*([^\s#]+)")
"""A word of a header; what begins with # is a comment to the end of its line (ppm(5))."""
_HEAD = 4096
_PLAIN, _GREY = (b"P2", b"P3"), (b"P2", b"P5")


@dataclass(frozen=True)
class _Pixmap:
    """The header of a pixmap: where its pixels begin, their number of channels and their value of white."""

    width: int
    height: int
    channels: int
    white: int
    begin: int
    plain: bool


def form_of(path: str | os.PathLike[str], kind: str) -> Form:
    """The form of a "BMP" or "PNM" by its header; raises FormatError where that is damaged."""
    if kind == "PNM":
        found = _pixmap_of(path)
        bits = found.white.bit_length()
        packing = "as text" if found.plain else ""
        return Form(found.width, found.height, found.channels, bits, "grey" if found.channels == 1 else "RGB", packing)
    from PIL import Image

    try:
        with Image.open(path, formats=["BMP"]) as image:
            channels = {"RGBA": 4, "RGB": 3, "P": 3}.get(image.mode, 1)
            return Form(*image.size, channels, 8, {1: "grey", 3: "RGB", 4: "RGB with alpha"}[channels])
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FormatError(path, kind, "its header", "a size and a form", one_line(error)) from None


def decoded(path: str | os.PathLike[str], kind: str) -> np.ndarray:
    """The pixels (H, W, 1 to 4) uint8 or uint16; raises FormatError where they are damaged or end early.

    A pixmap whose white is neither 255 nor 65535 is brought to the next of them, so that white stays white.
    """
    if kind == "PNM":
        return _of_pixmap(path)
    from PIL import Image

    try:
        with Image.open(path, formats=["BMP"]) as image:
            plain = image if image.mode in ("RGB", "RGBA", "L") else image.convert("L" if image.mode == "1" else "RGB")
            pixels = np.array(plain)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FormatError(path, kind, "its pixels", "whole data", one_line(error)) from None
    return pixels.reshape(*pixels.shape[:2], -1)


def _pixmap_of(path: str | os.PathLike[str]) -> _Pixmap:
    with open(path, "rb") as file:
        head = file.read(_HEAD)
    magic, place, numbers = head[:2], 2, []
    for name in ("width", "height", "value of white"):
        word = _WORD.match(head, place)
        if word is None or not word[1].isdigit() or len(word[1]) > 9:
            seen = "nothing" if word is None else word[1][:20].decode("ascii", "replace")
            raise FormatError(path, "PNM", "its header", f"its {name}", seen)
        numbers.append(int(word[1]))
        place = word.end()
    width, height, white = numbers
    if not 0 < white < 65536:
        raise FormatError(path, "PNM", "its header", "a white of 1 to 65535", str(white))
    # One blank ends the header; what follows it are pixels, whatever they look like.
    return _Pixmap(width, height, 1 if magic in _GREY else 3, white, place + 1, magic in _PLAIN)


def _of_pixmap(path: str | os.PathLike[str]) -> np.ndarray:
    found = _pixmap_of(path)
    count = found.width * found.height * found.channels
    data = Path(path).read_bytes()[found.begin :]
    if found.plain:
        words = re.sub(rb"#[^\n\r]*", b"", data).split()
        try:
            values = np.array([int(word) for word in words[:count]], np.int64)
        except ValueError:
            raise FormatError(path, "PNM", "its pixels", "numbers", "other words") from None
    else:
        # The higher byte comes first.
        values = np.frombuffer(
            data[: len(data) // 2 * 2] if found.white > 255 else data, ">u2" if found.white > 255 else "u1"
        )
        values = values[:count]
    if len(values) < count:
        raise FormatError(path, "PNM", "its pixels", f"{count} values", f"{len(values)}")
    if values.size and int(values.max()) > found.white:
        raise FormatError(path, "PNM", "its pixels", f"values up to {found.white}", str(int(values.max())))
    full = 255 if found.white <= 255 else 65535
    if found.white != full:
        values = (values.astype(np.int64) * full + found.white // 2) // found.white
    return values.astype(np.uint8 if full == 255 else np.uint16).reshape(found.height, found.width, found.channels)
