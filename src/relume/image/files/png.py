"""PNG chunks: a check that none is cut short or altered, and a writer for 8 and 16 bits with EXIF.

The check comes before decoding, because libpng tells damage on stderr and Pillow accepts a file whose last chunk is
missing. The writer is ours because Pillow rounds 16-bit colour to 8 bits without a word. Format: W3C PNG 3rd edition.
"""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile

_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def refuse_damaged(path: str | os.PathLike[str]) -> None:
    """Raise UnreadableFile where a chunk of a PNG is cut short or fails its checksum, or the last one is missing."""
    data = Path(path).read_bytes()
    place = len(_SIGNATURE)
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        name, end = data[place + 4 : place + 8], place + 8 + length
        if end + 4 > len(data):
            break
        if zlib.crc32(memoryview(data)[place + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            shown = name.decode("latin-1")
            raise UnreadableFile(f"{path}: damaged in its PNG chunk {shown!r} at byte {place}; copy it again")
        if name == b"IEND":
            return
        place = end + 4
    raise UnreadableFile(f"{path}: ends early, in the PNG chunk at byte {place}; copy it again from where it came")


def encode(pixels: np.ndarray, exif: bytes) -> bytes:
    """A PNG of (H, W, 3) uint8 or uint16 pixels, with EXIF as Pillow encodes it."""
    height, width, _ = pixels.shape
    rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    step = 3 * pixels.itemsize
    # Each byte as its difference from the same byte one pixel to the left: filter 1, "Sub".
    filtered = np.concatenate([np.ones((height, 1), np.uint8), rows], axis=1)
    filtered[:, 1 + step :] -= rows[:, :-step]
    header = struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, 2, 0, 0, 0)
    chunks = {
        b"IHDR": header,
        **({b"eXIf": exif.removeprefix(b"Exif\0\0")} if exif else {}),
        b"IDAT": zlib.compress(filtered.tobytes()),
        b"IEND": b"",
    }
    return _SIGNATURE + b"".join(_chunk(name, content) for name, content in chunks.items())


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
