"""What the commands of a light stage share: which stage, seen by which camera, with how much memory."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from relume.lightstage.field.field import ReflectanceField

Stage = Annotated[
    Path, Parameter(help="A folder with stage.json or one .lp, such a file, or a store of `relume stage import`.")
]
Camera = Annotated[str | None, Parameter(help="Which camera's pictures, where the stage has several; the first.")]
MaxMemory = Annotated[str, Parameter(help="What pictures may take of memory at once, like 500M or 4G.")]
_UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def bytes_of(text: str, option: str) -> int:
    """Bytes from "500M", "4G" or a plain number; raises ValueError naming the option."""
    word = text.strip().upper().removesuffix("B").removesuffix("I")
    unit = _UNITS.get(word[-1:], 1)
    try:
        size = int(float(word.rstrip("KMGT")) * unit)
    except (OverflowError, ValueError):
        raise ValueError(f'{option}: "{text}" is no size; write bytes, like 500M or 4G') from None
    if size < 1 << 24:
        raise ValueError(f'{option}: "{text}" is less than the 16M that a block of pictures needs')
    return size


def work_of(field: ReflectanceField, memory: int, more: float = 0.0) -> dict[str, object]:
    """What relighting would take: facts for a dry run; the time is that of some rows, times the rest.

    more : seconds of other work
    """
    lights, (rows, columns) = len(field.lights), field.shape
    some = min(rows, 4)
    first = _seconds(field, slice(0, some))
    # The first rows of a folder cost reading its pictures, which those after them may find in memory.
    after = _seconds(field, slice(some, 2 * some)) if rows > some else 0.0
    seconds = first + after * (rows / some - 1) + more
    size = lights * rows * columns * 3 * 4
    return {
        "lights": lights,
        "size": [columns, rows],
        "values as floats": _readable(size),
        "memory": _readable(min(size, memory)),
        "seconds, about": float(f"{seconds:.2g}"),
    }


def _seconds(field: ReflectanceField, rows: slice) -> float:
    begin = time.perf_counter()
    field.block(slice(0, len(field.lights)), rows)
    return time.perf_counter() - begin


def _readable(size: int) -> str:
    for letter in ("G", "M", "K"):
        if size >= _UNITS[letter]:
            return f"{size / _UNITS[letter]:.3g} {letter}iB"
    return f"{size} B"
