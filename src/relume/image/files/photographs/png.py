"""PNG chunks: what the header tells, a walk that finds every one that is cut short or altered, and a writer with EXIF.

Ours because libpng tells damage on stderr, and Pillow accepts a file whose last chunk is missing and rounds 16-bit
colour to 8 bits without a word; `png_pixels` decodes. Format: W3C PNG 3rd edition.
"""

from __future__ import annotations

import os
import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import FormatError
from relume.image.files.read_options import ReadOptions

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOURS = {0: ("grey", 1), 2: ("RGB", 3), 3: ("palette", 3), 4: ("grey with alpha", 2), 6: ("RGB with alpha", 4)}
_DEPTHS = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}  # 11.2.1, table 12
_KNOWN = (b"PLTE", b"IDAT", b"IEND")  # behind IHDR, those that a decoder must know
_SRGB_GAMMA = 0.45455  # the value to write for sRGB (11.3.2.2)
_SAME_GAMMA = 0.02  # 1/2.15 to 1/2.25, which nobody can see
_MOST_CHUNKS = 2**18  # of 8192 bytes of pixels, as libpng writes them, 2 GiB
_MOST_AHEAD = 2**12  # chunks ahead of the pixels: a few are usual, and each of its texts is one
_BAND = 2**20  # bytes deflated at a time: starting anew costs less than 1 part in 1000 of the file
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

    def bytes_of(self, width: int) -> int:
        """How many bytes a row of that many pixels is stored in, without the one that tells its filter."""
        return -(-width * self.samples * self.bits // 8)


@dataclass(frozen=True, eq=False)
class Chunks:
    """What the chunks of a PNG hold that decoding needs.

    packed : the pieces of the deflated pixels
    ahead : name → content of PLTE, tRNS and iCCP, where they stand ahead of the pixels
    end : the byte at which the file ends early, within a chunk or ahead of the last; None where it is whole
    """

    packed: list[memoryview]
    ahead: dict[bytes, bytes]
    end: int | None


def header(path: str | os.PathLike[str]) -> Header:
    """The header of a PNG, from its chunks ahead of the pixels; raises FormatError where it is damaged."""
    told: dict[bytes, bytes] = {}
    with open(path, "rb") as file:
        place = len(SIGNATURE)
        file.seek(place)
        for _ in range(_MOST_AHEAD):
            if len(head := file.read(8)) < 8 or head[4:] in (b"IDAT", b"IEND"):
                break
            length, name = struct.unpack(">I4s", head)
            if name in (b"gAMA", b"cICP", b"sRGB", b"iCCP") or (name == b"IHDR" and length == 13):
                told.setdefault(name, file.read(min(length, 13)))
            place += 12 + length
            file.seek(place)
    fields = told.get(b"IHDR", b"")
    if len(fields) != 13:
        raise FormatError(path, "PNG", "byte 8", "an IHDR chunk of 13 bytes", f"{len(fields)} bytes")
    width, height, bits, colour, packing, filtering, interlace = struct.unpack(">IIBBBBB", fields)
    if bits not in _DEPTHS.get(colour, ()):
        raise FormatError(path, "PNG", "its IHDR chunk", "a colour type of PNG", f"type {colour} of {bits} bits")
    if packing or filtering or interlace > 1:
        found = f"{packing}, {filtering} and {interlace}"
        raise FormatError(path, "PNG", "its IHDR chunk", "compression 0, filtering 0 and interlacing 0 or 1", found)
    code = told.get(b"cICP", b"")
    gamma = told.get(b"gAMA", b"")
    named = len(gamma) != 4 or told.keys() & {b"sRGB", b"iCCP", b"cICP"}
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
        warnings.warn(f"{path}: its values are {header.transfer}, not sRGB; not converted", stacklevel=4)
    if header.gamma is not None and abs(header.gamma - _SRGB_GAMMA) > _SAME_GAMMA:
        exponent = f"1/{1 / header.gamma:.3g}" if header.gamma else "0"
        warnings.warn(f"{path}: its values are encoded by gamma {exponent}, not sRGB; not converted", stacklevel=4)


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
            raise FormatError(path, "PNG", _where(name, place), f"the checksum {stored:08x}", f"{computed:08x}")
        if name == b"IEND":
            return Chunks(packed, ahead, None)
        if name == b"IDAT":
            packed.append(content)
        elif name in (b"PLTE", b"tRNS", b"iCCP") and not packed:
            ahead.setdefault(name, bytes(content))
        place = end + 4
    raise FormatError(path, "PNG", f"the chunk at byte {place}", "IEND", f"{_MOST_CHUNKS} chunks before it")


def refuse_cut(path: str | os.PathLike[str], chunks: Chunks) -> None:
    """Raise FormatError where a PNG ends early."""
    if chunks.end is not None:
        raise FormatError(
            path, "PNG", f"byte {chunks.end}", "whole chunks, and IEND as the last", "the end of the file"
        )


def profile(chunks: Chunks, reading: ReadOptions) -> bytes | None:
    """The ICC profile in a PNG, None where it has none; b"" for one that is damaged or beyond `reading`."""
    if (told := chunks.ahead.get(b"iCCP")) is None:
        return None
    # Behind its name, a zero, and the number of the compression (11.3.2.3).
    try:
        engine = zlib.decompressobj()
        inflated = engine.decompress(told.partition(b"\0")[2][1:], reading.metadata)
        return inflated if engine.eof else b""
    except zlib.error:
        return b""


def _refuse_name(path: str | os.PathLike[str], name: bytes, place: int) -> None:
    """IHDR comes first and once; a name of a capital letter is one that a decoder must know (5.4)."""
    first = place == len(SIGNATURE)
    if first != (name == b"IHDR") or not name.isalpha() or (name[:1].isupper() and name not in (*_KNOWN, b"IHDR")):
        expected = "IHDR" if first else "a kind of chunk that PNG knows here"
        raise FormatError(path, "PNG", f"byte {place + 4}", expected, repr(name.decode("latin-1")))


def _where(name: bytes, place: int) -> str:
    return f"the chunk {name.decode('latin-1')!r} at byte {place}"


def encode(
    pixels: np.ndarray, exif: bytes, profile: bytes | None = None, *, strategy: int = zlib.Z_DEFAULT_STRATEGY
) -> bytes:
    """A PNG of (H, W, 3) uint8 or uint16 pixels, or of four channels, the last alpha, with EXIF and an ICC profile.

    strategy : of zlib. Z_RLE takes a sixth of the time, and the noise of a photograph leaves others nothing to find;
        the default finds the patterns of drawings
    """
    height, width, channels = pixels.shape
    colour = 2 if channels == 3 else 6
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, colour, 0, 0, 0),
        # A name, a zero, and the number of the compression (11.3.2.3).
        **({b"iCCP": b"ICC profile\0\0" + zlib.compress(profile)} if profile else {}),
        **({b"eXIf": exif.removeprefix(b"Exif\0\0")} if exif else {}),
        b"IDAT": _deflated(pixels, strategy),
        b"IEND": b"",
    }
    return SIGNATURE + b"".join(chunk(name, content) for name, content in chunks.items())


