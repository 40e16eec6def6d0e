"""Rectangles of cells, cut in two again and again: what median cut and variance minimisation have in common."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np

from relume.light.constellations.cells import Cells

DARK = 1e-12
"""A rectangle with less than this share of the light may owe it to the rounding of running sums: it is looked at."""

Rectangle = tuple[int, int, int, int]
"""Top, bottom, left and right: rows and columns from and up to, the latter excluded."""


def cut(
    cells: Cells,
    table: np.ndarray,
    count: int,
    priority: Callable[[Rectangle], float],
    halves: Callable[[Rectangle], tuple[Rectangle, Rectangle]],
) -> np.ndarray:
    """Cut the grid until there are `count` rectangles with light: each cell's number, (R, C) int32, −1 where black.

    table : running sums of luminance (`running_sums`)
    priority : the rectangle of the largest is cut next
    halves : what it is cut into
    """
    rows, columns = cells.areas.shape

    def black(rectangle: Rectangle) -> bool:
        top, bottom, left, right = rectangle
        little = within(table, rectangle) <= DARK * table[-1, -1]
        return bool(little) and not cells.flux[top:bottom, left:right].any()

    def entry(rectangle: Rectangle) -> tuple[float, Rectangle]:
        return -priority(rectangle), rectangle

    whole = (0, rows, 0, columns)
    waiting, done = [] if black(whole) else [entry(whole)], []
    while waiting and len(waiting) + len(done) < count:
        first = heapq.heappop(waiting)
        top, bottom, left, right = first[1]
        if bottom - top == right - left == 1:
            done.append(first)
            continue
        for half in halves(first[1]):
            if not black(half):
                heapq.heappush(waiting, entry(half))
    labels = np.full((rows, columns), -1, np.int32)
    for number, (_, (top, bottom, left, right)) in enumerate(sorted(waiting + done)):
        labels[top:bottom, left:right] = number
    return labels


def running_sums(values: np.ndarray) -> np.ndarray:
    """The summed-area table of (R, C, …), (R + 1, C + 1, …): entry (i, j) is of rows < i and columns < j."""
    rows, columns = values.shape[:2]
    table = np.zeros((rows + 1, columns + 1, *values.shape[2:]))
    np.cumsum(values, axis=1, out=table[1:, 1:])
    np.cumsum(table[1:, 1:], axis=0, out=table[1:, 1:])
    return table


def within(table: np.ndarray, rectangle: Rectangle) -> np.ndarray:
    """The sum over a rectangle, never below 0 by rounding where it is a number."""
    top, bottom, left, right = rectangle
    return table[bottom, right] - table[top, right] - table[bottom, left] + table[top, left]
