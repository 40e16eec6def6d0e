"""KTX 2.0 cubes of halves and floats, from the Khronos specification, revision 4."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from corpus.files import READ_CUBE, Bad, Corpus, Good, cut, integer, patched

_SUFFIX = ".ktx2"
_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_FIELDS = {
    "vkFormat": 12,
    "typeSize": 16,
    "width": 20,
    "height": 24,
    "depth": 28,
    "layers": 32,
    "faces": 36,
    "levels": 40,
    "supercompression": 44,
    "place of the descriptor": 48,
    "bytes of the descriptor": 52,
    "place of the keys": 56,
    "bytes of the keys": 60,
}
_TOLD_ELSEWHERE = (
    "typeSize",
    "place of the descriptor",
    "bytes of the descriptor",
    "place of the keys",
    "bytes of the keys",
)


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("KTX2", _good(), _bad(), (READ_CUBE,))


def _cube(sizes: Sequence[int], number: str = "<f2") -> tuple[bytes, np.ndarray]:
    """A cube of those sizes, and its largest level as a strip of faces below each other."""
    random = np.random.default_rng(14)
    levels = [random.integers(1, 1000, (6, size, size, 4)).astype(number) for size in sizes]
    for level in levels:
        level[..., 3] = 1
    texel = 4 * levels[0].itemsize
    descriptor = struct.pack("<I", 44) + struct.pack("<IHHBBBBIII", 0, 2, 40, 1, 1, 1, 0, 0, texel, 0) + bytes(16)
    keys = struct.pack("<I", 18) + b"KTXorientation\0rd\0" + bytes(2)
    descriptor_at = 80 + 24 * len(levels)
    end = descriptor_at + len(descriptor) + len(keys)
    place, index = end + -end % texel, b""
    for level in reversed(levels):
        index = struct.pack("<3Q", place, level.nbytes, level.nbytes) + index
        place += level.nbytes
    vk_format = 97 if levels[0].itemsize == 2 else 109
    counts = (vk_format, levels[0].itemsize, sizes[0], sizes[0], 0, 0, 6, len(levels), 0)
    said = (descriptor_at, len(descriptor), descriptor_at + len(descriptor), len(keys))
    head = _IDENTIFIER + struct.pack("<9I4I2Q", *counts, *said, 0, 0) + index + descriptor + keys
    pixels = b"".join(level.tobytes() for level in reversed(levels))
    return head + bytes(-end % texel) + pixels, levels[0][..., :3].astype(np.float32).reshape(-1, sizes[0], 3)


def _good() -> list[Good]:
    named = {"half": _cube([4, 2, 1]), "float": _cube([4, 2, 1], "<f4"), "one level": _cube([8])}
    return [Good(name, data, _SUFFIX, pixels) for name, (data, pixels) in named.items()]


def _bad() -> list[Bad]:
    good, _ = _cube([4, 2, 1])
    files = []
    for name, place in _FIELDS.items():
        present = struct.unpack_from("<I", good, place)[0]
        for value in (0, 1, 5, 2**16 + 1, 2**31 - 1, 2**32 - 1):
            zero_is_right = name in ("levels", "depth", "layers", "supercompression") and value == 0
            if value == present or zero_is_right or (name == "levels" and value == 1):
                continue
            wrong = patched(good, place, integer(value, "I"))
            files.append(Bad(f"{name} {value}", wrong, _SUFFIX, name not in _TOLD_ELSEWHERE))
    for level in range(3):
        for field, place in (("offset", 80 + 24 * level), ("length", 88 + 24 * level)):
            for value in (1, 2**31, 2**63 - 1, 2**64 - 1):
                wrong = patched(good, place, integer(value, "Q"))
                must = field == "length" or value > 1
                files.append(Bad(f"{field} {value} of level {level}", wrong, _SUFFIX, must))
    files += [
        Bad("levels in one place", patched(good, 104, good[80:88]), _SUFFIX, refused=False),
        Bad("a vast cube of few bytes", patched(good, 20, integer(2**15, "I") * 2), _SUFFIX),
        Bad("a side of 2^16", patched(good, 20, integer(2**16, "I") * 2), _SUFFIX),
        Bad("another identifier", b"\xabKTX 11" + good[7:], _SUFFIX),
        Bad("converted line ends", good.replace(b"\r\n", b"\n"), _SUFFIX),
        Bad("texels of NaN", good[:300] + b"\xff" * (len(good) - 300), _SUFFIX, refused=False),
        Bad("no bytes", b"", _SUFFIX),
    ]
    return files + cut("half", good, _SUFFIX, (11, 12, 79, 81, 104, 200, -1, -200))


def bomb() -> bytes:
    """A cube that claims 16384 pixels a side, 12 GiB of halves, and says so of its level too."""
    good, _ = _cube([8])
    wrong = patched(good, 20, integer(2**14, "I") * 2)
    return patched(wrong, 88, integer(48 * 2**28, "Q"))
