"""A folder of photographs of a patch, and the list of them, read as its samples."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from relume.errors import UnreadableFile, warn
from relume.lightstage.matting.gray_code import linear_picture
from relume.lightstage.reflectometry.patch_samples import PatchSamples
from relume.scene.toml_tables import Table, checked_whole

LIST = "patch.json"
ROUNDING = 0.002
"""Of the brightest sample: a deviation below which no camera's average of some pixels is believed."""
MOST_NAMED = 6
"""Photographs that a message names; further ones are counted."""
_Angle = Annotated[float, Field(gt=-90, lt=90)]
_Area = tuple[
    Annotated[int, Field(ge=0)], Annotated[int, Field(ge=0)], Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]
]


def _colour(value: Any) -> tuple[float, ...]:
    """One number above 0 or three as R, G, B."""
    try:
        found = np.broadcast_to(np.asarray(value, np.float64), 3) if np.ndim(value) == 0 else np.asarray(value, float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (3,) or not np.all(np.isfinite(found) & (found > 0)):
        raise ValueError(f"expected one number above 0, or three (got {value!r:.60})")
    return tuple(float(each) for each in found)


class _Picture(Table):
    file: str
    incidence: _Angle
    view: _Angle
    area: _Area | None = None


class _PatchTable(Table):
    irradiance: Annotated[tuple[float, ...], BeforeValidator(_colour)] = (1.0, 1.0, 1.0)
    area: _Area | None = None
    pictures: list[_Picture]

    @model_validator(mode="after")
    def _placed(self) -> _PatchTable:
        if self.area is None and (bare := [each.file for each in self.pictures if each.area is None]):
            raise ValueError(f'no "area" of all, nor of {_named(bare)}; give the patch as [left, top, width, height]')
        return self


@dataclass(frozen=True, eq=False)
class _Measured:
    """Of one picture: mean and its deviation (3,) over the patch, and whether it is a photograph or saturated there."""

    mean: np.ndarray
    deviation: np.ndarray
    encoded: bool
    saturated: bool


def read_patch(folder: str | os.PathLike[str]) -> PatchSamples:
    """The samples of a folder of photographs and its patch.json.

    folder : of the photographs and patch.json

    patch.json is {"irradiance": 3.1, "area": [LEFT, TOP, WIDTH, HEIGHT], "pictures": [{"file": "a.exr", "incidence":
    -30, "view": 22.5}, …]}: degrees; the irradiance of the lamp on a surface that faces it, in the pictures' unit, a
    number or R, G, B, 1 unless given; the pixels of the patch, of all pictures or of one. Pictures in which the lamp
    hides the patch are left out of the list. Photographs (JPEG, PNG, TIFF) are taken as sRGB.
    Raises UnreadableFile, in one line: of the list all that is wrong, and of the photographs all that are saturated.
    """
    path = Path(folder) / LIST
    try:
        table = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: is missing; it lists the photographs of the patch and their angles") from None
    except (OSError, ValueError) as error:
        raise UnreadableFile(f"{path}: not a list of photographs of a patch ({error})") from None
    given = checked_whole(_PatchTable, table, path, "list of photographs", UnreadableFile)
    measured = [_measured(Path(folder) / each.file, each.area or given.area) for each in given.pictures]
    pairs = list(zip(given.pictures, measured, strict=True))
    if white := [each.file for each, found in pairs if found.saturated]:
        raise UnreadableFile(f"{folder}: the patch is saturated in {_named(white)}; expose shorter, all of them alike")
    encoded = sum(each.encoded for each in measured)
    if encoded:
        warn(f"{folder}: {encoded} photographs, taken as sRGB, or as their profiles say; EXR files would be exact")
    values = np.array([each.mean for each in measured]).reshape(-1, 3) / given.irradiance
    spread = np.array([each.deviation for each in measured]).reshape(-1, 3) / given.irradiance
    least = ROUNDING * np.abs(values).max(initial=1e-30)
    incidence = np.radians([each.incidence for each in given.pictures])
    viewing = np.radians([each.view for each in given.pictures])
    try:
        return PatchSamples(incidence, viewing, values, np.hypot(spread, least))
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}") from None


def _measured(path: Path, area: _Area | None) -> _Measured:
    assert area is not None  # the list has been checked
    left, top, width, height = area
    picture, encoded = linear_picture(path)
    pixels = picture[top : top + height, left : left + width]
    if pixels.shape[:2] != (height, width):
        size = f"{picture.shape[1]}×{picture.shape[0]}"
        raise UnreadableFile(f"{path}: the area {list(area)} is not within its {size} pixels; {LIST} has it")
    flat = pixels.reshape(-1, 3).astype(np.float64)
    saturated = encoded and bool((flat >= 0.999).any())
    return _Measured(flat.mean(axis=0), flat.std(axis=0) / np.sqrt(len(flat)), encoded, saturated)


def _named(names: Sequence[str]) -> str:
    """Names of photographs in a line: the first, and how many more."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
