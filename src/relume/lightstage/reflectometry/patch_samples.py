"""What a patch reflects, measured in one plane: a lamp and a camera that turn about it (Debevec et al. 2000, Fig. 10).

Angles are from the patch's normal, in the plane of lamp, camera and normal, positive to one side and negative to the
other, as the paper's ±(0, 22.5, 45 …) degrees are. A sample is the radiance of the patch by the lamp's irradiance on a
surface that faces it: f cos θi.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.lightstage.matting.gray_code import linear_picture

LIST = "patch.json"
FEWEST = 20
"""Samples: a fit has six parameters, and noise wants some more."""
ROUNDING = 0.002
"""Of the brightest sample: a deviation below which no camera's average of some pixels is believed."""
NORMAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class PatchSamples:
    """What a patch reflects of light from one angle towards another.

    incidence, viewing : (N,) radians from the normal, signed, within a right angle; equal where lamp and camera stand
        in one direction
    values : (N, 3), radiance by irradiance at normal incidence, linear Rec. 709
    deviation : (N, 3), their standard deviations

    Raises ValueError for too few samples, angles beyond the horizon, and values that are no numbers.
    """

    incidence: np.ndarray
    viewing: np.ndarray
    values: np.ndarray
    deviation: np.ndarray

    def __post_init__(self) -> None:
        count = len(self.incidence)
        shapes = [each.shape for each in (self.viewing, self.values, self.deviation)]
        if shapes != [(count,), (count, 3), (count, 3)]:
            raise ValueError(f"{count} angles of incidence, but angles of view, values and deviations are {shapes}")
        if count < FEWEST:
            raise ValueError(f"{count} samples of the patch; a fit needs {FEWEST}, better some hundred")
        for name in ("incidence", "viewing"):
            steep = np.abs(getattr(self, name)) >= np.pi / 2
            if not np.all(np.isfinite(getattr(self, name))) or steep.any():
                raise ValueError(f"{int(steep.sum())} angles of {name} are 90° from the normal or more; leave them out")
        if not np.all(np.isfinite(self.values)) or not np.all(self.deviation > 0):
            raise ValueError("some samples are no numbers, or have no deviation above 0")

    @property
    def light(self) -> np.ndarray:
        """Directions towards the lamp (N, 3), the normal +Z."""
        return in_plane(self.incidence)

    @property
    def view(self) -> np.ndarray:
        """Directions towards the camera (N, 3), the normal +Z."""
        return in_plane(self.viewing)


def in_plane(angles: np.ndarray) -> np.ndarray:
    """Unit directions (…, 3) at signed angles from +Z towards +X."""
    return np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)


def read_patch(folder: str | os.PathLike[str]) -> PatchSamples:
    """The samples of a folder of photographs and its patch.json.

    patch.json is {"irradiance": 3.1, "area": [LEFT, TOP, WIDTH, HEIGHT], "pictures": [{"file": "a.exr", "incidence":
    -30, "view": 22.5}, …]}: degrees; the irradiance of the lamp on a surface that faces it, in the pictures' unit, a
    number or R, G, B, 1 unless given; the pixels of the patch, of all pictures or of one. Pictures in which the lamp
    hides the patch are left out of the list. Photographs (JPEG, PNG, TIFF) are taken as sRGB.
    Raises UnreadableFile, in one line.
    """
    path = Path(folder) / LIST
    try:
        table = json.loads(path.read_text("utf-8"))
        entries, irradiance = list(table["pictures"]), np.asarray(table.get("irradiance", 1.0), np.float64)
        if irradiance.shape not in ((), (3,)) or not np.all(irradiance > 0):
            raise ValueError("irradiance is one number above 0, or three")
        measured = [_sample(Path(folder), entry, table.get("area")) for entry in entries]
        angles = np.radians([[float(entry[name]) for name in ("incidence", "view")] for entry in entries])
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: is missing; it lists the photographs of the patch and their angles") from None
    except KeyError as error:
        raise UnreadableFile(f"{path}: the key {error} is missing; add it") from None
    except (OSError, AttributeError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: not a list of photographs of a patch ({error})") from None
    encoded = sum(each[2] for each in measured)
    if encoded:
        warn(f"{folder}: {encoded} photographs, taken as sRGB, or as their profiles say; EXR files would be exact")
    try:
        values = np.array([each[0] for each in measured]).reshape(-1, 3) / irradiance
        spread = np.array([each[1] for each in measured]).reshape(-1, 3) / irradiance
        least = ROUNDING * np.abs(values).max(initial=1e-30)
        incidence, viewing = angles.reshape(-1, 2).T
        return PatchSamples(incidence, viewing, values, np.hypot(spread, least))
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}") from None


def _sample(folder: Path, entry: dict[str, Any], area: list[int] | None) -> tuple[np.ndarray, np.ndarray, bool]:
    """Mean and its deviation (3,) of a picture's pixels of the patch, and whether it is a photograph."""
    place = entry.get("area", area)
    if place is None:
        raise KeyError("area")
    left, top, width, height = (int(value) for value in place)
    picture, encoded = linear_picture(folder / entry["file"])
    pixels = picture[top : top + height, left : left + width]
    if min(left, top) < 0 or min(width, height) < 1 or pixels.shape[:2] != (height, width):
        raise ValueError(
            f"{entry['file']}: the area {place} is not within its {picture.shape[1]}×{picture.shape[0]} pixels"
        )
    flat = pixels.reshape(-1, 3).astype(np.float64)
    if encoded and (flat >= 0.999).any():
        raise ValueError(f"{entry['file']}: the patch is saturated; expose shorter")
    return flat.mean(axis=0), flat.std(axis=0) / np.sqrt(len(flat)), encoded
