"""Camera raw, as DNG: the suite's own small files with their tags overwritten."""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path

import numpy as np

from corpus.files import DESCRIBE, READ, READ_FACTS, READ_RAW, Bad, Corpus, Good, cut, integer, patched
from dng_files import write_dng

_SUFFIX = ".dng"
_NAMES = {
    256: "width",
    257: "height",
    259: "compression",
    262: "photometric",
    273: "place of the pixels",
    277: "samples",
    278: "rows in a strip",
    279: "bytes of pixels",
    33421: "repeat of the pattern",
    33422: "pattern",
    50714: "black",
    50717: "white",
    50829: "active area",
}


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("camera raw", _good(), _bad(), (READ_RAW, READ, DESCRIBE, READ_FACTS))


def _dng(height: int = 40, width: int = 48, **options: object) -> bytes:
    mosaic = np.random.default_rng(15).integers(512, 16000, (height, width), np.uint16)
    with tempfile.TemporaryDirectory() as folder:
        return write_dng(Path(folder) / "a.dng", mosaic, **options).read_bytes()  # pyright: ignore[reportArgumentType]


def _good() -> list[Good]:
    files = {
        "plain": _dng(),
        "margins": _dng(margins=(2, 4)),
        "turned": _dng(orientation=6),
        "no exposure": _dng(seconds=None, iso=None, f_number=None),
    }
    return [Good(name, data, _SUFFIX) for name, data in files.items()]


def _entry(data: bytes, tag: int) -> int:
    """Where the entry of a tag stands in the first folder."""
    at = struct.unpack_from("<I", data, 4)[0]
    for number in range(struct.unpack_from("<H", data, at)[0]):
        if struct.unpack_from("<H", data, at + 2 + 12 * number)[0] == tag:
            return at + 2 + 12 * number
    raise ValueError(f"no tag {tag}")


def _bad() -> list[Bad]:
    good = _dng()
    folder = struct.unpack_from("<I", good, 4)[0]
    files = []
    for tag, name in _NAMES.items():
        at = _entry(good, tag)
        # LibRaw mends much by itself; no reader can find pixels of a picture without sides.
        sides = tag in (256, 257)
        for value in (0, 1, 2**16 - 1, 2**31 - 1, 2**32 - 1):
            wrong = patched(good, at + 8, integer(value, "I"))
            must = sides and value in (0, 2**31 - 1, 2**32 - 1)
            if wrong != good:
                files.append(Bad(f"{name} {value}", wrong, _SUFFIX, must))
        files.append(Bad(f"{name} of 2^32 − 1 values", patched(good, at + 4, b"\xff" * 4), _SUFFIX, False))
        files.append(Bad(f"{name} of no values", patched(good, at + 4, bytes(4)), _SUFFIX, False))
        files.append(Bad(f"{name} of a type that is none", patched(good, at + 2, b"\x63\0"), _SUFFIX, False))
    for place in (0, 4, folder + 2, len(good), 2**31, 2**32 - 1):
        files.append(Bad(f"its folder at {place}", good[:4] + integer(place, "I") + good[8:], _SUFFIX))
    files += [
        Bad("a folder of 65535 entries", patched(good, folder, b"\xff\xff"), _SUFFIX, False),
        Bad("the other byte order", b"MM\0*" + good[4:], _SUFFIX),
        Bad("an EXIF folder beyond the file", patched(good, _entry(good, 0x8769) + 8, b"\xff" * 4), _SUFFIX, False),
        Bad("an EXIF folder that is the first", patched(good, _entry(good, 0x8769) + 8, good[4:8]), _SUFFIX, False),
        Bad("the head of a Canon CR2 alone", b"II*\0\x10\0\0\0CR\2\0" + bytes(40), _SUFFIX),
        Bad("the head of a Canon CR3 alone", b"\0\0\0\x18ftypcrx " + bytes(60), _SUFFIX),
        Bad("the head of a Fujifilm RAF alone", b"FUJIFILMCCD-RAW 0201FF129502" + bytes(100), _SUFFIX),
        Bad("the head of a Panasonic RW2 alone", b"IIU\0\x18\0\0\0" + bytes(60), _SUFFIX),
        Bad("the head of an Olympus ORF alone", b"IIRO\x08\0\0\0" + bytes(60), _SUFFIX),
        Bad("the head of a Sigma X3F alone", b"FOVb" + bytes(60), _SUFFIX),
    ]
    return files + cut("plain", good, _SUFFIX, (8, 9, folder, folder + 30, 2000))
