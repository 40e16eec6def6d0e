"""PNG: the header, a walk over the chunks that finds damage, and pixels through libpng (imagecodecs).

imagecodecs raises on damaged pixels, prints nothing and is exact in 16 bits, where Pillow rounds to 8 bits and
OpenImageIO prints. Its libpng accepts a file without its last chunk, and gives neither gamma nor profile: the walk over
the chunks does. Format: W3C PNG 3rd edition.
"""

from __future__ import annotations

import logging
import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import FormatError, warn
from relume.image.files.read_options import ReadOptions
from relume.image.files.signatures import one_line

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOURS = {0: ("grey", 1), 2: ("RGB", 3), 3: ("palette", 3), 4: ("grey with alpha", 2), 6: ("RGB with alpha", 4)}
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}  # 11.2.1, table 12
_KNOWN = (b"PLTE", b"IDAT", b"IEND")  # behind IHDR, those that a decoder must know
_SRGB_GAMMA = 0.45455  # the value to write for sRGB (11.3.2.2)
_SAME_GAMMA = 0.02  # 1/2.15 to 1/2.25, which nobody can see
_MOST_CHUNKS = 2**18  # of 8192 bytes of pixels, as libpng writes them, 2 GiB
_MOST_AHEAD = 2**12  # chunks ahead of the pixels: a few are usual, and each of its texts is one
_AFTER_HEADER = len(SIGNATURE) + 12 + 13  # bytes
_SILENCE = logging.NullHandler()
_TRANSFERS = {16: "PQ", 18: "HLG"}  # ITU-T H.273, table 3


@dataclass(frozen=True)
class Header:
    """What stands ahead of the pixels of a PNG.

    width, height, bits : of the picture, of each sample
    colour : "grey", "RGB", "palette", with or without " with alpha"
    channels : as decoded
    interlaced : whether the rows are stored in seven passes
    gamma : the exponent of encoding, None where the file names none, or names its colours otherwise
    transfer : "PQ" or "HLG" where the values are those; "" for all others
    """

    width: int
    height: int
    bits: int
    colour: str
    channels: int
    interlaced: bool
    gamma: float | None = None
    transfer: str = ""

    @property
    def samples(self) -> int:
        """How many numbers are stored for a pixel."""
        return 1 if self.colour == "palette" else self.channels


@dataclass(frozen=True, eq=False)
class Chunks:
    """What the chunks of a PNG hold that decoding needs.

    packed : the pieces of the deflated pixels
    ahead : name → content of IHDR, PLTE, tRNS and iCCP, where they stand ahead of the pixels
    end : the byte at which the file ends early, within a chunk or ahead of the last; None where it is whole
    """

    packed: list[memoryview]
    ahead: dict[bytes, bytes]
    end: int | None


def header(path: str | os.PathLike[str]) -> Header:
    """The header of a PNG, from its chunks ahead of the pixels; raises FormatError where it is damaged."""
    ahead: dict[bytes, bytes] = {}
    with open(path, "rb") as file:
        place = len(SIGNATURE)
        file.seek(place)
        for _ in range(_MOST_AHEAD):
            if len(head := file.read(8)) < 8 or head[4:] in (b"IDAT", b"IEND"):
                break
            length, name = struct.unpack(">I4s", head)
            if name in (b"gAMA", b"cICP", b"sRGB", b"iCCP") or (name == b"IHDR" and length == 13):
                ahead.setdefault(name, file.read(min(length, 13)))
            place += 12 + length
            file.seek(place)
    fields = ahead.get(b"IHDR", b"")
    if len(fields) != 13:
        raise FormatError(path, "PNG", "byte 8", "an IHDR chunk of 13 bytes", f"{len(fields)} bytes")
    width, height, bits, colour, packing, filtering, interlace = struct.unpack(">IIBBBBB", fields)
    if bits not in _DEPTHS.get(colour, ()):
        raise FormatError(path, "PNG", "its IHDR chunk", "a colour type of PNG", f"type {colour} of {bits} bits")
    if packing or filtering or interlace > 1:
        found = f"{packing}, {filtering} and {interlace}"
        raise FormatError(path, "PNG", "its IHDR chunk", "compression 0, filtering 0 and interlacing 0 or 1", found)
    code = ahead.get(b"cICP", b"")
    gamma = ahead.get(b"gAMA", b"")
    named = len(gamma) != 4 or ahead.keys() & {b"sRGB", b"iCCP", b"cICP"}
    return Header(
        width,
        height,
        bits,
        *_COLOURS[colour],
        interlaced=interlace == 1,
        gamma=None if named else struct.unpack(">I", gamma)[0] / 100_000,
        transfer=_TRANSFERS.get(code[1], "") if len(code) == 4 else "",
    )


