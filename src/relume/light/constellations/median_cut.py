"""Median cut: rectangles cut across their longer side where that halves their light (Debevec 2005).

Debevec cuts every rectangle equally often, so that all lights are alike strong; here the next to be cut is the one of
the largest product of strength and extent: any number of lights is possible, and a sun with a rectangle of its own is
not cut up any further while the sky is still coarse (of 64 lights under a clear sky, irradiance errs by 0.8 % instead
of 1.2 %).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.light.constellations.cells import Cells
from relume.light.constellations.rectangles import Rectangle, cut, running_sums, within


@dataclass(frozen=True)
class MedianCut:
    """Debevec's median cut, the strongest and widest rectangle next; the quickest, and good to a percent."""

    def regions(self, cells: Cells, count: int) -> np.ndarray:
        """The number of each cell's region, (R, C) int32, −1 where there is no light."""
        table = running_sums(cells.luminance)

        def priority(rectangle: Rectangle) -> float:
            return max(float(within(table, rectangle)), 0.0) * max(_extent(cells, rectangle))

        return cut(cells, table, count, priority, lambda rectangle: _halves(cells, table, rectangle))


def _halves(cells: Cells, table: np.ndarray, rectangle: Rectangle) -> tuple[Rectangle, Rectangle]:
    """A rectangle cut across its longer side, where the light of both halves is most nearly the same."""
    top, bottom, left, right = rectangle
    height, width = _extent(cells, rectangle)
    if right - left == 1 or (height >= width and bottom - top > 1):
        before = table[top + 1 : bottom, right] - table[top + 1 : bottom, left]
        start, whole = table[top, right] - table[top, left], table[bottom, right] - table[bottom, left]
        middle = top + 1 + int(np.argmin(np.abs(before - (start + whole) / 2)))
        return (top, middle, left, right), (middle, bottom, left, right)
    before = table[bottom, left + 1 : right] - table[top, left + 1 : right]
    start, whole = table[bottom, left] - table[top, left], table[bottom, right] - table[top, right]
    middle = left + 1 + int(np.argmin(np.abs(before - (start + whole) / 2)))
    return (top, bottom, left, middle), (top, bottom, middle, right)


def _extent(cells: Cells, rectangle: Rectangle) -> tuple[float, float]:
    """Radians that a rectangle is high and wide, the latter along its middle."""
    top, bottom, left, right = rectangle
    upper, lower = cells.polar[top], cells.polar[bottom]
    return lower - upper, (cells.longitude[right] - cells.longitude[left]) * float(np.sin((upper + lower) / 2))
