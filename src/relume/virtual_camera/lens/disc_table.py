"""Discs of confusion of every size that a picture needs, as what changes along their rows.

A disc is spread by adding its changes where they fall and summing each row once, for all discs together: the cost of
a disc is that of its rim, not of its area (Kosloff, Tao & Barsky 2009, who spread rectangles so).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.kernel import exact_kernel
from relume.virtual_camera.lens.blades import Blades

FINE = 8
"""Sizes a pixel of radius, up to EVEN pixels: the nearest is within a sixteenth of a pixel."""
EVEN = 16.0
"""Pixels of radius from which sizes are a constant ratio apart, 1/128: steps below what a soft rim shows."""

SLANT = 0.5
"""How much larger than its own radius, beside a pixel, the discs of a surface may be that a disc covers."""


@dataclass(frozen=True, eq=False)
class DiscTable:
    """Discs by size; sizes count from `lowest` on and are negative before the focus, where the opening is upside down.

    first : (sizes + 1,) int64, where the changes of a size begin
    down, right : (changes,) int32, row and column from the disc's middle pixel
    change : (changes,) float64, how much more the pixel has than the one to its left; the disc's sum is 1
    reach : (sizes,) int32, rows and columns within which the disc lies, on each side of the middle
    deepest : (sizes,) int32, the place in the table of the largest size that one surface may have within a disc
    """

    lowest: int
    first: np.ndarray
    down: np.ndarray
    right: np.ndarray
    change: np.ndarray
    reach: np.ndarray
    deepest: np.ndarray

    @property
    def widest(self) -> int:
        """The farthest that a disc reaches, pixels."""
        return int(self.reach.max())


def size_of(radius: np.ndarray) -> np.ndarray:
    """The nearest size, int16, of radii in pixels; both are below 0 before the focus."""
    far = np.abs(radius)
    steps = np.where(far <= EVEN, FINE * far, FINE * EVEN * (1 + np.log(np.maximum(far, EVEN) / EVEN)))
    return (np.sign(radius) * np.rint(steps)).astype(np.int16)


def radius_of(size: np.ndarray) -> np.ndarray:
    """The radius in pixels, float64, of sizes: `size_of` the other way."""
    steps = np.abs(size).astype(np.float64)
    far = np.where(steps <= FINE * EVEN, steps / FINE, EVEN * np.exp(np.maximum(steps / (FINE * EVEN), 1) - 1))
    return np.sign(size) * far


def disc_table(blades: Blades, lowest: int, highest: int) -> DiscTable:
    """The discs of the sizes `lowest` to `highest`, each of its pixels' areas exactly."""
    outline = blades.outline()
    first, down, right, change, reach = [0], [], [], [], []
    radii = radius_of(np.arange(lowest, highest + 1))
    slanted = radii + 1 + SLANT * np.abs(radii)
    for radius in radii:
        disc = _changes(outline * radius)
        middle = disc.shape[0] // 2
        rows, columns = np.nonzero(disc)
        first.append(first[-1] + rows.size)
        down.append(rows - middle)
        right.append(columns - middle)
        change.append(disc[rows, columns])
        reach.append(middle)
    return DiscTable(
        lowest,
        np.array(first, np.int64),
        np.concatenate(down).astype(np.int32),
        np.concatenate(right).astype(np.int32),
        np.concatenate(change),
        np.array(reach, np.int32),
        np.minimum(size_of(slanted), highest).astype(np.int32) - lowest,
    )


def _changes(outline: np.ndarray) -> np.ndarray:
    """The changes along rows (2n + 1, 2n + 3) of a shape's share of each pixel, its origin in the middle pixel."""
    reach = int(np.floor(np.abs(outline).max() + 0.5))
    changes = np.zeros((2 * reach + 1, 2 * reach + 3))
    if reach == 0:
        changes[0, :2] = 1, -1
        return changes
    _trace(outline[:, 0] + reach + 0.5, outline[:, 1] + reach + 0.5, changes)
    changes[np.abs(changes) < 1e-15] = 0
    return changes / np.cumsum(changes, axis=1).sum()


@exact_kernel
def _trace(x, y, changes):
    """Add the changes along rows of the area inside a closed line, whichever way it runs round.

    Over the height of a row that an edge passes, what lies right of it covers the pixels left of column t with
    H(t) = mean of max(t − x, 0). A pixel's share is H(c + 1) − H(c), and its change the second difference of H.
    """
    for i in range(x.size):
        j = i + 1 if i + 1 < x.size else 0
        if y[i] == y[j]:
            continue
        way = 1.0 if y[j] > y[i] else -1.0
        top, bottom = min(y[i], y[j]), max(y[i], y[j])
        slope = (x[j] - x[i]) / (y[j] - y[i])
        for row in range(int(np.floor(top)), int(np.ceil(bottom))):
            begin, end = max(top, float(row)), min(bottom, row + 1.0)
            one, other = x[i] + (begin - y[i]) * slope, x[i] + (end - y[i]) * slope
            left, right = min(one, other), max(one, other)
            for column in range(int(np.floor(left)), int(np.floor(right)) + 2):
                second = _right_of(column + 1.0, left, right) - 2 * _right_of(float(column), left, right)
                second += _right_of(column - 1.0, left, right)
                changes[row, column] += way * (end - begin) * second


@exact_kernel
def _right_of(t, left, right):
    """The mean of max(t − x, 0) over x from `left` to `right`."""
    if t <= left:
        return 0.0
    if t >= right:
        return t - (left + right) / 2
    return (t - left) ** 2 / (2 * (right - left))
