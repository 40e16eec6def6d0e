"""Portable float maps, and Debevec's raw floats, which are nothing but numbers.

Formats: Debevec's "PFM Portable FloatMap Image Format" (rows from the bottom, a negative scale is little-endian).
"""

from __future__ import annotations

import gzip
import struct
import zlib

import numpy as np

from corpus.files import HEIGHT, WIDTH, Bad, Corpus, Good, cut, patched, picture

_PFM, _FLOAT, _PACKED = ".pfm", ".float", ".float.gz"
_SIZES = ("0", "-1", "", "abc", "1e1", "0x10", "8.0", "1_6", "１６", "65537", "2147483647", "4294967295", "9" * 5000)
_SCALES = (
    "0",
    "-0.0",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "abc",
    "",
    "0x1p3",
    "1,0",
    "--1",
    "1_0",
    "infinity",
    "٣",
    "1e-999",
)


def pfm() -> Corpus:
    """The good and bad files of PFM."""
    return Corpus("PFM", _good_pfm(), _bad_pfm())


def raw_float() -> Corpus:
    """The good and bad files of raw floats."""
    return Corpus("raw float", _good_float(), _bad_float(), repaired=_packed_again)


def _portable(values: np.ndarray, scale: str = "-1.0", *, magic: str | None = None) -> bytes:
    order = "<f4" if scale.startswith("-") else ">f4"
    rows = np.ascontiguousarray(values[::-1], order)
    magic = magic or ("PF" if values.ndim == 3 else "Pf")
    return f"{magic}\n{values.shape[1]} {values.shape[0]}\n{scale}\n".encode() + rows.tobytes()


def _good_pfm() -> list[Good]:
    colour = picture(1)
    grey = colour[..., 0]
    three = np.repeat(grey[..., None], 3, axis=2)
    return [
        Good("colour, little-endian", _portable(colour), _PFM, colour),
        Good("colour, big-endian", _portable(colour, "1.0"), _PFM, colour),
        Good("grey, little-endian", _portable(grey), _PFM, three),
        Good("grey, big-endian", _portable(grey, "1"), _PFM, three),
        Good("one pixel", _portable(colour[:1, :1]), _PFM, colour[:1, :1]),
    ]


def _bad_pfm() -> list[Bad]:
    good = _portable(picture(1))
    pixels = good[-WIDTH * HEIGHT * 12 :]
    bad = [(f"width {size[:20]!r}", f"PF\n{size} 8\n-1.0\n".encode() + pixels) for size in _SIZES]
    bad += [(f"height {size[:20]!r}", f"PF\n16 {size}\n-1.0\n".encode() + pixels) for size in _SIZES]
    bad += [(f"scale {scale!r}", f"PF\n16 8\n{scale}\n".encode() + pixels) for scale in _SCALES]
    bad += [
        (f"first bytes {magic!r}", magic + good[2:])
        for magic in (b"PG", b"pF", b"P", b"\0F", b"P\0", b"PF6", b"PFPF", b"P7")
    ]
    bad += [
        ("no size", b"PF\n"),
        ("no scale", b"PF\n16 8\n"),
        ("one number of size", b"PF\n16\n-1.0\n" + pixels),
        ("a scale that does not end", b"PF\n16 8\n-1." + b"0" * 100_000),
        ("spaces without end", b"PF\n" + b" " * 100_000),
        ("line breaks without end", b"PF\n" + b"\n" * 100_000),
        ("a comment without end", b"PF\n#" + b"x" * 100_000),
        ("comments without end", b"PF\n" + b"# x\n" * 25_000),
        ("a NUL in the size", b"PF\n1\x006 8\n-1.0\n" + pixels),
        ("bytes that are no text", b"PF\n\xff\xfe 8\n-1.0\n" + pixels),
        ("grey where it says colour", _portable(picture(1)[..., 0], magic="PF")),
        ("2^28 pixels in 100 bytes", b"PF\n16384 16384\n-1.0\n" + bytes(100)),
        ("one column of 65536 in 100 bytes", b"Pf\n1 65536\n-1.0\n" + bytes(100)),
        ("a size whose product overflows 64 bits", b"PF\n4294967297 4294967297\n-1.0\n" + bytes(100)),
    ]
    files = [Bad(name, data, _PFM) for name, data in bad]
    start = len(good) - len(pixels)
    files += cut("colour", good, _PFM, (start, start + 1, start + 12 * WIDTH, -12 * WIDTH, -12, -4, -1))
    files += cut("grey", _portable(picture(1)[..., 0]), _PFM, (-4 * WIDTH, -4, -1))
    lenient = [
        ("three numbers of size", b"PF\n16 8 3\n-1.0\n" + pixels),
        ("bytes after the picture", good + bytes(500)),
        ("colour where it says grey", _portable(picture(1), magic="Pf")),
        ("not a number", patched(good, start, struct.pack("<f", float("nan")))),
        ("infinity", patched(good, start, struct.pack("<f", float("inf")))),
        ("negative light", patched(good, start, struct.pack("<f", -1.0))),
        ("the other byte order", b"PF\n16 8\n1.0\n" + pixels),
        ("line ends converted", b"PF\r\n16 8\r\n-1.0\r\n" + pixels),
        ("a scale of 10^30", b"PF\n16 8\n-1e30\n" + pixels),
        ("a scale of 10^-40", b"PF\n16 8\n-1e-40\n" + pixels),
        ("a size of letters after numbers", b"PF\n16 8x\n-1.0\n" + pixels),
    ]
    return files + [Bad(name, data, _PFM, refused=False) for name, data in lenient]


