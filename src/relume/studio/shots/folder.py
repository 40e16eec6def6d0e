"""The folder that a studio works in: nothing above it is read or written, whatever a page asks for."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import relume as rl

MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
PICTURES = (
    ".jpg",
    ".jpeg",
    ".png",
    ".tif",
    ".tiff",
    ".heic",
    ".exr",
    ".hdr",
    ".dng",
    ".cr2",
    ".cr3",
    ".nef",
    ".arw",
    ".raf",
)
PNG = b"\x89PNG\r\n\x1a\n"
DEVICES = re.compile("con|prn|aux|nul|(com|lpt)[0-9]", re.IGNORECASE)
LARGEST_UPLOAD = 1024**3
"""Bytes of a file that a page may hand over; a scan of ten million triangles has half of it."""
ROOM_LEFT = 256 * 1024**2
"""Bytes that an upload leaves free on the disk, for the shot file and the kept stages."""
DEEPEST, MOST_FILES = 4, 20_000
MATTES, PAINT = "mattes", "paint"
"""The folders of what is painted in the page, and of what is cut out for paint programs; they hold no photographs."""


@dataclass(frozen=True)
class Folder:
    """The folder of a shot; `root` is without symbolic links."""

    root: Path

    def path(self, name: str) -> Path:
        """A file or folder below the root by its name from there; raises LookupError for anything else.

        A symbolic link is followed where it stays below the root.
        """
        if not name or "\0" in name or "\\" in name or Path(name).anchor or ".." in Path(name).parts:
            raise LookupError
        path = (self.root / name).resolve()
        if not path.is_relative_to(self.root) or not path.exists():
            raise LookupError
        return path

    def name(self, path: Path) -> str:
        """A path below the root as the shot file names it."""
        return path.relative_to(self.root).as_posix()

    def named(self, patterns: Iterable[str]) -> list[Path]:
        """The files below the root that names and patterns of the shot file stand for."""
        found: list[Path] = []
        for pattern in patterns:
            if Path(pattern).anchor or ".." in Path(pattern).parts:
                continue
            one = self.root / pattern
            inside = [one] if one.is_file() else sorted(self.root.glob(pattern))
            found += [each for each in inside if each.is_file() and each.resolve().is_relative_to(self.root)]
        return found

    def pictures(self, beside: Path) -> Iterator[Path]:
        """Every picture below the root but for those in `beside`, which hold results."""
        waiting, seen = [(self.root, 0)], 0
        while waiting:
            folder, depth = waiting.pop(0)
            for path in sorted(folder.iterdir()):
                seen += 1
                if seen > MOST_FILES:
                    return
                if path.name.startswith(".") or path.is_symlink():
                    continue
                if path.is_dir() and path not in (beside, self.root / MATTES, self.root / PAINT) and depth < DEEPEST:
                    waiting.append((path, depth + 1))
                elif path.suffix.lower() in PICTURES and path.is_file():
                    yield path

    @contextmanager
    def upload(self, name: str) -> Iterator[tuple[IO[bytes], Path]]:
        """A file to write what a page hands over to, and where it will stand: under a name that nothing has yet.

        name : as the page calls it; its ending is kept, and the letters, digits, points and dashes of the rest
        Raises ValueError for a kind of file that a shot has no use for, OutputNotWritten. A block that fails leaves
        nothing behind.
        """
        stem, ending = os.path.splitext(re.split(r"[/\\]", name)[-1])
        ending = ending.lower()
        if ending not in MESHES + PICTURES:
            raise ValueError(f'a file that ends in "{ending[:12]}" is of no use here; drop meshes or photographs')
        folder = self.root / ("objects" if ending in MESHES else "photographs")
        stem = plain_stem(stem) or "file"
        if folder.is_symlink():
            raise ValueError(f"{folder.name} is a link elsewhere; nothing is written there")
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise rl.errors.OutputNotWritten(f"{folder}: cannot be made ({error.strerror})") from None
        target, number = folder / f"{stem}{ending}", 1
        while os.path.lexists(target):
            number += 1
            target = folder / f"{stem}-{number}{ending}"
        with rl.files.replacing(target) as temporary, open(temporary, "wb") as file:
            yield file, target

    def matte(self, content: bytes) -> Path:
        """Write a painted matte, a PNG, under a name of its content: what the shot named before is still there.

        Raises ValueError for what is no PNG, OutputNotWritten.
        """
        if not content.startswith(PNG):
            raise ValueError("a matte is a PNG")
        folder = self.root / MATTES
        if folder.is_symlink():
            raise ValueError(f"{MATTES} is a link elsewhere; nothing is written there")
        target = folder / f"occluder-{hashlib.blake2b(content, digest_size=5).hexdigest()}.png"
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise rl.errors.OutputNotWritten(f"{folder}: cannot be made ({error.strerror})") from None
        if not target.is_file():
            with rl.files.replacing(target) as temporary:
                temporary.write_bytes(content)
                rl.files.read_facts(temporary)
        return target

    def room(self) -> int:
        """Bytes that may still be written."""
        return shutil.disk_usage(self.root).free - ROOM_LEFT

    def refuse_outside(self, value: object) -> None:
        """Raises ValueError where a value for the shot file names a file that is not below the root."""
        if isinstance(value, str):
            if Path(value).anchor or ".." in Path(value).parts or "\0" in value:
                raise ValueError(f"{value[:80]} is not below {self.root}; the page works in this folder alone")
        elif isinstance(value, dict | list):
            for each in value.values() if isinstance(value, dict) else value:
                self.refuse_outside(each)


def plain_stem(name: str) -> str:
    """A file's name before its ending in letters, digits, points and dashes, which every system takes; may be empty.

    Windows keeps con, nul and the like for devices, whatever follows the first point.
    """
    stem = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._-")[:80]
    first, point, rest = stem.partition(".")
    return f"{first}_{point}{rest}" if DEVICES.fullmatch(first) else stem
