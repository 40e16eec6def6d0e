"""The pictures of one session: opened when they are asked for, opened again where their file changed."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import relume as rl
from relume.studio.pictures import Layer, OpenPicture, open_picture

KEPT_BYTES = 4 * 1024**3
"""Pixels kept in memory; the pictures not looked at for longest go first."""


class Library:
    """Files that a page may show, by number; safe to use from several threads."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.files = tuple(files)
        self._open: OrderedDict[int, tuple[tuple[int, int], OpenPicture]] = OrderedDict()
        self._locks = [threading.Lock() for _ in self.files]
        self._changing = threading.Lock()

    def begin(self) -> None:
        """Open the first picture behind the page, which asks for it as soon as it is there itself."""

        def first() -> None:
            # What is wrong with it is said where the page asks.
            with suppress(rl.RelumeError, LookupError, ValueError, OSError, MemoryError):
                self.picture(0)

        threading.Thread(target=first, daemon=True, name="first picture").start()

    def add(self, file: Path) -> int:
        """The number of a file, which is taken in unless it is there already."""
        with self._changing:
            if file not in self.files:
                self._locks.append(threading.Lock())
                self.files = (*self.files, file)
            return self.files.index(file)

    def picture(self, number: int) -> OpenPicture:
        """The picture of a file as it is now; raises LookupError for a number there is none of, UnreadableFile."""
        if not 0 <= number < len(self.files):
            raise LookupError
        stamp = self.stamp(number)
        with self._locks[number]:
            with self._changing:
                kept = self._open.get(number)
                if kept is not None and kept[0] == stamp:
                    self._open.move_to_end(number)
                    return kept[1]
            picture = open_picture(self.files[number])
            picture.facts()  # measured before others have it: who waits for it does not measure too
            with self._changing:
                self._open[number] = (stamp, picture)
                self._open.move_to_end(number)
                while len(self._open) > 1 and sum(_bytes(each) for _, each in self._open.values()) > KEPT_BYTES:
                    self._open.popitem(last=False)
            return picture

    def layer(self, number: int, layer: int) -> tuple[OpenPicture, Layer]:
        """A layer with its picture; raises LookupError where there is none, UnreadableFile."""
        picture = self.picture(number)
        if not 0 <= layer < len(picture.layers):
            raise LookupError
        return picture, picture.layers[layer]

    def stamp(self, number: int) -> tuple[int, int]:
        """When a file was written, in nanoseconds, and its size; (0, 0) where it is gone."""
        try:
            facts = self.files[number].stat()
        except OSError:
            return 0, 0
        return facts.st_mtime_ns, facts.st_size

    def stamps(self) -> list[tuple[int, int]]:
        """Those of all files."""
        return [self.stamp(number) for number in range(len(self.files))]


def readable_files(paths: Sequence[Path]) -> list[Path]:
    """The files among paths, and the pictures in folders by name; raises ValueError, UnreadableFile."""
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(each for each in path.iterdir() if each.is_file() and not each.name.startswith("."))
            pictures = [each for each in inside if _opens(each)]
            if not pictures:
                raise ValueError(
                    f"{path}: this folder holds no picture that relume reads; name a file or another folder"
                )
            found += pictures
        elif path.is_file():
            found.append(path)
        else:
            raise rl.errors.UnreadableFile(f"{path}: no such file; check its name")
    if not found:
        raise ValueError("no file is given; name pictures or a folder of them")
    return found


def _opens(path: Path) -> bool:
    try:
        return rl.files.kind_of(path) not in ("RAW", "KTX2")
    except rl.RelumeError:
        return False


def _bytes(picture: OpenPicture) -> int:
    # A pyramid is a third more than its picture.
    return sum(layer.pixels.nbytes * 4 // 3 for layer in picture.layers)
