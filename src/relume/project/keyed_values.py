"""The keys of shot and scene files at a frame: what is interpolated between them, and the tables with these values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from relume.errors import RelumeError
from relume.project.schema import SomeTable
from relume.scene.gltf.animation import read_animation
from relume.scene.motion.animation import Animation
from relume.scene.motion.keyframes import Interpolation, Linear, Smooth, Step, Track, Turning

BETWEEN: dict[str, Interpolation] = {"linear": Linear(), "smooth": Smooth(), "step": Step()}
"""What lies between two keys, by the words of `sequence.interpolation`."""


def values_at(keys: Sequence[Any], frame: float, between: Interpolation, names: Sequence[str]) -> dict[str, Any]:
    """The value of each of these names at a frame, interpolated between its keys; names without a key are left out."""
    found: dict[str, Any] = {}
    for name in names:
        given = [(key.frame, getattr(key, name)) for key in keys if getattr(key, name) is not None]
        if given:
            times, values = (np.array(column, np.float64) for column in zip(*given, strict=True))
            value = Track(times, values, between).at(frame)
            found[name] = tuple(value.tolist()) if value.ndim else float(value)
    return found


def placement_at(keys: Sequence[Any], frame: float, between: Interpolation) -> dict[str, Any]:
    """What the keys of an object (translate, rotate, scale) say of a frame, by name."""
    found = values_at(keys, frame, between, ("translate", "scale"))
    if turns := [key for key in keys if key.rotate is not None]:
        times = np.array([key.frame for key in turns])
        angles = Turning(times, np.array([key.rotate for key in turns]), between).at(frame)
        found["rotate"] = tuple(angles.tolist())
    return found


def table_at(
    table: SomeTable, changes: Mapping[str, Any], place: str, frame: float, refused: type[RelumeError]
) -> SomeTable:
    """The table without its keys and with their values at a frame, checked as if the file held them.

    Raises `refused`, naming the key below `place` and the frame.
    """
    try:
        return type(table).model_validate(table.model_dump(exclude_unset=True) | dict(changes) | {"keyframes": ()})
    except ValidationError as error:
        fault = error.errors()[0]
        keys = ".".join(map(str, (place, *fault["loc"])))
        if not fault["loc"]:  # of the table as a whole
            raise refused(f"{keys}: at frame {frame:g} {fault['msg'].removeprefix('Value error, ')}") from None
        raise refused(
            f"{keys}: at frame {frame:g} the keys make it {fault['input']!r}: {fault['msg']}; add a key there"
        ) from None


@lru_cache(maxsize=64)
def _motion(path: Path, modified: int) -> Animation | None:
    return read_animation(path)


def motion_of(path: Path) -> Animation | None:
    """The motion that a mesh file holds, read once; None where it holds none, or the file is missing."""
    try:
        return _motion(path, path.stat().st_mtime_ns)
    except OSError:  # reported where the mesh is read
        return None
