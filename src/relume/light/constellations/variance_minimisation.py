"""Variance minimisation: rectangles cut where the light of both parts is least spread (Viriyothai & Debevec 2009)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.light.constellations.cells import Cells
from relume.light.constellations.rectangles import Rectangle, cut, running_sums, within


@dataclass(frozen=True)
class VarianceMinimisation:
    """Cuts, across or along, that leave the least Σ Y |ω − centroid|²; bright sources are not cut through.

    The poster takes the cut whose larger variance is least and cuts all regions equally often; here it is the sum of
    both variances, and the region of the largest variance is next, which suits any number of lights. Distances are
    chords in space, so that nothing is distorted near the poles.
    """

    def regions(self, cells: Cells, count: int) -> np.ndarray:
        """The number of each cell's region, (R, C) int32, −1 where there is no light."""
        table = running_sums(np.concatenate([cells.luminance[..., None], cells.moment], axis=-1))

        def priority(rectangle: Rectangle) -> float:
            return float(_variance(within(table, rectangle)))

        return cut(cells, table[..., 0], count, priority, lambda rectangle: _halves(table, rectangle))


def _halves(table: np.ndarray, rectangle: Rectangle) -> tuple[Rectangle, Rectangle]:
    """The two parts of a rectangle with the least sum of variances, of all cuts both ways."""
    top, bottom, left, right = rectangle
    start = table[top, left]
    upper = table[top + 1 : bottom, right] - table[top + 1 : bottom, left] - table[top, right] + start
    before = table[bottom, left + 1 : right] - table[top, left + 1 : right] - table[bottom, left] + start
    parts = np.concatenate([upper, before])
    left_over = _variance(parts) + _variance(within(table, rectangle) - parts)
    best = int(np.argmin(left_over))
    if best < len(upper):
        middle = top + 1 + best
        return (top, middle, left, right), (middle, bottom, left, right)
    middle = left + 1 + best - len(upper)
    return (top, bottom, left, middle), (top, bottom, middle, right)


def _variance(sums: np.ndarray) -> np.ndarray:
    """∫ Y |ω − centroid|² dω from ∫ Y dω and ∫ Y ω dω, (…, 4): what |∫ Y ω dω|² leaves of (∫ Y dω)²."""
    strength, moment = np.maximum(sums[..., 0], 0), sums[..., 1:]
    return np.maximum(strength - np.sum(moment * moment, axis=-1) / np.maximum(strength, 1e-300), 0)