def _deflated(pixels: np.ndarray, strategy: int) -> bytes:
    """The rows as one zlib stream (RFC 1950), deflated some at a time on every core, each for itself."""
    from relume._kernel import in_threads

    height, width, channels = pixels.shape
    step = channels * pixels.itemsize

    def work(begin: int, end: int) -> tuple[bytes, int, int]:
        rows = np.ascontiguousarray(pixels[begin:end], pixels.dtype.newbyteorder(">")).view(np.uint8)
        # Each byte as its difference from the same byte one pixel to the left: filter 1, "Sub".
        filtered = np.concatenate([np.ones((end - begin, 1), np.uint8), rows.reshape(end - begin, -1)], axis=1)
        filtered[:, 1 + step :] -= rows.reshape(end - begin, -1)[:, :-step]
        data = filtered.tobytes()
        engine = zlib.compressobj(zlib.Z_DEFAULT_COMPRESSION, zlib.DEFLATED, -zlib.MAX_WBITS, strategy=strategy)
        # A flush to a whole byte lets the next rows' blocks follow; the last block says that it is the last.
        packed = engine.compress(data) + engine.flush(zlib.Z_FINISH if end == height else zlib.Z_SYNC_FLUSH)
        return packed, zlib.adler32(data), len(data)

    parts = in_threads(work, height, chunk=max(1, _BAND // (1 + width * step)))
    total = 1
    for _, checksum, length in parts:
        total = _joined(total, checksum, length)
    return b"\x78\x9c" + b"".join(packed for packed, _, _ in parts) + struct.pack(">I", total)


def _joined(first: int, second: int, length: int) -> int:
    """Adler-32 of two pieces, one behind the other, from those of each; `length` is of the second (RFC 1950, 2.2)."""
    low = (first & 0xFFFF) + (second & 0xFFFF) - 1
    high = (first >> 16) + (second >> 16) + length * ((first & 0xFFFF) - 1)
    return high % 65521 << 16 | low % 65521


def chunk(name: bytes, content: bytes) -> bytes:
    """One chunk: its length, its name, what it holds, and the checksum."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
