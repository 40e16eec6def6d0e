"""Stages of a job, kept on disk with the hash of what made them, so that a second run redoes only what changed."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import OutputNotWritten
from relume.image.files import replacing
from relume.render.mitsuba_variant import choose_variant

Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Stages:
    """The kept stages of one output folder.

    folder : where they are kept, one .npz a stage
    """

    folder: Path

    def get(self, name: str, made_from: object, make: Callable[[], Arrays]) -> tuple[Arrays, bool]:
        """The arrays of stage `name`, and whether they were kept from an earlier run.

        made_from : everything the result depends on: JSON-able values, paths, arrays and dataclasses of them
        """
        key = fingerprint([_program(), name, made_from])
        path = self.folder / f"{name}.npz"
        kept = _kept(path, key)
        if kept is not None:
            return kept, True
        arrays = make()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputNotWritten(f"{self.folder}: cannot be made ({error.strerror}); choose another -o") from None
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, _key=np.array(key), **arrays)  # pyright: ignore[reportArgumentType]
        return arrays, False


@lru_cache
def _program() -> list[object]:
    """What computes: every module of relume as it is now, and the libraries whose numbers it passes on."""
    package = Path(__file__).parents[1]
    modules = [path.read_bytes() for path in sorted(package.rglob("*.py"))]
    libraries = ("numpy", "scipy", "mitsuba", "mitsuba-oidn", "opencv-python-headless", "trimesh")
    return [hashlib.sha256(b"".join(modules)).hexdigest(), choose_variant().name, *map(version, libraries)]


def fingerprint(value: object) -> str:
    """A SHA-256 of values; a Path counts as the bytes it holds, an array as its own, a dataclass as its fields."""
    return hashlib.sha256(json.dumps(value, default=_content, sort_keys=True).encode()).hexdigest()


def _content(value: object) -> Any:
    if isinstance(value, Path):
        return hashlib.sha256(value.read_bytes()).hexdigest()
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if is_dataclass(value):
        return [type(value).__name__, {field.name: getattr(value, field.name) for field in fields(value)}]
    raise TypeError(f"{type(value).__name__} cannot be part of a fingerprint")


def _kept(path: Path, key: str) -> Arrays | None:
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            if str(file["_key"]) != key:
                return None
            return {name: file[name] for name in file.files if name != "_key"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
