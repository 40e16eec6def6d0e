"""Words of the command line that several commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import relume as rl

if TYPE_CHECKING:
    import numpy as np

Times = Annotated[
    str | None, Parameter(help="Exposure time of each photograph in seconds, like 1/30,1/60,1/125; replaces the EXIF.")
]
Threads = Annotated[int | None, Parameter(help="Threads to render with; all cores unless given.")]
DryRun = Annotated[bool, Parameter(negative="", help="Say what would be done, and do nothing.")]


def read_times(text: str | None, option: str = "--times") -> list[float] | None:
    """Seconds from text like "1/30,1/60,0.5"; raises ValueError naming the option and the word."""
    if text is None:
        return None
    times = []
    for word in text.replace(",", " ").split():
        try:
            times.append(float(Fraction(word)))
        except (ValueError, ZeroDivisionError):
            raise ValueError(f'{option}: "{word}" is no exposure time; write seconds, like 1/30 or 0.5') from None
        if times[-1] <= 0:
            raise ValueError(f'{option}: "{word}" is not above 0')
    return times


def read_point(text: str, option: str) -> tuple[float, float, float]:
    """Three numbers from text like "0,0.17,1"; raises ValueError naming the option."""
    try:
        x, y, z = (float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise ValueError(f'{option}: "{text}" is no place; write three numbers in metres, like 0,0.17,1') from None
    return x, y, z


def read_angles(text: str, option: str) -> np.ndarray:
    """Three angles of "YAW[,PITCH[,ROLL]]" in degrees, as radians; raises ValueError naming the option."""
    import numpy as np

    try:
        angles = [float(word) for word in text.replace(",", " ").split()]
        if not 1 <= len(angles) <= 3 or not np.all(np.isfinite(angles)):
            raise ValueError
    except ValueError:
        raise ValueError(f'{option}: "{text}" is no turn; write YAW, YAW,PITCH or YAW,PITCH,ROLL in degrees') from None
    return np.radians([*angles, 0.0, 0.0][:3])


def read_rotation(text: str, option: str) -> np.ndarray:
    """The rotation of light: roll about +Z first, pitch about +X, then yaw about +Y, right-handed."""
    return rl.mappings.rotation_from_angles(*read_angles(text, option))


def require_files(paths: Sequence[Path]) -> None:
    """Refuse paths that are not files, so that a dry run reports them too."""
    for path in paths:
        if path.is_dir():
            raise rl.errors.UnreadableFile(f"{path}: a folder; name the files in it, like {path}/*.jpg")
        if not path.is_file():
            raise rl.errors.UnreadableFile(f"{path}: no such file; check the path")


def made_folder(out: Path) -> Path:
    """The folder of -o, made where it is missing; raises OutputNotWritten."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise rl.errors.OutputNotWritten(
            f"-o {out}: cannot be made a folder ({error.strerror}); choose another"
        ) from None
    return out


def refuse_input(out: Path, paths: Sequence[Path]) -> None:
    """Refuse an output that is one of the inputs: an original stays as it was."""
    for path in paths:
        if out.exists() and path.exists() and out.samefile(path):
            raise ValueError(f"-o {out}: the input itself; give another name, so that the original stays as it was")


def require_suffix(out: Path, *suffixes: str, option: str = "-o") -> None:
    """Refuse an output that cannot be written, before any work is done."""
    if not out.name.lower().endswith(suffixes):
        raise ValueError(f"{option} {out}: the file must end in {' or '.join(suffixes)}")
    if not out.parent.is_dir():
        raise rl.errors.OutputNotWritten(f"{option} {out}: no folder {out.parent}; make it first or choose another")


def numbers(text: str, option: str, *counts: int) -> list[float]:
    """As many numbers as one of `counts` from text like "10,20,5.5"; raises ValueError naming the option."""
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) not in counts or not all(map(isfinite, values)):
        wanted = " or ".join(map(str, counts))
        raise ValueError(f'{option}: "{text}" is not {wanted} numbers; write them with commas between')
    return values


def whole(values: Sequence[float], option: str) -> list[int]:
    """Pixels and pixel values as integers; raises ValueError naming the option where one is a fraction."""
    if broken := [value for value in values if not value.is_integer()]:
        raise ValueError(f"{option}: {broken[0]:g} is no whole number; pixels and their values are")
    return [int(value) for value in values]
