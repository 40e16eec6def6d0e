"""A TIFF of one picture, written: its tags, then its strips. BigTIFF where 4 GiB do not suffice."""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence

from relume.image.files.atomic import replacing
from relume.image.files.tiff_folders import LETTERS

STRIP_OFFSETS, STRIP_COUNTS, EXIF_FOLDER = 273, 279, 34665
_LARGEST = 2**32 - 2**20  # bytes of pixels in a TIFF that is not Big

Tags = Mapping[int, tuple[int, Sequence[float] | bytes]]
"""Tag → (type, values): numbers, or bytes for ASCII (with its last NUL) and UNDEFINED; rationals as two integers."""


def write_tiff(
    path: str | os.PathLike[str], tags: Tags, strips: Sequence[bytes | memoryview], exif: Tags | None = None
) -> None:
    """Write a little-endian TIFF whole or not at all; the tags that tell where the strips are and how long are added.

    exif : the tags of its EXIF folder, where it has one
    Raises OutputNotWritten.
    """
    total = sum(len(memoryview(strip).cast("B")) for strip in strips)
    big = total > _LARGEST
    offset_type, header = (16, 16) if big else (4, 8)
    lengths = [memoryview(strip).nbytes for strip in strips]
    places, place = [], header
    for length in lengths:
        places.append(place)
        place += length + length % 2
    after = place
    folder: dict[int, tuple[int, Sequence[float] | bytes]] = dict(tags)
    folder[STRIP_OFFSETS], folder[STRIP_COUNTS] = (offset_type, places), (offset_type, lengths)
    exif_bytes = b""
    if exif:
        exif_bytes = _folder(exif, after, big)
        folder[EXIF_FOLDER] = (offset_type, [after])
    main = _folder(folder, after + len(exif_bytes), big)
    first = after + len(exif_bytes)
    start = b"II" + (struct.pack("<HHHQ", 43, 8, 0, first) if big else struct.pack("<HI", 42, first))
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(start)
        for strip, length in zip(strips, lengths, strict=True):
            file.write(strip)
            file.write(bytes(length % 2))
        file.write(exif_bytes + main)


def _folder(tags: Tags, offset: int, big: bool) -> bytes:
    """A folder at byte `offset` with its values behind it, its length even."""
    count_letter, number_letter, width = ("<Q", "Q", 8) if big else ("<H", "I", 4)
    entry = 2 + 2 + 2 * width
    values_at = offset + struct.calcsize(count_letter) + len(tags) * entry + width
    entries, values = [], b""
    for tag in sorted(tags):
        kind, stored = tags[tag]
        letter = LETTERS[kind]
        if isinstance(stored, bytes):
            count, packed = len(stored), stored
        else:
            count, packed = len(stored) // len(letter), struct.pack(f"<{len(stored)}{letter[0]}", *stored)
        if len(packed) > width:
            place = struct.pack("<" + number_letter, values_at + len(values))
            values += packed + bytes(len(packed) % 2)
        else:
            place = packed.ljust(width, b"\0")
        entries.append(struct.pack("<HH" + number_letter, tag, kind, count) + place)
    body = struct.pack(count_letter, len(tags)) + b"".join(entries) + bytes(width) + values
    return body + bytes(len(body) % 2)
