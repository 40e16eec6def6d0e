"""Where the pixels of an EXR file lie, and what of them is missing.

Behind the headers each part has a table of the offsets of its chunks: some rows or one tile, each with a head that
holds its place and its size. A file that was cut short, or that its writer left before its end (its table is then 0),
lacks some; the others are found by the table or by going from chunk to chunk.
"""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from tempfile import TemporaryDirectory
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError
from relume.image.files.exr.header import Header, Headers


@dataclass(frozen=True, eq=False)
class Chunks:
    """The chunks of one part: a row of `heads` and an entry of `offsets` each, 0 for those that are missing.

    heads : (N, 1) y of the first row, or (N, 4) column and row of the tile, and its level in x and y
    boxes : (N, 4) left, top, right, bottom in pixels of the level, the last included, from the data window's corner
    """

    heads: np.ndarray
    boxes: np.ndarray
    offsets: np.ndarray

    @property
    def missing(self) -> np.ndarray:
        """Indices of what is missing."""
        return np.flatnonzero(self.offsets == 0)


def find(path: str | os.PathLike[str], headers: Headers) -> tuple[list[Chunks], int]:
    """The chunks of every part, and the byte after the last that is whole; FormatError where the tables are cut short.

    Memory: 48 bytes a chunk, of which the file must hold the tables.
    """
    size, place = os.path.getsize(path), headers.end
    counts = [_count(header) for header in headers.parts]
    if place + 8 * sum(counts) > size:
        raise FormatError(
            path, "EXR", f"byte {place}, table of offsets", f"{8 * sum(counts)} bytes", f"{size - place} to the end"
        )
    parts, end = list[Chunks](), place + 8 * sum(counts)
    with open(path, "rb", buffering=0) as file:
        for index, (count, header) in enumerate(zip(counts, headers.parts, strict=True)):
            file.seek(place)
            table = np.frombuffer(file.read(8 * count), "<u8")
            place += 8 * count
            heads, boxes = _layout(header)
            offsets = np.zeros(count, np.int64)
            for i in np.flatnonzero((table >= end) & (table < size)).tolist():
                found = _whole_chunk(file, headers, int(table[i]), size)
                if found is not None and found[0] == index and found[1] == tuple(heads[i].tolist()):
                    offsets[i] = table[i]
            parts.append(Chunks(heads, boxes, offsets))
        last = _find_by_walking(file, headers, parts, end, size) if any(len(p.missing) for p in parts) else size
    return parts, last


def first_missing(headers: Headers, parts: list[Chunks]) -> tuple[str, int, int] | None:
    """Where the first missing chunk belongs, in words, how many are missing, and of how many."""
    for index, chunks in enumerate(parts):
        if len(chunks.missing):
            head = chunks.heads[chunks.missing[0]].tolist()
            place = f"row {head[0]}" if len(head) == 1 else f"tile {head[0]}, {head[1]}"
            part = f"part {index}, " if headers.many else ""
            return part + place, sum(len(p.missing) for p in parts), sum(len(p.offsets) for p in parts)
    return None


def missing_pixels(header: Header, chunks: Chunks) -> np.ndarray | None:
    """(H, W) bool over the data window, True where level 0 has no chunk; None where it is whole."""
    if not any(chunks.heads.shape[1] == 1 or not chunks.heads[i, 2:].any() for i in chunks.missing.tolist()):
        return None
    width, height = header.size
    missing = np.zeros((height, width), bool)
    for i in chunks.missing.tolist():
        if chunks.heads.shape[1] == 1 or not chunks.heads[i, 2:].any():
            left, top, right, bottom = chunks.boxes[i].tolist()
            missing[top : bottom + 1, left : right + 1] = True
    return missing


@contextmanager
def mended(path: str | os.PathLike[str], headers: Headers, parts: list[Chunks], end: int) -> Iterator[str]:
    """A temporary copy that the library can read: what is missing is 0, texts that are not UTF-8 have question marks.

    A chunk as large as its pixels is not compressed, in every compression; holes take no room on the disk.
    """
    with TemporaryDirectory() as folder:
        copy = os.path.join(folder, "mended.exr")
        shutil.copyfile(path, copy)
        with open(copy, "r+b") as file:
            for place, length in (entry for header in headers.parts for entry in header.foreign):
                file.seek(place)
                text = file.read(length)
                file.seek(place)
                file.write(bytes(byte if byte < 128 else 0x3F for byte in text))
            if any(len(chunks.missing) for chunks in parts):
                _fill(file, headers, parts, end)
        yield copy


