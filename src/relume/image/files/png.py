"""PNG chunks: what the header tells, a check that none is cut short or altered, and a writer with EXIF.

The check comes before decoding, because libpng tells damage on stderr and Pillow accepts a file whose last chunk is
missing. The writer is ours because Pillow rounds 16-bit colour to 8 bits without a word. Format: W3C PNG 3rd edition.
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

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOURS = {0: ("grey", 1), 2: ("RGB", 3), 3: ("palette", 3), 4: ("grey with alpha", 2), 6: ("RGB with alpha", 4)}
_SRGB_GAMMA = 0.45455  # the value to write for sRGB (11.3.2.2)
_SAME_GAMMA = 0.02  # 1/2.15 to 1/2.25, which nobody can see
_MOST_CHUNKS = 2**18  # of 8192 bytes of pixels, as libpng writes them, 2 GiB
_MOST_AHEAD = 2**12  # chunks ahead of the pixels: a few are usual, and each of its texts is one
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
            if name in (b"IHDR", b"gAMA", b"cICP", b"sRGB", b"iCCP"):
                told.setdefault(name, file.read(min(length, 13)))
            place += 12 + length
            file.seek(place)
    fields = told.get(b"IHDR", b"")
    if len(fields) != 13:
        raise FormatError(path, "PNG", "byte 8", "an IHDR chunk of 13 bytes", f"{len(fields)} bytes")
    width, height, bits, colour, _, _, interlace = struct.unpack(">IIBBBBB", fields)
    if colour not in _COLOURS or bits not in (1, 2, 4, 8, 16):
        raise FormatError(path, "PNG", "its IHDR chunk", "a colour type of PNG", f"type {colour} of {bits} bits")
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


def refuse_damaged(path: str | os.PathLike[str]) -> None:
    """Raise FormatError where a chunk of a PNG is cut short or fails its checksum, or the last one is missing."""
    data = Path(path).read_bytes()
    place = end = len(SIGNATURE)
    for _ in range(_MOST_CHUNKS):
        if place + 12 > len(data):
            break
        (length,) = struct.unpack_from(">I", data, place)
        name, end = data[place + 4 : place + 8], place + 8 + length
        if end + 4 > len(data):
            break
        computed = zlib.crc32(memoryview(data)[place + 4 : end])
        (stored,) = struct.unpack_from(">I", data, end)
        if computed != stored:
            where = f"the chunk {name.decode('latin-1')!r} at byte {place}"
            raise FormatError(path, "PNG", where, f"the checksum {stored:08x}", f"{computed:08x}")
        if name == b"IEND":
            return
        place = end + 4
    found = "the end of the file" if place + 12 > len(data) or end + 4 > len(data) else f"{_MOST_CHUNKS} before it"
    raise FormatError(path, "PNG", f"the chunk at byte {place}", "a whole one, and IEND as the last", found)


def encode(pixels: np.ndarray, exif: bytes) -> bytes:
    """A PNG of (H, W, 3) uint8 or uint16 pixels, with EXIF as Pillow encodes it."""
    height, width, _ = pixels.shape
    rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    step = 3 * pixels.itemsize
    # Each byte as its difference from the same byte one pixel to the left: filter 1, "Sub".
    filtered = np.concatenate([np.ones((height, 1), np.uint8), rows], axis=1)
    filtered[:, 1 + step :] -= rows[:, :-step]
    fields = struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, 2, 0, 0, 0)
    chunks = {
        b"IHDR": fields,
        **({b"eXIf": exif.removeprefix(b"Exif\0\0")} if exif else {}),
        b"IDAT": zlib.compress(filtered.tobytes()),
        b"IEND": b"",
    }
    return SIGNATURE + b"".join(chunk(name, content) for name, content in chunks.items())


def chunk(name: bytes, content: bytes) -> bytes:
    """One chunk: its length, its name, what it holds, and the checksum."""
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