def warn_of_other_encoding(path: str | os.PathLike[str], header: Header) -> None:
    """Say in a warning where the values of a PNG are encoded otherwise than those of sRGB."""
    if header.transfer:
        warn(f"{path}: its values are {header.transfer}, not sRGB; not converted")
    if header.gamma is not None and abs(header.gamma - _SRGB_GAMMA) > _SAME_GAMMA:
        exponent = f"1/{1 / header.gamma:.3g}" if header.gamma else "0"
        # What it does to a middle value.
        effect = abs(0.5 ** (1 / max(header.gamma, 0.1) - 1 / _SRGB_GAMMA) - 1)
        warn(f"{path}: its values are encoded by gamma {exponent}, not sRGB; not converted", effect)


def chunks(path: str | os.PathLike[str]) -> Chunks:
    """What a PNG's chunks hold, as far as the file goes; raises FormatError where one is altered or cannot be."""
    data = memoryview(Path(path).read_bytes())
    packed: list[memoryview] = []
    ahead: dict[bytes, bytes] = {}
    place = len(SIGNATURE)
    for _ in range(_MOST_CHUNKS):
        if place + 12 > len(data):
            return Chunks(packed, ahead, len(data))
        length, name = struct.unpack_from(">I4s", data, place)
        content, end = data[place + 8 : place + 8 + length], place + 8 + length
        _refuse_name(path, name, place)
        if end + 4 > len(data):
            return Chunks([*packed, content] if name == b"IDAT" else packed, ahead, len(data))
        computed = zlib.crc32(data[place + 4 : end])
        (stored,) = struct.unpack_from(">I", data, end)
        if computed != stored:
            where = f"the chunk {name.decode('latin-1')!r} at byte {place}"
            raise FormatError(path, "PNG", where, f"the checksum {stored:08x}", f"{computed:08x}")
        if name == b"IEND":
            return Chunks(packed, ahead, None)
        if name == b"IDAT":
            packed.append(content)
        elif name in (b"IHDR", b"PLTE", b"tRNS", b"iCCP") and not packed:
            ahead.setdefault(name, bytes(content))
        place = end + 4
    raise FormatError(path, "PNG", f"the chunk at byte {place}", "IEND", f"{_MOST_CHUNKS} chunks before it")


def decoded(path: str | os.PathLike[str], chunks: Chunks) -> np.ndarray:
    """(H, W, 1 to 4) uint8 or uint16: grey, RGB, each with alpha where the file has it or a transparent colour.

    Grey of less than 8 bits is widened such that white is 255. Raises FormatError where the pixels are damaged or the
    file ends early.
    """
    if chunks.end is not None:
        expected = "whole chunks, and IEND as the last"
        raise FormatError(path, "PNG", f"byte {chunks.end}", expected, "the end of the file")
    return _by_libpng(path, chunks, chunks.packed)


