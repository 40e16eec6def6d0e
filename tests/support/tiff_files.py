"""TIFFs of one folder as the package does not write them: big-endian, and with their tags ahead of the pixels."""

from __future__ import annotations

import struct
from pathlib import Path


def big_endian(path: Path) -> bytes:
    """The bytes of a TIFF of one folder with its numbers turned round; not those of its pixels."""
    data = bytearray(path.read_bytes())
    data[:8] = struct.pack(">2sHI", b"MM", 42, *struct.unpack_from("<I", data, 4))
    (at,) = struct.unpack_from(">I", data, 4)
    (count,) = struct.unpack_from("<H", data, at)
    struct.pack_into(">H", data, at, count)
    for entry in range(at + 2, at + 2 + 12 * count, 12):
        tag, kind, number = struct.unpack_from("<HHI", data, entry)
        letter = {3: "H", 4: "I"}[kind]
        length = number * struct.calcsize(letter)
        place = entry + 8 if length <= 4 else struct.unpack_from("<I", data, entry + 8)[0]
        values = struct.unpack_from(f"<{number}{letter}", data, place)
        struct.pack_into(f">{number}{letter}", data, place, *values)
        struct.pack_into(">HHI", data, entry, tag, kind, number)
        if length > 4:
            struct.pack_into(">I", data, entry + 8, place)
    return bytes(data)


def moved_tags(path: Path, cut: int = 0) -> bytes:
    """A TIFF of one folder with that folder before the pixels, of which the last `cut` bytes are lost."""
    data = path.read_bytes()
    (at,) = struct.unpack_from("<I", data, 4)
    shift = len(data) - at
    folder = bytearray(data[at:])
    (count,) = struct.unpack_from("<H", folder)
    for entry in range(2, 2 + 12 * count, 12):
        tag, kind, number = struct.unpack_from("<HHI", folder, entry)
        length = number * {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 12: 8}[kind]
        place = entry + 8
        if length > 4:
            place = struct.unpack_from("<I", folder, entry + 8)[0] - at
            struct.pack_into("<I", folder, entry + 8, place + 8)
        if tag in (273, 324):
            offsets = struct.unpack_from(f"<{number}I", folder, place)
            struct.pack_into(f"<{number}I", folder, place, *(offset + shift for offset in offsets))
    return data[:4] + struct.pack("<I", 8) + bytes(folder) + data[8 : at - cut]