def _packed_again(data: bytes) -> bytes:
    """A damaged member of gzip with the checksum and length of what it now holds; anything else as it is."""
    if data[:3] != b"\x1f\x8b\x08" or len(data) < 19:
        return data
    try:
        held = zlib.decompressobj(-zlib.MAX_WBITS).decompress(data[10:], 2**24)
    except zlib.error:
        return data
    return data[:-8] + struct.pack("<II", zlib.crc32(held), len(held))


def _good_float() -> list[Good]:
    square = picture(2, 8, 8)
    wide = picture(3, 20, 20)
    little, big = square.astype("<f4").tobytes(), square.astype(">f4").tobytes()
    return [
        Good("little-endian", little, _FLOAT, square),
        Good("big-endian", big, _FLOAT, square),
        Good("little-endian, packed", gzip.compress(little, mtime=0), _PACKED, square),
        Good("big-endian, packed", gzip.compress(wide.astype(">f4").tobytes(), mtime=0), _PACKED, wide),
    ]


def _bad_float() -> list[Bad]:
    square = picture(2, 8, 8).astype("<f4").tobytes()
    packed = gzip.compress(square, mtime=0)
    bad = [(f"{count} bytes, not of whole pixels", square[:count], _FLOAT) for count in (1, 3, 11, 13, 98, 767, 766)]
    bad += [
        (f"{count} pixels, no square", (square * 9)[: 12 * count], _FLOAT)
        for count in (2, 3, 5, 8, 10, 15, 17, 24, 26, 48, 50, 63, 65, 99, 101, 128, 250, 255, 257, 500)
    ]
    for at in (1, 2, 3, 9, 10, 11, 20, len(packed) // 2, -9, -8, -4, -1):
        bad.append((f"packed, ends at {at % len(packed)} of {len(packed)}", packed[:at], _PACKED))
    bad += [
        ("a wrong checksum", patched(packed, len(packed) - 8, b"abcd"), _PACKED),
        ("a checksum of 0", patched(packed, len(packed) - 8, bytes(4)), _PACKED),
        ("a wrong length", patched(packed, len(packed) - 4, b"\x01\0\0\0"), _PACKED),
        ("a length of 2^32 − 1", patched(packed, len(packed) - 4, b"\xff" * 4), _PACKED),
        ("an unknown method", patched(packed, 2, b"\x07"), _PACKED),
        ("a method of 0", patched(packed, 2, b"\0"), _PACKED),
        ("an extra field beyond the file", packed[:3] + b"\x04" + packed[4:10] + b"\xff\xff" + packed[10:], _PACKED),
        ("a name without end", packed[:3] + b"\x08" + packed[4:10] + b"x" * 5000, _PACKED),
        ("a comment without end", packed[:3] + b"\x10" + packed[4:10] + b"x" * 5000, _PACKED),
        ("an empty member", gzip.compress(b"", mtime=0), _PACKED),
        ("a thousand empty members", gzip.compress(b"", mtime=0) * 1000, _PACKED),
        ("packed twice", gzip.compress(packed, mtime=0), _PACKED),
        ("a block of a type that is none", packed[:10] + b"\x07" + packed[11:], _PACKED),
        ("a stored block of another length", packed[:10] + b"\x01\x10\x00\x00\x00" + bytes(30), _PACKED),
        ("a distance beyond the window", packed[:10] + b"\x63\x00\x02\x00" + bytes(20), _PACKED),
        ("zlib where gzip should be", zlib.compress(square), _PACKED),
        ("not packed at all, of a size that is no square", square[:72], _PACKED),
        ("packed, not of whole pixels", gzip.compress(square[:-5], mtime=0), _PACKED),
        ("packed, no square", gzip.compress(square[:-12], mtime=0), _PACKED),
        ("two members, no square together", packed + packed, _PACKED),
        ("a second member that is damaged", packed + packed[:-1], _PACKED),
        ("a bomb of one gibibyte", _bomb(2**20) * 1024, _PACKED),
        ("a bomb, cut short", (_bomb(2**20) * 64)[:-100], _PACKED),
    ]
    files = [Bad(name, data, suffix) for name, data, suffix in bad]
    lenient = [
        ("nothing but NaN", b"\0\0\xc0\x7f" * 192, _FLOAT),
        ("nothing but infinity", b"\0\0\x80\x7f" * 192, _FLOAT),
        ("nothing but 1s in bits", b"\xff" * 768, _FLOAT),
        ("nothing but 0", bytes(768), _FLOAT),
        ("text", b"The quick brown fox jumps over the lazy dog.    " * 16, _FLOAT),
        ("numbers that make sense in both orders", b"\x3f\x80\x80\x3f" * 192, _FLOAT),
        ("numbers that make sense in neither", b"\x7f\x80\x80\x7f" * 192, _FLOAT),
        ("doubles", picture(2, 8, 8).astype("<f8").tobytes(), _FLOAT),
        ("halves", picture(2, 8, 8).astype("<f2").tobytes() * 2, _FLOAT),
        ("one pixel", square[:12], _FLOAT),
        ("one pixel of NaN", b"\0\0\xc0\x7f" * 3, _FLOAT),
        ("a NaN in the middle", patched(square, 384, b"\0\0\xc0\x7f"), _FLOAT),
        ("a negative number", patched(square, 384, b"\0\0\x80\xbf"), _FLOAT),
        ("reserved flags", patched(packed, 3, b"\xe0"), _PACKED),
        ("bytes of 0 behind", packed + bytes(100), _PACKED),
        ("other bytes behind", packed + b"x" * 100, _PACKED),
        ("not packed at all", square[:432], _PACKED),
    ]
    return files + [Bad(name, data, suffix, refused=False) for name, data, suffix in lenient]


def _bomb(size: int) -> bytes:
    """A member of gzip that holds `size` zeros."""
    return gzip.compress(bytes(size), 9, mtime=0)
