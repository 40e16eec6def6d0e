"""DDS textures of light, from Microsoft's programming guide for DDS: pictures and cubes of halves, floats and BC6H."""

from __future__ import annotations

import struct

import numpy as np

from corpus.files import DESCRIBE, HEIGHT, READ, READ_RADIANCE, WIDTH, Bad, Corpus, Good, cut, integer, patched, picture

_SUFFIX = ".dds"
_FIELDS = {
    "size of the header": 4,
    "height": 12,
    "width": 16,
    "depth": 24,
    "levels": 28,
    "size of the pixel format": 76,
    "flags of the pixel format": 80,
    "kinds of surface": 108,
    "faces": 112,
    "DXGI format": 128,
    "dimension": 132,
    "flags of the second header": 136,
    "count of the array": 140,
}
_VITAL = ("size of the header", "height", "width", "size of the pixel format", "DXGI format")


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("DDS", _good(), _bad(), (READ, READ_RADIANCE, DESCRIBE))


def _file(size: tuple[int, int], pixels: bytes, code: int, *, cube: bool = False, levels: int = 1) -> bytes:
    width, height = size
    inner = struct.pack("<2I4s5I", 32, 4, b"DX10", 0, 0, 0, 0, 0)
    head = struct.pack("<7I", 124, 0x21007, height, width, 0, 0, levels) + bytes(44) + inner
    head += struct.pack("<5I", 0x401008, 0xFE00 if cube else 0, 0, 0, 0)
    return b"DDS " + head + struct.pack("<5I", code, 3, 4 if cube else 0, 1, 0) + pixels


def _good() -> list[Good]:
    light = picture(21)
    four = np.concatenate([light, np.ones((HEIGHT, WIDTH, 1), np.float32)], axis=-1)
    cube = np.random.default_rng(3).integers(1, 99, (6, 4, 4, 3)).astype("<f4")
    size = (WIDTH, HEIGHT)
    return [
        Good("half", _file(size, four.astype("<f2").tobytes(), 10), _SUFFIX, light),
        Good("float", _file(size, four.astype("<f4").tobytes(), 2), _SUFFIX, light),
        Good("three floats", _file(size, light.astype("<f4").tobytes(), 6), _SUFFIX, light),
        Good("cube", _file((4, 4), cube.tobytes(), 6, cube=True), _SUFFIX),
        Good("BC6H", _file((8, 8), bytes(4 * 16), 95), _SUFFIX),
    ]


def _bad() -> list[Bad]:
    half, _, _, cube, blocks = (each.data for each in _good())
    files = []
    for name, place in _FIELDS.items():
        present = struct.unpack_from("<I", half, place)[0]
        for value in (0, 1, 5, 2**16 + 1, 2**31 - 1, 2**32 - 1):
            # A smaller picture, and a format of smaller texels, are there too.
            smaller = (name in ("height", "width") and 0 < value <= 5) or (name == "DXGI format" and value == 1)
            wrong = patched(half, place, integer(value, "I"))
            if value != present:
                files.append(Bad(f"{name} {value}", wrong, _SUFFIX, name in _VITAL and not smaller))
    files += [
        Bad("a cube of five faces", patched(cube, 112, integer(0x7E00, "I")), _SUFFIX, refused=False),
        Bad("a cube that is not square", patched(cube, 16, integer(2, "I")), _SUFFIX),
        Bad("blocks of a vast picture", patched(blocks, 12, integer(2**15, "I") * 2), _SUFFIX),
        Bad("another identifier", b"DDX " + half[4:], _SUFFIX),
        Bad("texels of NaN", half[:148] + b"\xff" * (len(half) - 148), _SUFFIX, refused=False),
        Bad("blocks of noise", blocks[:148] + b"\xe5" * 64, _SUFFIX, refused=False),
        Bad("no bytes", b"", _SUFFIX),
        *cut("half", half, _SUFFIX, (3, 5, 127, 128, 147, 148, 200, -1)),
        *cut("cube", cube, _SUFFIX, (140, -1, -48)),
        *cut("BC6H", blocks, _SUFFIX, (148, -1, -16)),
    ]
    return files


def bomb() -> bytes:
    """A cube of blocks that claims 32768 pixels a side, 6 GiB of them and 72 GiB of floats."""
    return _file((2**15, 2**15), bytes(64), 95, cube=True)