def _fill(file: BinaryIO, headers: Headers, parts: list[Chunks], end: int) -> None:
    file.truncate(end)
    place = headers.end
    for index, (header, chunks) in enumerate(zip(headers.parts, parts, strict=True)):
        offsets = chunks.offsets.copy()
        for i in chunks.missing.tolist():
            size = _pixel_bytes(header, chunks.boxes[i].tolist())
            head = [index] * headers.many + chunks.heads[i].tolist() + [size]
            file.seek(end)
            file.write(struct.pack(f"<{len(head)}i", *head))
            offsets[i] = end
            end += 4 * len(head) + size
        file.seek(place)
        file.write(offsets.astype("<i8").tobytes())
        place += 8 * len(offsets)
    file.truncate(end)


def _find_by_walking(file: BinaryIO, headers: Headers, parts: list[Chunks], place: int, size: int) -> int:
    """Note the chunks met one after the other from `place`; the byte after the last that is known to be whole."""
    index_of = [{tuple(head): i for i, head in enumerate(chunks.heads.tolist())} for chunks in parts]
    end = place
    for _ in range(sum(len(chunks.offsets) for chunks in parts)):
        found = _whole_chunk(file, headers, place, size)
        if found is None or found[1] not in index_of[found[0]]:
            break
        part, head, following = found
        parts[part].offsets[index_of[part][head]] = place
        end = place = following
    for chunks in parts:
        known = chunks.offsets[chunks.offsets > end]
        for offset in known[np.argsort(known)[-1:]].tolist():
            found = _whole_chunk(file, headers, offset, size)
            end = max(end, found[2] if found else end)
    return end


def _whole_chunk(file: BinaryIO, headers: Headers, place: int, size: int) -> tuple[int, tuple[int, ...], int] | None:
    """Part, head and end of the chunk at `place`, or None where there is no whole one."""
    file.seek(place)
    part, at = 0, 0
    data = file.read(24)
    if headers.many:
        if len(data) < 4:
            return None
        part, at = struct.unpack_from("<i", data)[0], 4
        if not 0 <= part < len(headers.parts):
            return None
    length = 1 if headers.parts[part].tiling is None else 4
    if len(data) < at + 4 * length + 4:
        return None
    *head, stored = struct.unpack_from(f"<{length + 1}i", data, at)
    end = place + at + 4 * length + 4 + stored
    return (part, tuple(head), end) if stored >= 0 and end <= size else None


def _count(header: Header) -> int:
    """How many chunks a part has, without making a list of them."""
    if header.tiling is None:
        return -(-header.size[1] // header.compression.rows)
    wide, high = header.tiling.width, header.tiling.height
    return sum(-(-width // wide) * -(-height // high) for _, _, width, height in _levels(header))


def _levels(header: Header) -> Iterator[tuple[int, int, int, int]]:
    """Level in x, level in y, width and height of each, as the table has them ("OpenEXR File Layout", "Tiles")."""
    tiling = header.tiling
    assert tiling is not None
    width, height = header.size

    def halved(length: int, level: int) -> int:
        return max(1, -(-length // 2**level) if tiling.up else length // 2**level)

    def number(length: int) -> int:
        return ((length - 1).bit_length() if tiling.up else length.bit_length() - 1) + 1

    if tiling.mode == 0:
        levels = [(0, 0)]
    elif tiling.mode == 1:
        levels = [(level, level) for level in range(number(max(width, height)))]
    else:
        levels = [(x, y) for y, x in product(range(number(height)), range(number(width)))]
    for x, y in levels:
        yield x, y, halved(width, x), halved(height, y)


def _layout(header: Header) -> tuple[np.ndarray, np.ndarray]:
    """Heads and boxes of a part's chunks, in the order of its table."""
    if header.tiling is None:
        width, height = header.size
        tops = np.arange(0, height, header.compression.rows)
        bottoms = np.minimum(tops + header.compression.rows, height) - 1
        boxes = np.stack([np.zeros_like(tops), tops, np.full_like(tops, width - 1), bottoms], axis=1)
        return tops[:, None] + header.data[1], boxes
    heads, boxes = [], []
    wide, high = header.tiling.width, header.tiling.height
    for x_level, y_level, width, height in _levels(header):
        rows, columns = np.mgrid[0 : -(-height // high), 0 : -(-width // wide)].reshape(2, -1)
        heads.append(np.stack([columns, rows, np.full_like(rows, x_level), np.full_like(rows, y_level)], axis=1))
        left, top = columns * wide, rows * high
        boxes.append(np.stack([left, top, np.minimum(left + wide, width) - 1, np.minimum(top + high, height) - 1], 1))
    return np.concatenate(heads), np.concatenate(boxes)


def _pixel_bytes(header: Header, box: list[int]) -> int:
    """Bytes of the pixels in a box, uncompressed: subsampled channels have samples where their step divides x and y."""
    left, top, right, bottom = (edge + header.data[i % 2] for i, edge in enumerate(box))
    return sum(
        channel.bytes * _samples(left, right, channel.x_sampling) * _samples(top, bottom, channel.y_sampling)
        for channel in header.channels
    )


def _samples(first: int, last: int, step: int) -> int:
    return last // step - (first - 1) // step
