"""Named arrays in a file of which memory holds what is being read: a large plate's planes outgrow it together.

A file is an uncompressed .npz whose arrays begin at multiples of 64 bytes. Large ones are mapped: their pages come from
the file when they are read, and go when a step is done (`Mapped.release`). What writes to a mapped array changes
memory, never the file.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import struct
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any
from weakref import ReferenceType, WeakSet, ref

import numpy as np

from relume.errors import OutputNotWritten

LARGE = 2**24
"""Bytes of an array from which on it is mapped: a plane in colour of 1.4 megapixels."""
MAPS = os.name != "nt" and hasattr(mmap, "MADV_DONTNEED")
"""Whether files are mapped; Windows replaces no file that is, so that a later run could not be kept."""
_PIECE = 2**20
_NAMELESS: WeakSet[mmap.mmap] = WeakSet()
"""Maps of files that have no name and one user: what is written there is in the file, whoever wrote it."""
_HEADER, _NAMES = 30, struct.Struct("<26xHH")
"""Bytes of a member's own header, and where it says how long its name and its extra field are (APPNOTE 4.3.7)."""
_PADDING, _ZIP64, _ALIGNED = 0xD935, 20, 64


@dataclass(frozen=True, eq=False)
class Mapped:
    """The arrays that a job has mapped, as long as anything holds them."""

    maps: list[ReferenceType[mmap.mmap]] = field(default_factory=list)

    def keep(self, array: np.memmap) -> np.ndarray:
        """The array itself, to be released with the others."""
        self.maps[:] = [each for each in self.maps if each() is not None]
        self.maps.append(ref(array._mmap))  # pyright: ignore[reportAttributeAccessIssue]
        return np.asarray(array)

    def release(self) -> None:
        """Give back the memory of all of them: their bytes are in files. Nobody may have written to those read."""
        for each in self.maps:
            if (mapped := each()) is not None:
                mapped.madvise(mmap.MADV_DONTNEED)

    def read(self, path: Path, key: str | None = None) -> dict[str, np.ndarray]:
        """The arrays of a file that `write` wrote, the large ones mapped.

        key : what the array "key" must hold; every byte is then held against its checksum
        Raises KeyError for another key; OSError, ValueError, EOFError, BadZipFile for a damaged file.
        """
        arrays: dict[str, np.ndarray] = {}
        with open(path, "rb") as stream, zipfile.ZipFile(stream) as archive:
            for info in archive.infolist():
                name = info.filename.removesuffix(".npy")
                mapped = info.file_size >= LARGE and MAPS
                with archive.open(info) as member:
                    if not mapped:
                        arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
                if name == "key" and key is not None and str(arrays[name]) != key:
                    raise KeyError(key)
                if mapped:
                    if key is not None:
                        _check(archive, info)
                    arrays[name] = self.keep(_mapped(stream, archive, info))
        return arrays

    def write(self, file: IO[bytes], arrays: Mapping[str, np.ndarray]) -> None:
        """Write arrays, for `read`."""
        with zipfile.ZipFile(file, "w") as archive:
            for name, array in arrays.items():
                info = zipfile.ZipInfo(f"{name}.npy")
                # The library adds an extra field of its own, for sizes; ours fills up to where an array may begin.
                begin = file.seek(0, os.SEEK_CUR) + _HEADER + len(info.filename.encode()) + _ZIP64 + 4
                info.extra = struct.pack("<HH", _PADDING, -begin % _ALIGNED) + bytes(-begin % _ALIGNED)
                with archive.open(info, "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
                self.release()

    def zeros(self, folder: Path, shapes: Sequence[tuple[int, ...]], kind: type = np.float32) -> list[np.ndarray]:
        """Planes of zeros in a file of that folder that has no name and goes with them.

        Raises OutputNotWritten where the disk is full.
        """
        if not MAPS:
            return [np.zeros(shape, kind) for shape in shapes]
        sizes = [np.dtype(kind).itemsize * int(np.prod(shape, dtype=np.int64)) for shape in shapes]
        try:
            file: Any = TemporaryFile(dir=folder)
            _allocate(file, sum(sizes))
        except OSError as error:
            raise OutputNotWritten(f"{folder}: cannot be written: {error.strerror}; choose another place") from None
        with file:
            begins = np.concatenate([[0], np.cumsum(sizes)])
            maps = [
                np.memmap(file, kind, "r+", int(begin), shape) for begin, shape in zip(begins[:-1], shapes, strict=True)
            ]
        _NAMELESS.update(each._mmap for each in maps)  # pyright: ignore[reportAttributeAccessIssue]
        return [self.keep(each) for each in maps]

    def put_away(self, folder: Path, array: np.ndarray) -> np.ndarray:
        """The same array in a file of that folder as `zeros` makes them, if it is large; memory of all is given back.

        Raises OutputNotWritten where the disk is full.
        """
        if array.nbytes < LARGE or not MAPS:
            return array
        (kept,) = self.zeros(folder, [array.shape], array.dtype.type)
        rows = max(1, LARGE * len(array) // array.nbytes)
        for top in range(0, len(array), rows):
            kept[top : top + rows] = array[top : top + rows]
            self.release()
        return kept


def give_back_read(*arrays: np.ndarray) -> None:
    """Give back the memory of those that lie in nameless files, as `zeros` and `put_away` make them.

    Nothing that anyone wrote to these is lost, so whoever reads a large plate's planes may do it at any time. Arrays in
    memory stay as they are, and so do those read from a named file, where what was written since would be lost.
    """
    for array in arrays:
        base: Any = array
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, mmap.mmap) and base in _NAMELESS:
            base.madvise(mmap.MADV_DONTNEED)


def give_back_freed() -> None:
    """Give the system back what was freed: glibc keeps it, for each thread apart, and may never need it again."""
    if (trim := _trimming()) is not None:
        trim(0)


@lru_cache
def _trimming() -> Any:
    """malloc_trim(3), or None where C has none."""
    try:
        return ctypes.CDLL(None).malloc_trim
    except (OSError, TypeError, AttributeError):  # Windows; macOS and musl
        return None


def _allocate(file: IO[bytes], size: int) -> None:
    """Room on the disk for a file of zeros: were it missing later, writing to the map would end the process."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, max(size, 1))
    else:
        for begin in range(0, size, _PIECE):
            file.write(bytes(min(_PIECE, size - begin)))
        file.flush()


def _check(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> None:
    """Read a member to its end, where the library holds it against its checksum."""
    with archive.open(info) as member:
        while member.read(_PIECE):
            pass


def _mapped(stream: IO[bytes], archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.memmap:
    with archive.open(info) as member:
        if np.lib.format.read_magic(member) != (1, 0):
            raise ValueError(f"{info.filename}: of another version of the format")
        shape, in_columns, kind = np.lib.format.read_array_header_1_0(member)
        head = member.seek(0, os.SEEK_CUR)
    stream.seek(info.header_offset)
    begin = info.header_offset + _HEADER + sum(_NAMES.unpack(stream.read(_HEADER)))
    return np.memmap(stream, kind, "c", begin + head, shape, "F" if in_columns else "C")
