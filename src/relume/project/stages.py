"""Stages of a job, kept on disk with the hash of what made them, so that a second run redoes only what changed."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten
from relume.image.files import replacing
from relume.renderers.progressive.fingerprint import fingerprint, program

Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Stages:
    """The kept stages of one output folder.

    folder : where they are kept, one .npz a stage
    others : folders of other jobs whose stages serve as well where they were made from the same: other frames
    """

    folder: Path
    others: tuple[Path, ...] = ()

    def get(self, name: str, made_from: object, make: Callable[[], Arrays]) -> tuple[Arrays, bool]:
        """The arrays of stage `name`, and whether they were kept from an earlier run.

        made_from : everything the result depends on: JSON-able values, paths, arrays and dataclasses of them
        """
        key = fingerprint([program(), name, made_from])
        path = self.folder / f"{name}.npz"
        for folder in (self.folder, *self.others):
            kept = _kept(folder / path.name, key)
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


def _kept(path: Path, key: str) -> Arrays | None:
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            if str(file["_key"]) != key:
                return None
            return {name: file[name] for name in file.files if name != "_key"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
