"""Whether a picture's radiance can be developed at all: finite, not negative, and not black everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from relume.errors import warn
from relume.image.bands import in_threads
from relume.image.radiance import RadianceMap

_BAND = 2**18
"""Values that a thread looks at a time: they stay in its cache, and no mask as large as the picture is made."""


def validate_radiance(
    picture: RadianceMap, *, repair: bool = False, name: str = "the picture", lit: bool = True
) -> RadianceMap:
    """The picture with finite radiance of 0 or more, itself where it has that already.

    repair : replaces NaN and infinity by what is about them, with a warning; else they are refused, because nobody
        knows what was there
    name : of the picture, for messages
    lit : whether a picture that is black everywhere is refused; in a sequence one may fade to black

    Negative values are taken as 0, with a warning that says how many and how low: they are colours outside Rec. 709, or
    what a filter or a subtraction left. Raises ValueError naming a pixel that is not finite, and for a picture that is
    black everywhere.
    """
    radiance = picture.radiance
    lowest, highest = _range(radiance)
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        if not repair:
            raise ValueError(_first(radiance, name))
        radiance = _repaired(radiance, name)
        lowest, highest = _range(radiance)
    if lowest < 0:
        negative = sum(_of_bands(radiance, lambda band: int(np.count_nonzero(band < 0))))
        warn(f"{name}: {negative} of {radiance.size} values are negative, as low as {lowest:.3g}; taken as 0")
        radiance = np.maximum(radiance, 0)
    if lit and not highest > 0:
        raise ValueError(f"{name} is black everywhere: there is nothing to develop; check what it was made from")
    return picture if radiance is picture.radiance else replace(picture, radiance=radiance)


def _of_bands(radiance: np.ndarray, work: Callable[[np.ndarray], Any]) -> list:
    step = max(1, _BAND // (radiance.shape[1] * 3))
    return in_threads(lambda begin, end: work(radiance[begin:end]), len(radiance), chunk=step)


def _range(radiance: np.ndarray) -> tuple[float, float]:
    """The least and the greatest value; NaN in both where any value is NaN."""
    ends = _of_bands(radiance, lambda band: (band.min(), band.max()))
    return float(np.min([low for low, _ in ends])), float(np.max([high for _, high in ends]))


def _first(radiance: np.ndarray, name: str) -> str:
    """The one line that names the first pixel that is not finite, and how many there are."""
    bad = ~np.isfinite(radiance).all(-1)
    y, x = np.argwhere(bad)[0]
    values = ", ".join(f"{value:g}" for value in radiance[y, x])
    return (
        f"{name}: the radiance at x {x}, y {y} is ({values}), and {int(bad.sum()) - 1} more pixels are not finite; "
        "repair (--repair) replaces them by what is about them"
    )


def _repaired(radiance: np.ndarray, name: str) -> np.ndarray:
    """Radiance whose NaN are the mean of the nearest known pixels, and whose infinities the largest finite value."""
    from scipy.ndimage import distance_transform_edt

    radiance = radiance.copy()
    endless = np.isposinf(radiance)
    largest = float(radiance[np.isfinite(radiance)].max(initial=0.0))
    radiance[endless] = largest
    unknown = np.asarray(~np.isfinite(radiance).all(-1))
    if unknown.all():
        raise ValueError(f"{name}: no pixel is finite; there is nothing to repair it from")
    if unknown.any():
        # The nearest known pixel, averaged with its known neighbours so that a single firefly is not spread.
        nearest = np.asarray(distance_transform_edt(unknown, return_distances=False, return_indices=True))
        rows, columns = nearest[:, unknown]
        total, count = np.zeros((len(rows), 3)), np.zeros((len(rows), 1))
        height, width = unknown.shape
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                y, x = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
                known = ~unknown[y, x, None]
                total += np.where(known, radiance[y, x], 0)
                count += known
        radiance[unknown] = total / count
    warn(
        f"{name}: {int(unknown.sum())} pixels that were no number were replaced by what is about them, and "
        f"{int(endless.any(-1).sum())} infinite ones by the largest finite value, {largest:.3g}"
    )
    return radiance
