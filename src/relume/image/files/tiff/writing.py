"""A TIFF of one picture, written: its tags, then its strips. BigTIFF where 4 GiB do not suffice.

EXIF in other formats is a TIFF of tags alone.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence

from relume.image.files.atomic import replacing
from relume.image.files.tiff import layout
from relume.image.files.tiff.directories import LETTERS

EXIF_FOLDER = 34665
_LARGEST = 2**32 - 2**20  # bytes of pixels in a TIFF that is not Big

Tags = Mapping[int, "tuple[int, Sequence[float] | bytes] | Tags"]
"""Tag → (type, values): numbers, or bytes for ASCII (with its last NUL) and UNDEFINED; rationals as two integers.

In place of these, the tags of a folder of their own, to which the tag leads, such as that of EXIF or of GPS.
"""


def picture_tags(
    size: tuple[int, int],
    channels: int,
    bits: int,
    *,
    rows: int,
    compression: int,
    photometric: int,
    sample_format: int = layout.UNSIGNED,
    predictor: int = 1,
) -> Tags:
    """The tags of a picture in strips of `rows` rows, the samples of a pixel side by side.

    size : (width, height)
    bits : of each channel; the others as TIFF numbers them
    """
    short, long = 3, 4
    tags: dict[int, tuple[int, Sequence[float]]] = {
        layout.WIDTH: (long, [size[0]]),
        layout.HEIGHT: (long, [size[1]]),
        layout.BITS: (short, [bits] * channels),
        layout.COMPRESSION: (short, [compression]),
        layout.PHOTOMETRIC: (short, [photometric]),
        layout.SAMPLES: (short, [channels]),
        layout.STRIP_ROWS: (long, [rows]),
        layout.PLANAR: (short, [1]),
    }
    if predictor != 1:
        tags[layout.PREDICTOR] = (short, [predictor])
    if sample_format != layout.UNSIGNED:
        tags[layout.SAMPLE_FORMAT] = (short, [sample_format] * channels)
    return tags


def write_tiff(
    path: str | os.PathLike[str], tags: Tags, strips: Sequence[bytes | memoryview], exif: Tags | None = None
) -> None:
    """Write a little-endian TIFF whole or not at all; the tags for the places and lengths of the strips are added.

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
    strip_tags = {layout.STRIP_PLACES: (offset_type, places), layout.STRIP_LENGTHS: (offset_type, lengths)}
    nested, main = _folders({**tags, **strip_tags, **({EXIF_FOLDER: exif} if exif else {})}, place, big)
    first = place + len(nested)
    start = b"II" + (struct.pack("<HHHQ", 43, 8, 0, first) if big else struct.pack("<HI", 42, first))
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(start)
        for strip, length in zip(strips, lengths, strict=True):
            file.write(strip)
            file.write(bytes(length % 2))
        file.write(nested + main)


def exif_block(tags: Tags) -> bytes:
    """The EXIF of a JPEG or PNG, a TIFF without a picture (CIPA DC-008, 4.5.2); b"" for no tags."""
    if not tags:
        return b""
    nested, main = _folders(tags, 8, False)
    return b"II" + struct.pack("<HI", 42, 8 + len(nested)) + nested + main


def _folders(tags: Tags, offset: int, big: bool) -> tuple[bytes, bytes]:
    """Folders from byte `offset` on: all those to which tags lead, and behind them the one of `tags`."""
    nested = b""
    flat: dict[int, tuple[int, Sequence[float] | bytes]] = {}
    for tag, value in tags.items():
        if isinstance(value, tuple):
            flat[tag] = value
            continue
        deeper, folder = _folders(value, offset + len(nested), big)
        flat[tag] = (16 if big else 4, [offset + len(nested) + len(deeper)])
        nested += deeper + folder
    return nested, _folder(flat, offset + len(nested), big)


def _folder(tags: Mapping[int, tuple[int, Sequence[float] | bytes]], offset: int, big: bool) -> bytes:
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
