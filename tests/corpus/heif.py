"""HEIF photographs (ISO 23008-12): whole files of libheif's own encoder, and their boxes cut, moved and misnamed."""

from __future__ import annotations

import io
import struct

import numpy as np
import pillow_heif

from corpus.files import DESCRIBE, HEIGHT, READ, READ_FACTS, READ_PHOTOGRAPH, WIDTH, Bad, Corpus, Good, cut, patched

_SUFFIX = ".heic"
_BOXES = (
    b"meta",
    b"hdlr",
    b"pitm",
    b"iloc",
    b"iinf",
    b"infe",
    b"iprp",
    b"ipco",
    b"hvcC",
    b"ispe",
    b"pixi",
    b"ipma",
    b"mdat",
)


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("HEIF", _good(), _bad(), (READ_PHOTOGRAPH, READ, DESCRIBE, READ_FACTS))


def _file(pixels: np.ndarray, mode: str, **options: object) -> bytes:
    """Without loss, as far as the codec has it."""
    held = io.BytesIO()
    size, data = (pixels.shape[1], pixels.shape[0]), np.ascontiguousarray(pixels).tobytes()
    pillow_heif.encode(mode, size, data, held, quality=-1, chroma=444, matrix_coefficients=0, **options)
    return held.getvalue()


def _good() -> list[Good]:
    rows, columns = np.indices((8 * HEIGHT, 4 * WIDTH))
    smooth = (rows + columns)[..., None] + np.array([0, 40, 80])
    eight = smooth.astype(np.uint8)
    return [
        Good("8 bits", _file(eight, "RGB"), _SUFFIX, eight.astype(np.float64), 2 / 255),
        Good("10 bits", _file((smooth * 257).astype(np.uint16), "RGB;16"), _SUFFIX, smooth * 257.0, 1e-2),
        Good("grey", _file(eight[..., 0], "L"), _SUFFIX),
    ]


def _bad() -> list[Bad]:
    good, other = _good()[0].data, _good()[1].data
    files = []
    for name in _BOXES:
        place = good.index(name)
        (length,) = struct.unpack_from(">I", good, place - 4)
        for value in (0, 1, 7, length - 1, length + 1, 2**31 - 1, 2**32 - 1):
            wrong = patched(good, place - 4, struct.pack(">I", value))
            files.append(Bad(f"{name.decode()} of {value} bytes", wrong, _SUFFIX, refused=False))
        files.append(Bad(f"{name.decode()} by another name", patched(good, place, b"free"), _SUFFIX, refused=False))
    size = good.index(b"ispe") + 8
    files += [
        Bad(f"{name} {value}", patched(good, size + at, struct.pack(">I", value)), _SUFFIX, refused=False)
        for name, at in (("width", 0), ("height", 4))
        for value in (0, 1, 2**16, 2**31, 2**32 - 1)
    ]
    files += [
        Bad("pixels of nothing", good[: good.index(b"mdat") + 4] + bytes(len(good) - good.index(b"mdat") - 4), _SUFFIX),
        Bad("the ftyp box alone", good[: struct.unpack_from(">I", good)[0]], _SUFFIX),
        Bad("another brand", patched(good, 8, b"avif"), _SUFFIX, refused=False),
        Bad("no bytes", b"", _SUFFIX),
        *cut("8 bits", good, _SUFFIX, (5, 11, 12, 30, 60, 120, 200, 300, len(good) // 2)),
        *cut("10 bits", other, _SUFFIX, (40, 100, 250, len(other) // 2)),
    ]
    return files


def bomb() -> bytes:
    """A picture that claims 2³⁰ pixels."""
    good = _good()[0].data
    return patched(good, good.index(b"ispe") + 8, struct.pack(">II", 2**15, 2**15))
