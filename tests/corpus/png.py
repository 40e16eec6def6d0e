"""PNG: chunk by chunk from the specification (W3C, third edition), with checksums that are right or wrong."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

import numpy as np

from corpus.files import DESCRIBE, HEIGHT, READ, READ_FACTS, READ_PHOTOGRAPH, WIDTH, Bad, Corpus, Good, cut, patched

_SUFFIX = ".png"
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_IEND = b"\0\0\0\0IEND\xae\x42\x60\x82"

Chunk = tuple[bytes, bytes]


def corpus() -> Corpus:
    """The good and bad files of the format."""
    return Corpus("PNG", _good(), _bad(), (READ_PHOTOGRAPH, READ, DESCRIBE, READ_FACTS), repaired)


def repaired(data: bytes) -> bytes:
    """The same with the checksum of every chunk that can still be found made right."""
    fixed, place = bytearray(data), len(_SIGNATURE)
    while place + 12 <= len(fixed):
        (length,) = struct.unpack_from(">I", fixed, place)
        end = place + 8 + length
        if end + 4 > len(fixed):
            break
        struct.pack_into(">I", fixed, end, zlib.crc32(fixed[place + 4 : end]))
        place = end + 4
    return bytes(fixed)


def chunk(name: bytes, content: bytes = b"", length: int | None = None) -> bytes:
    """One chunk; `length` where it is not that of its content."""
    said = len(content) if length is None else length
    return struct.pack(">I", said) + name + content + struct.pack(">I", zlib.crc32(name + content))


def _file(chunks: Sequence[Chunk]) -> bytes:
    return _SIGNATURE + b"".join(chunk(name, content) for name, content in chunks)


def _head(width: int = WIDTH, height: int = HEIGHT, bits: int = 8, colour: int = 2, *rest: int) -> Chunk:
    return b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, *(rest or (0, 0, 0)))


def _lines(pixels: np.ndarray) -> bytes:
    """The scan lines, each behind a filter of 0, deflated."""
    stored = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(len(pixels), -1)
    return zlib.compress(b"".join(b"\0" + line.tobytes() for line in stored))


def _pixels(kind: type[np.unsignedinteger] = np.uint8) -> np.ndarray:
    random = np.random.default_rng(11)
    return random.integers(0, np.iinfo(kind).max, (HEIGHT, WIDTH, 3), endpoint=True).astype(kind)


def _good() -> list[Good]:
    eight, sixteen = _pixels(), _pixels(np.uint16)
    grey = eight[..., 0]
    palette = np.random.default_rng(12).integers(0, 256, (256, 3)).astype(np.uint8)
    texts = (b"tEXt", b"Comment\0made by hand"), (b"gAMA", struct.pack(">I", 45455)), (b"sRGB", b"\0")
    half = len(_lines(eight)) // 2
    several = [(b"IDAT", _lines(eight)[:half]), (b"IDAT", _lines(eight)[half:])]
    return [
        Good("8 bits", _file([_head(), (b"IDAT", _lines(eight)), (b"IEND", b"")]), _SUFFIX, eight),
        Good("16 bits", _file([_head(16, 8, 16), (b"IDAT", _lines(sixteen)), (b"IEND", b"")]), _SUFFIX, sixteen),
        Good(
            "grey",
            _file([_head(16, 8, 8, 0), (b"IDAT", _lines(grey)), (b"IEND", b"")]),
            _SUFFIX,
            np.repeat(grey[..., None], 3, 2),
        ),
        Good(
            "palette",
            _file([_head(16, 8, 8, 3), (b"PLTE", palette.tobytes()), (b"IDAT", _lines(grey)), (b"IEND", b"")]),
            _SUFFIX,
            palette[grey],
        ),
        Good("several chunks of pixels", _file([_head(), *several, (b"IEND", b"")]), _SUFFIX, eight),
        Good("texts", _file([_head(), *texts, (b"IDAT", _lines(eight)), (b"IEND", b"")]), _SUFFIX, eight),
    ]


def _bad() -> list[Bad]:
    lines = _lines(_pixels())
    end: Chunk = (b"IEND", b"")
    good = _file([_head(), (b"IDAT", lines), end])
    bad: list[tuple[str, bytes]] = []
    lenient: list[tuple[str, bytes]] = []
    for value in (0, 2**16 + 1, 2**31 - 1, 2**31, 2**32 - 1):
        bad.append((f"width {value}", _file([_head(width=value), (b"IDAT", lines), end])))
        bad.append((f"height {value}", _file([_head(height=value), (b"IDAT", lines), end])))
    bad += [
        ("a line more than there is", _file([_head(height=9), (b"IDAT", lines), end])),
        ("a column more than there is", _file([_head(width=17), (b"IDAT", lines), end])),
        ("65535 × 4096 pixels", _file([_head(65535, 4096), (b"IDAT", lines), end])),
    ]
    for bits, colour in ((0, 2), (3, 2), (4, 2), (32, 2), (255, 2), (8, 1), (8, 5), (8, 7), (8, 255), (16, 3), (2, 4)):
        bad.append((f"{bits} bits of colour type {colour}", _file([_head(16, 8, bits, colour), (b"IDAT", lines), end])))
    for rest, name in (((1, 0, 0), "compression 1"), ((0, 1, 0), "filtering 1"), ((0, 0, 2), "interlacing 2")):
        bad.append((name, _file([_head(16, 8, 8, 2, *rest), (b"IDAT", lines), end])))
    bad += [
        ("interlacing that is not there", _file([_head(16, 8, 8, 2, 0, 0, 1), (b"IDAT", lines), end])),
        ("no palette", _file([_head(16, 8, 8, 3), (b"IDAT", lines), end])),
        ("a palette of two bytes", _file([_head(16, 8, 8, 3), (b"PLTE", b"ab"), (b"IDAT", lines), end])),
        ("a palette of 257", _file([_head(16, 8, 8, 3), (b"PLTE", bytes(771)), (b"IDAT", lines), end])),
        ("no header", _file([(b"IDAT", lines), end])),
        ("a header of 12 bytes", _file([(b"IHDR", _head()[1][:12]), (b"IDAT", lines), end])),
        ("an empty header", _file([(b"IHDR", b""), (b"IDAT", lines), end])),
        ("no pixels", _file([_head(), end])),
        ("pixels of no bytes", _file([_head(), (b"IDAT", b""), end])),
        ("pixels of zeros", _file([_head(), (b"IDAT", bytes(200)), end])),
        ("pixels of noise", _file([_head(), (b"IDAT", b"\x55" * 300), end])),
        ("pixels cut short", _file([_head(), (b"IDAT", lines[: len(lines) // 2]), end])),
        ("pixels damaged within", _file([_head(), (b"IDAT", lines[:40] + b"\xff" * 20 + lines[60:]), end])),
        ("no end", _file([_head(), (b"IDAT", lines)])),
        ("a signature alone", _SIGNATURE),
        ("a signature of seven bytes", _SIGNATURE[:7]),
        ("converted line ends", good.replace(b"\r\n", b"\n")),
        ("a chunk of 2^31 − 1 bytes", _SIGNATURE + chunk(*_head()) + chunk(b"tEXt", b"a\0b", 2**31 - 1)),
        ("a chunk of 2^32 − 1 bytes", _SIGNATURE + chunk(*_head()) + chunk(b"tEXt", b"a\0b", 2**32 - 1)),
        ("a chunk of a byte too many", _SIGNATURE + chunk(*_head()) + chunk(b"IDAT", lines, len(lines) + 1) + _IEND),
        ("a chunk of a byte too few", _SIGNATURE + chunk(*_head()) + chunk(b"IDAT", lines, len(lines) - 1) + _IEND),
        ("a chunk whose name is no name", _file([_head(), (b"\0\1\2\3", b""), (b"IDAT", lines), end])[:-6]),
        ("an unknown chunk that must be known", _file([_head(), (b"ABCD", b"x"), (b"IDAT", lines), end])),
    ]
    for at in (8, 16, 29, 33, 45, len(good) - 13, len(good) - 5, len(good) - 1):
        bad.append((f"bit 1 of byte {at} flipped", patched(good, at, bytes([good[at] ^ 2]))))
    lenient += [
        ("a filter that is none", _file([_head(), (b"IDAT", zlib.compress((b"\x09" + bytes(48)) * 8)), end])),
        ("pixels with a wrong checksum", _file([_head(), (b"IDAT", lines[:-1] + b"!"), end])),
        ("a line too many", _file([_head(height=7), (b"IDAT", lines), end])),
        ("two headers", _file([_head(), _head(8, 8), (b"IDAT", lines), end])),
        ("bytes behind", good + bytes(300)),
        ("a bomb of pixels", _file([_head(), (b"IDAT", zlib.compress(bytes(2**25), 9)), end])),
        ("a bomb of text", _file([_head(), (b"zTXt", b"a\0\0" + zlib.compress(bytes(2**25))), (b"IDAT", lines), end])),
        (
            "a bomb of a profile",
            _file([_head(), (b"iCCP", b"a\0\0" + zlib.compress(bytes(2**25))), (b"IDAT", lines), end]),
        ),
        ("text without a name", _file([_head(), (b"tEXt", b""), (b"IDAT", lines), end])),
        ("text of bytes that are none", _file([_head(), (b"iTXt", b"\xff\0\1\1\xfe\0\xff\0x"), (b"IDAT", lines), end])),
        ("a gamma of 0", _file([_head(), (b"gAMA", bytes(4)), (b"IDAT", lines), end])),
        ("a gamma of two bytes", _file([_head(), (b"gAMA", b"ab"), (b"IDAT", lines), end])),
        ("primaries of nothing", _file([_head(), (b"cHRM", bytes(32)), (b"IDAT", lines), end])),
        ("EXIF of noise", _file([_head(), (b"eXIf", b"\x55" * 99), (b"IDAT", lines), end])),
        ("EXIF in a circle", _file([_head(), (b"eXIf", _circle()), (b"IDAT", lines), end])),
        ("EXIF with a huge count", _file([_head(), (b"eXIf", _huge()), (b"IDAT", lines), end])),
        ("ten thousand empty chunks", _file([_head(), *[(b"teXt", b"")] * 10_000, (b"IDAT", lines), end])),
        ("animation without frames", _file([_head(), (b"acTL", bytes(8)), (b"IDAT", lines), end])),
        ("a transparency of a wrong length", _file([_head(), (b"tRNS", b"a"), (b"IDAT", lines), end])),
    ]
    files = [Bad(name, data, _SUFFIX) for name, data in bad]
    files += [Bad(name, data, _SUFFIX, refused=False) for name, data in lenient]
    return files + cut("8 bits", good, _SUFFIX, (12, 20, 33, 41, 100, -8, -1))


def _circle() -> bytes:
    """A TIFF whose EXIF folder is its first one."""
    return b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x8769, 4, 1, 8, 8)


def _huge() -> bytes:
    """A TIFF whose one tag has 2^32 − 1 values."""
    return b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x829A, 5, 2**32 - 1, 8, 0)


def bomb() -> bytes:
    """A PNG of 353 bytes that claims 60,000 × 60,000 pixels, its checksums right."""
    start = _SIGNATURE + chunk(*_head(60_000, 60_000))
    room = 353 - len(start) - len(_IEND) - 12
    return start + chunk(b"IDAT", zlib.compress(bytes(2**16), 9).ljust(room, b"\0")[:room]) + _IEND
