"""Meshes that are dropped with the files they name: a glTF with its buffer and pictures, an OBJ with its .mtl, layers
of USD. They come in one request and go into a folder of their own, whole or not at all."""

from __future__ import annotations

import fnmatch
import json
import os
import posixpath
import re
import shutil
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import relume as rl
from relume.studio.shots.folder import MESHES, PICTURES, Folder

BESIDE = (".bin", ".mtl", ".mtlx", ".webp", ".bmp", ".tga", ".avif", ".ktx2")
"""Endings of what meshes name beside pictures."""
TAKEN = (*MESHES, *PICTURES, *BESIDE)
SPARED = (".mtl", ".mtlx")
"""What a mesh is read without, with a warning, where it is missing."""
MOST_FILES, LONGEST_LIST = 2000, 1024**2
LIST_THEM = "list the files as [[name, bytes], …] in the first line"


@dataclass(frozen=True)
class Listed:
    """One file of a request: its name, with the folders that it was dropped in, and how many bytes it has."""

    name: str
    size: int


class Bundle:
    """The files of one drop while they come: in a hidden folder beside `objects/`'s others until they are `settled`."""

    def __init__(self, folder: Folder, files: list[Listed]) -> None:
        self._folder = folder
        objects = folder.root / "objects"
        if objects.is_symlink():
            raise ValueError("objects is a link elsewhere; nothing is written there")
        try:
            objects.mkdir(exist_ok=True)
            self._place = Path(tempfile.mkdtemp(prefix=".dropped-", dir=objects))
        except OSError as error:
            raise rl.errors.OutputNotWritten(f"{objects}: cannot be written ({error.strerror})") from None
        self._files = files
        self._moved: dict[str, str] = {}  # what lay elsewhere than its name says, and where it was put

    async def take(self, chunks: AsyncIterator[bytes], write: Any) -> None:
        """Write the files as their bytes come, one after another; raises ValueError where there are too few or many.

        write : awaits a function that writes, in a thread
        """
        waiting, rest = iter(self._files), b""
        for each in waiting:
            target = self._place / each.name
            target.parent.mkdir(parents=True, exist_ok=True)
            kept = each.name.lower().endswith(TAKEN)
            with open(target if kept else os.devnull, "wb") as file:
                left = each.size
                while left:
                    if not rest:
                        rest = await anext(chunks, b"")
                        if not rest:
                            raise ValueError("the files ended too early; drop them again")
                    await write(file.write, rest[:left])
                    left, rest = left - len(rest[:left]), rest[left:]
        async for more in chunks:
            rest += more
            if rest:
                break
        if rest:
            raise ValueError("more came than was listed; drop the files again")

    def settled(self) -> dict[str, Any]:
        """Give what the files name its place and the folder its name; the meshes that no other names, for JSON.

        Raises ValueError where what a mesh names was not dropped with it, UnreadableFile.
        """
        there = [each.name for each in self._files if each.name.lower().endswith(TAKEN)]
        meshes = [name for name in there if name.lower().endswith(MESHES)]
        if not meshes:
            raise ValueError("there is no mesh among these files; drop a glTF, OBJ, PLY, STL or USD")
        named: set[str] = set()
        waiting, seen = [name for name in there if name.lower().endswith((*MESHES, ".mtl"))], set[str]()
        while waiting:
            name = waiting.pop()
            if name in seen:
                continue
            seen.add(name)
            if name in self._moved:
                continue
            for reference in rl.scene.files_beside_mesh(self._place / name):
                found = self._given(name, reference, there)
                named |= set(found) - {name}
                waiting += [each for each in found if each.lower().endswith((*MESHES, ".mtl"))]
        roots = [name for name in meshes if name not in named and name not in self._moved]
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", Path((roots or meshes)[0]).stem).strip("._-")[:80] or "mesh"
        target, number = self._place.with_name(stem), 1
        while os.path.lexists(target):
            number += 1
            target = self._place.with_name(f"{stem}-{number}")
        os.chmod(self._place, 0o755)
        self._place.rename(target)
        return {
            "meshes": [self._folder.name(target / name) for name in sorted(roots or meshes)],
            "left_out": [each.name for each in self._files if each.name not in there],
        }

    def discard(self) -> None:
        """Leave nothing behind, where it was not settled."""
        shutil.rmtree(self._place, ignore_errors=True)

    def _given(self, name: str, reference: str, there: list[str]) -> list[str]:
        """The files that a reference stands for, put where it says from those of the same name elsewhere."""
        wanted = posixpath.normpath(posixpath.join(posixpath.dirname(name), reference))
        if re.match(r"^([A-Za-z]:|/|[a-z]+://)", reference) or wanted.startswith(".."):
            if reference.lower().endswith(SPARED):
                return []
            raise ValueError(f"{name} names {reference[:120]}, which is not below it; export it with relative paths")
        pattern = re.sub(r"<UDIM>", "[0-9][0-9][0-9][0-9]", wanted)
        found = fnmatch.filter(there, pattern) if pattern != wanted else [wanted]
        found = [each for each in found if (self._place / each).is_file()]
        if found:
            return found
        base = posixpath.basename(pattern).lower()
        for other in (each for each in there if fnmatch.fnmatch(posixpath.basename(each).lower(), base)):
            target = wanted if pattern == wanted else posixpath.join(posixpath.dirname(wanted), Path(other).name)
            place = self._place / target
            place.parent.mkdir(parents=True, exist_ok=True)
            if other in self._moved and not place.is_file():
                shutil.copyfile(self._place / self._moved[other], place)
            elif other not in self._moved:
                (self._place / other).rename(place)
                self._moved[other] = target
            found.append(target)
        if not found and not reference.lower().endswith(SPARED):
            raise ValueError(f"{name} names {reference[:120]}, which was not dropped with it; drop them together")
        return found


def listed(line: bytes) -> list[Listed]:
    """The files that the first line of a request lists, [[name, bytes], …]; raises ValueError for anything else.

    A folder that all lie in is left out of their names.
    """
    try:
        given = json.loads(line)
        files = [Listed(_safe(name), size) for name, size in given]
    except (ValueError, TypeError, RecursionError) as error:
        raise ValueError(str(error) if isinstance(error, _UnsafeName) else LIST_THEM) from None
    if not files or len(files) > MOST_FILES:
        raise ValueError(f"give 1 to {MOST_FILES} files")
    if not all(isinstance(each.size, int) and not isinstance(each.size, bool) and each.size >= 0 for each in files):
        raise ValueError("a file has a number of bytes")
    tops = {each.name.partition("/")[0] for each in files}
    if len(tops) == 1 and all("/" in each.name for each in files):
        files = [Listed(each.name.partition("/")[2], each.size) for each in files]
    if len({each.name.lower() for each in files}) < len(files):
        raise ValueError("two of these files have one name; drop them with their folders")
    return files


class _UnsafeName(ValueError):
    """A name that leads elsewhere."""


def _safe(name: object) -> str:
    """A name with its folders, as it was dropped; raises _UnsafeName for one that leads elsewhere or is none."""
    parts = name.split("/") if isinstance(name, str) else []
    for part in parts:
        strange = any(ord(each) < 32 or each in '\\:*?"<>|' for each in part)
        if not part or part.startswith(".") or part.endswith((" ", ".")) or strange or len(part.encode()) > 200:
            raise _UnsafeName(f"{str(name)[:80]!r} is no name for a file here; rename it")
    if not 1 <= len(parts) <= 8:
        raise _UnsafeName(f"{str(name)[:80]!r} lies in too many folders; drop the one that it is in")
    return "/".join(parts)