def whole_rows(path: str | os.PathLike[str], header: Header, chunks: Chunks) -> np.ndarray | None:
    """As `decoded`, the rows from the top that a file which ends early still holds; None where it is damaged besides.

    header : of a PNG that is not interlaced
    """
    length = 1 + -(-header.width * header.samples * header.bits // 8)
    wanted = length * header.height
    engine, found = zlib.decompressobj(), bytearray()
    try:
        for piece in chunks.packed:
            found += engine.decompress(piece, max(wanted - len(found), 1))
    except zlib.error:
        return None
    rows = len(found) // length
    # Rows of zeros stand for what is missing, so that the decoder finds a whole picture.
    filled = zlib.compress(bytes(found[: rows * length]).ljust(wanted, b"\0"), 1)
    return _by_libpng(path, chunks, [memoryview(filled)])[:rows]


def _by_libpng(path: str | os.PathLike[str], chunks: Chunks, packed: Sequence[memoryview]) -> np.ndarray:
    """The pixels of the chunks that matter to them; texts and times do not reach the decoder."""
    import imagecodecs

    logging.getLogger("imagecodecs").addHandler(_SILENCE)  # else its remarks go to the error output
    kept = [chunk(name, chunks.ahead[name]) for name in (b"IHDR", b"PLTE", b"tRNS") if name in chunks.ahead]
    whole = b"".join([SIGNATURE, *kept, *(chunk(b"IDAT", piece) for piece in packed), chunk(b"IEND", b"")])
    try:
        pixels = imagecodecs.png_decode(whole)
    except (imagecodecs.PngError, ValueError) as error:  # a UnicodeDecodeError where its message is no text
        reason = str(error) if str(error).isprintable() and not isinstance(error, ValueError) else "damage"
        raise FormatError(path, "PNG", "its pixels", "deflated data that is whole", one_line(reason)) from None
    return pixels[..., None] if pixels.ndim == 2 else pixels


def profile(chunks: Chunks, options: ReadOptions) -> bytes | None:
    """The ICC profile in a PNG, None where it has none; b"" for one that is damaged or beyond `options`."""
    if (packed := chunks.ahead.get(b"iCCP")) is None:
        return None
    # Behind its name, a zero, and the number of the compression (11.3.2.3).
    try:
        engine = zlib.decompressobj()
        inflated = engine.decompress(packed.partition(b"\0")[2][1:], options.metadata)
        return inflated if engine.eof else b""
    except zlib.error:
        return b""


def _refuse_name(path: str | os.PathLike[str], name: bytes, place: int) -> None:
    """IHDR comes first and once; a name of a capital letter is one that a decoder must know (5.4)."""
    first = place == len(SIGNATURE)
    if first != (name == b"IHDR") or not name.isalpha() or (name[:1].isupper() and name not in (*_KNOWN, b"IHDR")):
        expected = "IHDR" if first else "a kind of chunk that PNG knows here"
        raise FormatError(path, "PNG", f"byte {place + 4}", expected, repr(name.decode("latin-1")))


def encode(pixels: np.ndarray, exif: bytes = b"", profile: bytes | None = None, *, drawing: bool = True) -> bytes:
    """A PNG of (H, W, 3) uint8 or uint16 pixels, or of four channels, the last alpha, with EXIF and an ICC profile.

    drawing : look for patterns that repeat. The noise of a photograph has none, and goes without in a third of the time
    """
    import imagecodecs

    level, strategy = (6, imagecodecs.PNG.STRATEGY.DEFAULT) if drawing else (1, imagecodecs.PNG.STRATEGY.RLE)
    plain = bytes(
        imagecodecs.png_encode(
            np.ascontiguousarray(pixels), level=level, strategy=strategy, filter=imagecodecs.PNG.FILTER.SUB
        )
    )
    added = b""
    if profile:  # a name, a zero, and the number of the compression (11.3.2.3)
        added += chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(profile))
    if exif:
        added += chunk(b"eXIf", exif.removeprefix(b"Exif\0\0"))
    return plain[:_AFTER_HEADER] + added + plain[_AFTER_HEADER:]


def chunk(name: bytes, content: bytes | memoryview) -> bytes:
    """One chunk: its length, its name, what it holds, and the checksum."""
    return b"".join(
        [struct.pack(">I", len(content)), name, content, struct.pack(">I", zlib.crc32(content, zlib.crc32(name)))]
    )
