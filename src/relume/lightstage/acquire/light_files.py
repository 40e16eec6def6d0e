"""Lists of light directions in text files: the `.lp` of reflectance transformation imaging, and plain lists of vectors.

An `.lp` says how many lights there are and then, a line each, a picture's name and the direction towards its light. Its
frame is that of the picture: x right, y up, z towards the camera, which is the world's for a camera that looks along
−Z. A plain list has no names: a line a light, or three lines of x, of y and of z.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relume.errors import InvalidStage
from relume.image.files import write_text
from relume.sphere.directions import normalised

LIST = ".lp"
_FIELD = re.compile(r"[,;\s]+")


def read_lp(path: str | os.PathLike[str]) -> tuple[tuple[str, ...], np.ndarray]:
    """The names of the pictures in an `.lp` file, and unit directions (N, 3) towards their lights.

    Names may have folders of another computer, and spaces; empty lines, lines that begin with # and line ends of any
    system are understood. Raises InvalidStage, naming the line, for a wrong count, a line without three numbers, or a
    picture named twice.
    """
    lines = _lines(path)
    if not lines:
        raise InvalidStage(f"{path}: empty; an .lp begins with the number of lights")
    number, first = lines[0]
    if not first.isdecimal():
        raise InvalidStage(f'{path}: line {number}: "{first:.40}"; an .lp begins with the number of lights')
    names: list[str] = []
    directions: list[list[float]] = []
    for number, line in lines[1:]:
        words = line.rsplit(maxsplit=3)
        vector = _vector(words[1:]) if len(words) == 4 else None
        if vector is None:
            raise InvalidStage(f'{path}: line {number}: "{line:.60}"; expected a picture\'s name, x, y and z')
        name = words[0].strip('"')
        if name in names:
            raise InvalidStage(f"{path}: line {number}: {name} is named a second time; leave one out")
        names.append(name)
        directions.append(vector)
    if len(names) != int(first):
        raise InvalidStage(
            f"{path}: line {lines[0][0]} says {int(first)} lights, but {len(names)} follow; correct the number, or add "
            "what is missing"
        )
    return tuple(names), _unit(directions, path)


def write_lp(path: str | os.PathLike[str], names: Sequence[str], directions: np.ndarray) -> None:
    """Write an `.lp` file, whole or not at all, with nine decimals: a thousandth of an arc second.

    Raises ValueError for names that the form cannot hold, OutputNotWritten.
    """
    for name in names:
        if not name.strip() or name != name.strip() or name.startswith("#") or len(name.splitlines()) != 1:
            raise ValueError(f"the picture's name {name!r} cannot stand in an .lp; rename it")
    lines = [str(len(names))]
    for name, (x, y, z) in zip(names, normalised(directions).tolist(), strict=True):
        lines.append(f"{name} {x:.9f} {y:.9f} {z:.9f}")
    write_text(path, "\n".join(lines) + "\n")


def read_directions(path: str | os.PathLike[str]) -> np.ndarray:
    """Unit directions (N, 3) of a list without names: a line a light, or three lines of all x, all y and all z.

    A first line with a single number is their count. Numbers stand apart by blanks, commas or semicolons; three lines
    of three numbers are read as a line a light. Raises InvalidStage.
    """
    rows: list[list[float]] = []
    count: tuple[int, int] | None = None
    for number, line in _lines(path):
        words = [word for word in _FIELD.split(line) if word]
        if count is None and not rows and len(words) == 1 and words[0].isdecimal():
            count = number, int(words[0])
            continue
        values = _vector(words)
        if values is None or (rows and len(values) != len(rows[0])):
            expected = f"{len(rows[0])} numbers, as above" if rows else "numbers"
            raise InvalidStage(f'{path}: line {number}: "{line:.60}"; expected {expected}')
        rows.append(values)
    table = np.array(rows, np.float64)
    if table.ndim == 2 and table.shape[1] != 3 and table.shape[0] == 3:
        table = table.T
    if table.ndim != 2 or table.shape[1] != 3:
        raise InvalidStage(f"{path}: {len(rows)} lines of {len(rows[0]) if rows else 0} numbers; expected x, y and z")
    if count is not None and count[1] != len(table):
        raise InvalidStage(
            f"{path}: line {count[0]} says {count[1]} lights, but {len(table)} follow; correct the number, or add what "
            "is missing"
        )
    return _unit(table.tolist(), path)


def _lines(path: str | os.PathLike[str]) -> list[tuple[int, str]]:
    """The lines that say something, with their numbers."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InvalidStage(f"{path}: no such file; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidStage(f"{path}: cannot be read ({error.__class__.__name__}); is it a text file?") from None
    stripped = ((number, line.strip()) for number, line in enumerate(re.split(r"\r\n|\r|\n", text), 1))
    return [(number, line) for number, line in stripped if line and not line.startswith("#")]


def _vector(words: list[str]) -> list[float] | None:
    try:
        values = [float(word) for word in words]
    except ValueError:
        return None
    return values if np.all(np.isfinite(values)) else None


def _unit(directions: list[list[float]], path: str | os.PathLike[str]) -> np.ndarray:
    if not directions:
        raise InvalidStage(f"{path}: lists no light; add a line a light")
    array = np.array(directions, np.float64)
    lengths = np.linalg.norm(array, axis=1)
    if not np.all(lengths > 0):
        raise InvalidStage(f"{path}: light {int(np.argmin(lengths)) + 1} has the direction 0, 0, 0; give it a length")
    return normalised(array)
