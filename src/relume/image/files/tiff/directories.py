"""The folders of tags in a TIFF or BigTIFF: the frame that our own TIFF formats read.

A folder (IFD) is a list of tags with typed values; the values stand in the entry itself where they fit, else elsewhere
in the file. Format: TIFF 6.0, section 2, and BigTIFF. Everything a file claims is held against its size before it is
believed.
"""

from __future__ import annotations

import math
import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

from relume.errors import FormatError
from relume.image.files.read_options import ReadOptions

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
_ENTRIES = 4096  # in one folder; TIFF 6.0 with all its extensions knows a few hundred tags
_NUMBERS = 2**20  # in all tags of a file: half a million tiles, and as Python's own numbers 40 MB
_PRIVATE = 32768  # TIFF 6.0, section 2: tags from here on are private


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
        """All values of a tag as integers; none where it is missing or one is not finite."""
        values = self.values.get(tag)
        if not isinstance(values, tuple) or not all(map(math.isfinite, values)):
            return ()
        return tuple(map(int, values))

    def text(self, tag: int) -> str:
        """The text of an ASCII tag, "" where it is missing."""
        value = self.values.get(tag)
        return value.split(b"\0")[0].decode("utf-8", "replace").strip() if isinstance(value, bytes) else ""


def read_folders(path: str | os.PathLike[str], options: ReadOptions = ReadOptions()) -> list[Folder]:
    """The folders of a TIFF one after the other; raises FormatError where they are damaged or go in a circle.

    A private tag longer than `options.metadata` (the layers of an editor) is left out; another is an error.
    """
    with open(path, "rb") as file:
        return folders_in(path, file, options)


def folders_in(path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions = ReadOptions()) -> list[Folder]:
    """As `read_folders`, of a file that is open."""
    frame = _Frame.of(path, file, options)
    folders: list[Folder] = []
    seen: set[int] = set()
    offset = frame.first
    while offset:
        if offset in seen or len(folders) == options.parts:
            found = "one that was read already" if offset in seen else f"more than {options.parts}"
            raise FormatError(path, "TIFF", f"the folder at byte {offset}", "another folder or the last", found)
        seen.add(offset)
        folder, offset = frame.folder(offset)
        folders.append(folder)
    if not folders:
        raise FormatError(path, "TIFF", "byte 4", "the place of a folder", "0")
    return folders


def folder_at(
    path: str | os.PathLike[str], file: BinaryIO, offset: int, options: ReadOptions = ReadOptions()
) -> Folder:
    """The folder at byte `offset` of a TIFF that is open, such as the one of EXIF; raises FormatError."""
    return _Frame.of(path, file, options).folder(offset)[0]


class _Frame:
    """A TIFF that is open: its byte order and width of offsets, and what may still be read of its metadata."""

    def __init__(
        self, path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions, order: str, big: bool
    ) -> None:
        self.path, self.file, self.order, self.big = path, file, order, big
        self.size = file.seek(0, os.SEEK_END)
        self.bytes, self.numbers = options.metadata, _NUMBERS
        self.first = 0

    @staticmethod
    def of(path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions) -> _Frame:
        file.seek(0)
        head = file.read(16)
        order = {b"II": "<", b"MM": ">"}.get(head[:2], "")
        version = struct.unpack_from(order + "H", head, 2)[0] if order and len(head) >= 8 else 0
        if version not in (42, 43):
            found = head[:4].hex(" ") or "nothing"
            raise FormatError(path, "TIFF", "its first bytes", "II or MM, and 42 or 43", found)
        frame = _Frame(path, file, options, order, version == 43)
        if not frame.big:
            (frame.first,) = struct.unpack_from(order + "I", head, 4)
        elif len(head) == 16 and struct.unpack_from(order + "HH", head, 4) == (8, 0):
            (frame.first,) = struct.unpack_from(order + "Q", head, 8)
        else:
            raise FormatError(path, "TIFF", "byte 4", "8 and 0 and the place of a folder", head[4:].hex(" "))
        return frame

    def folder(self, offset: int) -> tuple[Folder, int]:
        """The folder at byte `offset`, and where the next one is, 0 after the last."""
        width, count_letter, number_letter = (8, "Q", "Q") if self.big else (4, "H", "I")
        where = f"the folder at byte {offset}"
        entry = struct.Struct(f"{self.order}HH{number_letter}{width}s")
        counted = self._read(offset, struct.calcsize(self.order + count_letter))
        if counted is None:
            raise FormatError(self.path, "TIFF", where, "a folder within the file", f"{self.size} bytes of file")
        (count,) = struct.unpack(self.order + count_letter, counted)
        entries = self._read(offset + len(counted), count * entry.size) if count <= _ENTRIES else None
        if entries is None:
            raise FormatError(self.path, "TIFF", where, f"its {count} entries within the file", f"{self.size} bytes")
        following = self.file.read(width)  # at once: the values lie elsewhere
        values: dict[int, tuple[float, ...] | bytes] = {}
        for tag, kind, number, place in entry.iter_unpack(entries):
            letter = LETTERS.get(kind)
            if letter is None:  # TIFF 6.0, section 2: readers skip fields of a type they do not know
                continue
            stored = self._stored(tag, where, letter, number, place)
            if stored is not None:
                values[tag] = _values(self.order, letter, number, stored)
        # A last folder cut short just before the place of the next has none.
        last = len(following) < width
        return Folder(self.order, values), 0 if last else struct.unpack(self.order + number_letter, following)[0]

    def _stored(self, tag: int, where: str, letter: str, number: int, place: bytes) -> bytes | None:
        """The bytes of a tag's values; None for a private tag that is longer than what may still be read."""
        length = number * struct.calcsize("=" + letter)
        if length <= len(place):
            return place[:length]
        (at,) = struct.unpack(self.order + ("Q" if self.big else "I"), place)
        too_long = length > self.bytes or (letter != "s" and number > self.numbers)
        if at + length > self.size or (too_long and tag < _PRIVATE):
            found = f"{length} bytes at {at} of {self.size}"
            raise FormatError(self.path, "TIFF", f"tag {tag} in {where}", "values within the file", found)
        if too_long:
            return None
        self.bytes -= length
        self.numbers -= 0 if letter == "s" else number
        return self._read(at, length)

    def _read(self, offset: int, length: int) -> bytes | None:
        """That many bytes from there, None where the file has fewer."""
        if offset + length > self.size:
            return None
        self.file.seek(offset)
        read = self.file.read(length)
        return read if len(read) == length else None


def _values(order: str, letter: str, number: int, stored: bytes) -> tuple[float, ...] | bytes:
    if letter == "s":
        return stored
    numbers = struct.unpack(f"{order}{number * len(letter)}{letter[0]}", stored)
    if len(letter) == 1:
        return numbers
    return tuple(a / b if b else 0.0 for a, b in zip(numbers[::2], numbers[1::2], strict=True))
