"""Meshes that are dropped with the files they name: a glTF with its buffer and pictures, an OBJ with its .mtl, layers
of USD. They come in one request and go into a folder of their own, whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import posixpath
import re
import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import relume as rl
from relume.studio.shots.folder import DEVICES, MESHES, PICTURES, Folder, plain_stem

BESIDE = (".bin", ".mtl", ".mtlx", ".webp", ".bmp", ".tga", ".avif", ".ktx2")
"""Endings of what meshes name beside pictures."""
ACCEPTED_ENDINGS = (*MESHES, *PICTURES, *BESIDE)
OPTIONAL = (".mtl", ".mtlx")
"""What a mesh is read without, with a warning, where it is missing."""
READ = (*MESHES, ".mtl")
"""What may name other files."""
MOST_FILES, LONGEST_LIST = 2000, 1024**2
HIDDEN = ".dropped-"
"""How the folder of a drop is called while its files come."""
FORSAKEN = 3600.0
"""Seconds after which such a folder belongs to no drop that still comes."""
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
            self._place = Path(tempfile.mkdtemp(prefix=HIDDEN, dir=objects))
        except OSError as error:
            raise rl.errors.OutputNotWritten(f"{objects}: cannot be written ({error.strerror})") from None
        self._files = files
        self._placed: dict[str, str] = {}  # where meshes look for what lay elsewhere, and as what it was dropped
        self._in_place = set[str]()  # what was dropped where a mesh looks for it

    async def take(self, chunks: AsyncIterator[bytes], write: Any) -> None:
        """Write the files as their bytes come, one after another; raises ValueError where there are too few or many.

        write : awaits a function that writes, in a thread
        Raises OutputNotWritten.
        """
        rest = b""
        for each in self._files:
            target = self._place / each.name
            kept = each.name.lower().endswith(ACCEPTED_ENDINGS)
            with _written(each.name):
                target.parent.mkdir(parents=True, exist_ok=True)
            with _written(each.name), open(target if kept else os.devnull, "wb") as file:
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

        Raises ValueError where what a mesh names was not dropped with it, UnreadableFile, OutputNotWritten.
        """
        there = [each.name for each in self._files if each.name.lower().endswith(ACCEPTED_ENDINGS)]
        meshes = [name for name in there if name.lower().endswith(MESHES)]
        if not meshes:
            raise ValueError("there is no mesh among these files; drop a glTF, OBJ, PLY, STL or USD")
        named = self._named(there)
        for target, source in self._placed.items():
            self._link(source, target)
        roots = [name for name in meshes if name not in named]
        stem = plain_stem(Path((roots or meshes)[0]).stem) or "mesh"
        target, number = self._place.with_name(stem), 1
        while os.path.lexists(target):
            number += 1
            target = self._place.with_name(f"{stem}-{number}")
        with _written(f"objects/{target.name}"):
            os.chmod(self._place, 0o755)
            rl.files.put_in_place(self._place, target)
        return {
            "meshes": [self._folder.name(target / name) for name in sorted(roots or meshes)],
            "left_out": [each.name for each in self._files if each.name not in there],
        }

    def discard(self) -> None:
        """Leave nothing behind, where it was not settled."""
        shutil.rmtree(self._place, ignore_errors=True)

    def _named(self, there: list[str]) -> set[str]:
        """What the files name, as it was dropped; what lies elsewhere than they say is noted in `_placed`."""
        named, refused = set[str](), dict[str, ValueError]()
        waiting, seen = [name for name in there if name.lower().endswith(READ)], set[str]()
        while waiting:
            name = waiting.pop()
            if name in seen:
                continue
            seen.add(name)
            dropped = self._placed.get(name, name)
            try:
                references = rl.scene.files_beside_mesh(self._place / dropped)
            except rl.errors.UnreadableFile as error:
                raise rl.errors.UnreadableFile(str(error).replace(f"{self._place}{os.sep}", "")) from None
            for reference in references:
                try:
                    found = self._given(name, reference, there)
                except ValueError as error:
                    refused[name] = error
                    break
                named |= {self._placed.get(each, each) for each in found} - {dropped}
                waiting += [each for each in found if each.lower().endswith(READ)]
        # What is read from another place alone need not find anything from where it was dropped.
        elsewhere = set(self._placed.values()) - self._in_place
        for name, error in refused.items():
            if name not in elsewhere:
                raise error
        return named

    def _given(self, name: str, reference: str, there: list[str]) -> list[str]:
        """The files that a reference stands for, by where it says; those of the same name elsewhere get that place."""
        wanted = posixpath.normpath(posixpath.join(posixpath.dirname(name), reference))
        optional = reference.lower().endswith(OPTIONAL)
        if re.match(r"^([A-Za-z]:|/|[a-z]+://)", reference) or wanted.startswith(".."):
            if optional:
                return []
            raise ValueError(f"{name} names {reference[:120]}, which is not below it; export it with relative paths")
        tiles = re.compile(re.escape(wanted).replace("<UDIM>", "([0-9]{4})"))
        found = [each for each in there if tiles.fullmatch(each)]
        self._in_place |= set(found)
        if found:
            return found
        base = re.compile(re.escape(posixpath.basename(wanted)).replace("<UDIM>", "([0-9]{4})"), re.IGNORECASE)
        candidates: dict[str, list[str]] = {}
        for other in there:
            same = base.fullmatch(posixpath.basename(other))
            if same and other != self._placed.get(name, name):
                target = wanted.replace("<UDIM>", same[1]) if base.groups else wanted
                candidates.setdefault(target, []).append(other)
        for target, sources in candidates.items():
            if len(sources) > 1:
                any_of = ", ".join(each[:120] for each in sources[:4])
                raise ValueError(
                    f"{name} names {reference[:120]}, which may be any of {any_of}; drop it where it is named"
                )
            self._placed[target] = sources[0]
        if len(self._placed) > MOST_FILES:
            raise ValueError(f"{name} names {reference[:120]}, and so on without an end; export it again")
        if not candidates and not optional:
            raise ValueError(f"{name} names {reference[:120]}, which was not dropped with it; drop them together")
        return list(candidates)

    def _link(self, source: str, target: str) -> None:
        """Let a file be found under another name too, without bytes of its own where the disk can do that.

        Raises OutputNotWritten.
        """
        one, other = self._place / source, self._place / target
        with _written(target):
            other.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(one, other)
            except OSError:
                if one.stat().st_size > self._folder.room():
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from None
                shutil.copyfile(one, other)


def sweep(folder: Folder) -> None:
    """Remove what drops left behind whose server was killed before they were whole."""
    objects = folder.root / "objects"
    if objects.is_symlink() or not objects.is_dir():
        return
    for each in objects.glob(f"{HIDDEN}*"):
        with suppress(OSError):  # another studio of this folder may be sweeping too
            if not each.is_symlink() and time.time() - each.lstat().st_mtime > FORSAKEN:
                shutil.rmtree(each, ignore_errors=True)


@contextmanager
def _written(name: str) -> Iterator[None]:
    """Raises OutputNotWritten, which names the file, where the block cannot write."""
    try:
        yield
    except OSError as error:
        raise rl.errors.OutputNotWritten(f"{name}: cannot be written ({error.strerror or error})") from None


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
        strange |= DEVICES.fullmatch(part.partition(".")[0]) is not None
        if not part or part.startswith(".") or part.endswith((" ", ".")) or strange or len(part.encode()) > 200:
            raise _UnsafeName(f"{str(name)[:80]!r} is no name for a file here; rename it")
    if not 1 <= len(parts) <= 8:
        raise _UnsafeName(f"{str(name)[:80]!r} lies in too many folders; drop the one that it is in")
    return "/".join(parts)
