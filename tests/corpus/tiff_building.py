"""TIFF and BigTIFF, entry by entry, right or wrong: TIFF 6.0 section 2."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace

from corpus.files import Bad, integer

WIDTH_TAG, HEIGHT_TAG, BITS, COMPRESSION, PHOTOMETRIC, OFFSETS = 256, 257, 258, 259, 262, 273
SAMPLES, ROWS, COUNTS, PLANAR, PREDICTOR, SAMPLE_FORMAT = 277, 278, 279, 284, 317, 339
_LETTERS = {1: "B", 2: "B", 3: "H", 4: "I", 5: "I", 11: "f", 12: "d", 16: "Q"}
_NAMES = {
    WIDTH_TAG: "width",
    HEIGHT_TAG: "height",
    BITS: "bits",
    COMPRESSION: "compression",
    PHOTOMETRIC: "photometric",
    OFFSETS: "strip offsets",
    SAMPLES: "samples",
    ROWS: "rows in a strip",
    COUNTS: "strip lengths",
    PLANAR: "planes",
    SAMPLE_FORMAT: "sample format",
}


@dataclass(frozen=True)
class Entry:
    """One entry of a folder.

    count : where it is not the number of values
    at : where its values are said to be, in place of where they are
    """

    kind: int
    values: tuple[float, ...]
    count: int | None = None
    at: int | None = None

    def stored(self, order: str) -> bytes:
        letter = _LETTERS.get(self.kind, "I")
        if letter in "fd":
            return struct.pack(f"{order}{len(self.values)}{letter}", *self.values)
        return b"".join(integer(int(value), letter, order) for value in self.values)


def short(*values: int) -> Entry:
    return Entry(3, values)


def long(*values: int) -> Entry:
    return Entry(4, values)


def text(value: str) -> Entry:
    return Entry(2, tuple(value.encode() + b"\0"))


@dataclass(frozen=True)
class Tiff:
    """A TIFF of one folder; its strips stand behind the header, the folder last.

    following : where the next folder is said to be
    claimed : entries the folder is said to have, in place of those it has
    """

    entries: Mapping[int, Entry]
    strips: tuple[bytes, ...]
    order: str = "<"
    big: bool = False
    following: int = 0
    claimed: int | None = None
    place_tag: int = OFFSETS
    length_tag: int = COUNTS

    def but(self, changes: Mapping[int, Entry | None]) -> Tiff:
        """The same with other entries; None takes one away."""
        entries = {**self.entries, **self._places(), **changes}
        return replace(self, entries={tag: entry for tag, entry in entries.items() if entry is not None}, given=True)

    given: bool = False

    def _places(self) -> dict[int, Entry]:
        if self.given:
            return {}
        places, at = [], 16 if self.big else 8
        for strip in self.strips:
            places.append(at)
            at += len(strip)
        return {self.place_tag: long(*places), self.length_tag: long(*map(len, self.strips))}

    def folder_at(self) -> int:
        """Where the folder stands."""
        at = (16 if self.big else 8) + sum(map(len, self.strips))
        return at + at % 2

    def data(self) -> bytes:
        """The bytes of the file."""
        order, at = self.order, self.folder_at()
        entries = {**self.entries, **self._places()}
        width, letters = (8, "HHQ") if self.big else (4, "HHI")
        count_letter, place_letter = ("Q", "Q") if self.big else ("H", "I")
        each = struct.calcsize(order + letters) + width
        behind = at + struct.calcsize(order + count_letter) + each * len(entries) + width
        folder, long_values = b"", b""
        for tag, entry in sorted(entries.items()):
            stored = entry.stored(order)
            number = len(entry.values) if entry.count is None else entry.count
            folder += struct.pack(order + "HH", tag, entry.kind) + integer(number, letters[-1], order)
            if entry.at is not None:
                folder += integer(entry.at, place_letter, order)
            elif len(stored) <= width:
                folder += stored.ljust(width, b"\0")
            else:
                folder += integer(behind + len(long_values), place_letter, order)
                long_values += stored + b"\0" * (len(stored) % 2)
        head = {"<": b"II", ">": b"MM"}[order] + struct.pack(order + "H", 43 if self.big else 42)
        head += struct.pack(order + "HHQ", 8, 0, at) if self.big else struct.pack(order + "I", at)
        pixels = b"".join(self.strips)
        number = len(entries) if self.claimed is None else self.claimed
        return (
            (head + pixels).ljust(at, b"\0")
            + integer(number, count_letter, order)
            + folder
            + integer(self.following, place_letter, order)
            + long_values
        )


def frame_faults(good: Tiff, suffix: str = ".tif") -> list[Bad]:
    """What can be wrong with the frame of any TIFF: header, folder, entries."""
    data = good.data()
    at, size = good.folder_at(), len(data)
    bad: list[tuple[str, bytes, bool]] = []
    for place in (0, 2, 7, size, size + 1, 2**31, 2**32 - 1):
        bad.append((f"its folder at {place} of {size}", data[:4] + integer(place, "I", good.order) + data[8:], True))
    for number in (0, 1, 1000, 65535):
        bad.append((f"a folder of {number} entries", replace(good, claimed=number).data(), number != 1))
    bad += [
        ("a folder that follows itself", replace(good, following=at).data(), False),
        ("a next folder beyond the file", replace(good, following=2**32 - 1).data(), False),
        ("a next folder in the pixels", replace(good, following=8).data(), False),
        ("the other byte order", {b"II": b"MM", b"MM": b"II"}[data[:2]] + data[2:], True),
        ("version 41", data[:2] + integer(41, "H", good.order) + data[4:], True),
        ("a header alone", data[:8], True),
        ("ends in its folder", data[: at + 20], True),
    ]
    for tag, name in _NAMES.items():
        entry = {**good.entries, **good._places()}.get(tag)
        if entry is None:
            continue
        sized = tag in (WIDTH_TAG, HEIGHT_TAG, OFFSETS)
        bad.append((f"no {name}", good.but({tag: None}).data(), sized))
        bad.append((f"{name} of a type that is none", good.but({tag: replace(entry, kind=99)}).data(), sized))
        bad.append((f"{name} as text", good.but({tag: Entry(2, (65, 66, 67, 0))}).data(), sized))
        bad.append((f"{name}, no values", good.but({tag: replace(entry, count=0)}).data(), sized))
        bad.append((f"{name}, 2^32 − 1 values", good.but({tag: replace(entry, count=2**32 - 1)}).data(), False))
        bad.append((f"{name} beyond the file", good.but({tag: replace(entry, count=9, at=size + 9)}).data(), False))
    return [Bad(name, content, suffix, refused) for name, content, refused in bad]


def value_faults(good: Tiff, suffix: str = ".tif") -> list[Bad]:
    """What the entries of any picture in strips can claim that is not so."""
    refused: dict[int, tuple[int, ...]] = {
        WIDTH_TAG: (0, 17, 2**16, 2**16 + 1, 2**31 - 1, 2**31, 2**32 - 1),
        HEIGHT_TAG: (0, 2**16, 2**16 + 1, 2**31 - 1, 2**31, 2**32 - 1),
        COMPRESSION: (0, 2, 99, 65535),
        SAMPLES: (0, 65, 65535),
        OFFSETS: (2**31, 2**32 - 1),
    }
    doubtful: dict[int, tuple[int, ...]] = {
        WIDTH_TAG: (1,),  # readers may pass over what a strip has too many
        HEIGHT_TAG: (1, 9),
        OFFSETS: (0, 1),
        BITS: (0, 1, 7, 12, 64, 65535),
        SAMPLES: (2, 5),
        ROWS: (0, 1, 3, 2**31 - 1, 2**32 - 1),
        COUNTS: (0, 1, 2**31, 2**32 - 1),
        PLANAR: (0, 2, 3, 65535),
        PHOTOMETRIC: (0, 5, 8, 65535),
        SAMPLE_FORMAT: (0, 4, 5, 6, 65535),
        PREDICTOR: (0, 2, 3, 65535),
    }
    files = []
    for table, must in ((refused, True), (doubtful, False)):
        for tag, values in table.items():
            name = _NAMES.get(tag, "predictor")
            for value in values:
                wrong = good.but({tag: long(value)})
                files.append(Bad(f"{name} {value}", wrong.data(), suffix, must))
    return files
