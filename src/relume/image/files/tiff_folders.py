"""The folders of tags in a TIFF or BigTIFF: the frame that our own TIFF formats read.

A folder (IFD) is a list of tags with typed values; the values stand in the entry itself where they fit, else elsewhere
in the file. Format: TIFF 6.0, section 2, and BigTIFF. Everything a file claims is held against its size before it is
believed.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError
from relume.image.files.reading import Reading

# TIFF 6.0 and BigTIFF: type → struct letter; rationals are two integers, ASCII and UNDEFINED stay bytes.
LETTERS = {
    1: "B",
    2: "s",
    3: "H",
    4: "I",
    5: "II",
    6: "b",
    7: "s",
    8: "h",
    9: "i",
    10: "ii",
    11: "f",
    12: "d",
    13: "I",
    16: "Q",
    17: "q",
    18: "Q",
}


@dataclass(frozen=True)
class Folder:
    """One folder of a TIFF.

    order : "<" or ">", the byte order of the file
    values : tag → its values: numbers, or bytes for ASCII and UNDEFINED; rationals as floats
    """

    order: str
    values: dict[int, tuple[float, ...] | bytes]

    def number(self, tag: int, default: float | None = None) -> float | None:
        """The first value of a tag of numbers; `default` where there is none."""
        values = self.values.get(tag)
        return values[0] if isinstance(values, tuple) and values else default

    def integers(self, tag: int) -> tuple[int, ...]:
        """All values of a tag as integers; none where it is missing."""
        values = self.values.get(tag)
        return tuple(int(value) for value in values) if isinstance(values, tuple) else ()

    def text(self, tag: int) -> str:
        """The text of an ASCII tag, "" where it is missing."""
        value = self.values.get(tag)
        return value.split(b"\0")[0].decode("utf-8", "replace").strip() if isinstance(value, bytes) else ""


def read_folders(path: str | os.PathLike[str], reading: Reading = Reading()) -> list[Folder]:
    """The folders of a TIFF one after the other; raises FormatError where they are damaged or go in a circle."""
    with open(path, "rb") as file:
        return list(folders_in(path, file, reading))


def folders_in(path: str | os.PathLike[str], file: BinaryIO, reading: Reading = Reading()) -> list[Folder]:
    """As `read_folders`, of a file that is open."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    head = file.read(16)
    order = {b"II": "<", b"MM": ">"}.get(head[:2], "")
    if not order or len(head) < 8:
        raise FormatError(path, "TIFF", "its first bytes", "II or MM and 42", head[:4].hex(" "))
    big = struct.unpack_from(order + "H", head, 2)[0] == 43
    if big and len(head) < 16:
        raise FormatError(path, "TIFF", "its header", "16 bytes", str(len(head)))
    offset = struct.unpack_from(order + "Q", head, 8)[0] if big else struct.unpack_from(order + "I", head, 4)[0]
    folders, seen = [], set()
    while offset:
        if offset in seen or len(folders) == reading.parts:
            found = "one that was read already" if offset in seen else f"more than {reading.parts}"
            raise FormatError(path, "TIFF", f"the folder at byte {offset}", "another folder or the last", found)
        seen.add(offset)
        folder, offset = _folder(path, file, order, big, offset, size, reading)
        folders.append(folder)
    if not folders:
        raise FormatError(path, "TIFF", "byte 4", "the place of a folder", "0")
    return folders


def _folder(
    path: str | os.PathLike[str], file: BinaryIO, order: str, big: bool, offset: int, size: int, reading: Reading
) -> tuple[Folder, int]:
    width, count_letter, entry_letters, next_letter = (8, "Q", "HHQ", "Q") if big else (4, "H", "HHI", "I")
    where = f"the folder at byte {offset}"
    file.seek(min(offset, size))
    counted = file.read(struct.calcsize(order + count_letter))
    if len(counted) < struct.calcsize(order + count_letter):
        raise FormatError(path, "TIFF", where, "a folder within the file", f"{size} bytes of file")
    (count,) = struct.unpack(order + count_letter, counted)
    each = struct.calcsize(order + entry_letters) + width
    if count > 4096 or offset + count * each > size:
        raise FormatError(path, "TIFF", where, f"its {count} entries within the file", f"{size} bytes of file")
    entries = file.read(count * each)
    following = file.read(width)
    values: dict[int, tuple[float, ...] | bytes] = {}
    for start in range(0, count * each, each):
        tag, kind, number = struct.unpack_from(order + entry_letters, entries, start)
        letter = LETTERS.get(kind)
        if letter is None:  # TIFF 6.0, section 2: readers skip fields of a type they do not know
            continue
        length = number * struct.calcsize("=" + letter)
        place = entries[start + each - width : start + each]
        if length > width:
            (at,) = struct.unpack(order + next_letter, place)
            if length > reading.metadata or at + length > size:
                found = f"{length} bytes at {at} of {size}"
                raise FormatError(path, "TIFF", f"tag {tag} in {where}", "values within the file", found)
            file.seek(at)
            place = file.read(length)
        values[tag] = _values(order, letter, number, place[:length])
    # A last folder cut short just before the place of the next has none.
    return Folder(order, values), struct.unpack(order + next_letter, following)[0] if len(following) == width else 0


def _values(order: str, letter: str, number: int, stored: bytes) -> tuple[float, ...] | bytes:
    if letter == "s":
        return stored
    numbers = struct.unpack(f"{order}{number * len(letter)}{letter[0]}", stored)
    if len(letter) == 1:
        return numbers
    return tuple(a / b if b else 0.0 for a, b in zip(numbers[::2], numbers[1::2], strict=True))
