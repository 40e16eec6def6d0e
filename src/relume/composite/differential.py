"""Differential rendering: add to the photograph what the objects changed, and nothing else (Debevec 1998, §6).

`over` is for a render that holds the objects alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.composite.mattes import solid_foreground
from relume.errors import warn
from relume.image.bands import in_bands
from relume.image.mapped_arrays import give_back_read
from relume.renderers.results import Change

ROUNDING = 1e-6
"""Share of the plate's largest radiance below which a negative value is float32's own rounding."""


class Compositing(Protocol):
    """How a rendered change is carried over to the plate: `Additive`, `Ratio`."""

    def gain(self, plate: np.ndarray) -> np.ndarray | float:
        """Factor on the rendered difference, (H, W, 3) or one for all pixels, of a plate (H, W, 3)."""
        ...


@dataclass(frozen=True)
class Additive:
    """Plate + (with − without), the paper's: right where the model has the plate's reflectance."""

    def gain(self, plate: np.ndarray) -> float:
        """1: the difference is added as it was rendered."""
        return 1.0


@dataclass(frozen=True, eq=False)
class Ratio:
    """Plate · with / without: a shadow takes the same share of the light everywhere.

    The plate keeps its texture in the shadow, because what was rendered cancels but for the share. Right where the
    model has the place's light and shape, but not the detail of its reflectance; wrong for what a smooth surface
    mirrors, which does not depend on the reflectance (there `Additive` is right).

    without : (H, W, 3) radiance of the local scene without the objects, of the scale of the plate
    floor : share of the median of `without` at which ratio and addition have equal say. With the default the gain
        plate / without is within 1 % of its own way to 1 where `without` is its median; far below the floor, where a
        quotient would be of noise alone, the difference is added
    Raises ValueError for a floor that is not positive.
    """

    without: np.ndarray
    floor: float = 0.1

    def __post_init__(self) -> None:
        if not (np.isfinite(self.floor) and self.floor > 0):
            raise ValueError(f"floor is {self.floor}; expected a positive share of the median of `without`")

    def gain(self, plate: np.ndarray) -> np.ndarray:
        """The g that minimizes (plate − g·without)² + floor²·(g − 1)², so it goes smoothly from the quotient to 1."""
        if self.without.shape != plate.shape:
            raise ValueError(f"without is {self.without.shape}; expected the plate's {plate.shape}")
        without = np.maximum(self.without.astype(np.float64), 0)
        lit = without[without > 0]
        square = (self.floor * float(np.median(lit))) ** 2 if lit.size else 1.0
        return (np.maximum(plate, 0) * without + square) / (without**2 + square)


def composed(
    plate: np.ndarray,
    change: Change,
    *,
    mode: Compositing = Additive(),
    occluder: np.ndarray | None = None,
) -> np.ndarray:
    """The plate with the objects: plate · (1 − matte) + gain · difference + objects, (H, W, 3) float32, never below 0.

    plate : (H, W, 3) radiance
    change : what the objects change, of the plate's size and scale
    mode : `Additive()` unless given: it is the paper's, and right for mirrored as for scattered light
    occluder : (H, W), 0 to 1, the share of each pixel that real things in front of the objects cover. With a the
        occluder's share and F its radiance, the plate is a·F + (1 − a)·behind, and only what is behind is changed;
        F at soft edges is that of the nearest pixels the occluder fills (`mattes.solid_foreground`)

    A pixel that is neither covered nor changed, or that an occluder fills, keeps the plate's value to the bit. Warns of
    pixels that had to be held at 0 (the paper's "LS_final negative").
    Raises ValueError when sizes differ.
    """
    if not plate.shape == change.objects.shape == change.difference.shape or change.matte.shape != plate.shape[:2]:
        raise ValueError(
            f"plate {plate.shape}, objects {change.objects.shape}, difference {change.difference.shape} and matte "
            f"{change.matte.shape} differ in size; render with a camera of the plate's size"
        )
    if occluder is not None and occluder.shape != plate.shape[:2]:
        raise ValueError(
            f"occluder is {occluder.shape}, the plate {plate.shape[:2]}; paint it over a picture of the plate's size"
        )
    # What of the whole picture each of its rows needs.
    gain = mode.gain(plate)
    front = None if occluder is None else solid_foreground(plate, occluder)
    height, width = change.matte.shape
    finite = in_bands(height, width, lambda rows: np.max(plate[rows], initial=0, where=np.isfinite(plate[rows])))
    smallest = -ROUNDING * float(np.max(finite))
    picture = np.empty(plate.shape, np.float32)

    # The rows, and how many pixels of them were held at 0.
    def work(rows: slice) -> int:
        share = gain[rows] if isinstance(gain, np.ndarray) else gain
        with np.errstate(invalid="ignore"):  # 0 · ∞ where nothing changes
            difference = np.where(change.difference[rows] != 0, change.difference[rows].astype(np.float64) * share, 0.0)
        hides = None if occluder is None or front is None else (occluder[rows], front[rows])
        objects, matte = change.objects[rows], change.matte[rows]
        picture[rows], below = _joined(plate[rows], objects, difference, matte, hides, smallest)
        give_back_read(change.objects, change.difference, change.matte)
        return below

    below = sum(in_bands(height, width, work))
    if below:
        remedy = "check the reflectance" + (", or composite by ratio" if isinstance(mode, Additive) else "")
        warn(
            f"{below} pixel{'s' if below > 1 else ''} ({100 * below / change.matte.size:.2g} %) came out below 0 and "
            f"were held there: the shadows are rendered darker than the plate is bright; {remedy}"
        )
    return picture


def differential(plate: np.ndarray, with_: np.ndarray, without: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """The composite: matte · with + (1 − matte) · (plate + with − without), never below 0.

    plate, with_, without : (H, W, 3) float32 radiance on one scale: the photograph, the local scene rendered with the
        objects and without them
    matte : (H, W), the share of each pixel that the objects cover, 0 to 1
    Source: Debevec 1998, §6. A pixel that the objects neither cover nor change keeps the plate's value to the bit.
    Where a render is wrong by more than the plate's radiance (the paper's "LS_final negative") the result is 0.
    Raises ValueError when the sizes differ.
    """
    if not plate.shape == with_.shape == without.shape or matte.shape != plate.shape[:2]:
        raise ValueError(
            f"plate {plate.shape}, with {with_.shape}, without {without.shape} and matte {matte.shape} differ in size; "
            "render with a camera of the plate's size"
        )
    cover = matte[..., None].astype(np.float64)
    return _joined(plate, cover * with_, (1 - cover) * (with_.astype(np.float64) - without), matte, None, 0.0)[0]


def over(foreground: np.ndarray, matte: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """The foreground matted over a plate: foreground + (1 − matte)·plate.

    foreground : (H, W, 3) radiance, premultiplied: what the objects add to each pixel, black where there are none, as
        `Prefiltered(background=False)` renders it
    matte : (H, W), the share of each pixel that the objects cover, 0 to 1
    plate : (H, W, 3) radiance on the same scale

    A pixel that the objects do not cover keeps the plate's value to the bit. Raises ValueError when the sizes differ.
    Source: Porter & Duff 1984.
    """
    if foreground.shape != plate.shape or matte.shape != plate.shape[:2]:
        raise ValueError(
            f"foreground {foreground.shape}, matte {matte.shape} and plate {plate.shape} differ in size; "
            "render with a camera of the plate's size"
        )
    cover = matte[..., None].astype(np.float64)
    return np.where(cover > 0, foreground + (1 - cover) * plate, plate).astype(np.float32)


def _joined(
    plate: np.ndarray, objects: np.ndarray, difference: np.ndarray, matte: np.ndarray,
    hides: tuple[np.ndarray, np.ndarray] | None, smallest: float,
) -> tuple[np.ndarray, int]:  # fmt: skip
    """The picture, and how many of its pixels came out below `smallest`.

    hides : the occluder and its part of the plate's light
    """
    cover = matte[..., None].astype(np.float64)
    touched = (cover > 0) | (difference != 0)
    if hides is None:
        picture = (1 - cover) * plate + (objects + difference)
    else:
        occluder, front = hides
        share = occluder[..., None].astype(np.float64)
        # What is in front stays; of what is behind, plate − front, the objects hide their share.
        hidden = cover * (plate - front)
        picture = plate - hidden + (1 - share) * (objects + difference)
        touched &= share < 1
    below = int(np.count_nonzero(((picture < smallest) & touched).any(-1)))
    return np.where(touched, np.maximum(picture, 0), plate).astype(np.float32), below
