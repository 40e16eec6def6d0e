"""Antialiasing as Whitted does it: squares with samples at their corners, halved where these differ (1980, §3).

All pixels' corners are traced first, and shared; then all squares that are to be halved are halved together, level by
level, and what two of them ask for is traced once. A square's intensity is the mean of its corners, weighed by area.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.image.kernel import exact_kernel, exact_small

Traced = tuple[np.ndarray, np.ndarray, np.ndarray]
"""What samples are: channels (N, C) float32, what was seen first (N,) int64, and the number of rays (N,) int32."""
Tracer = Callable[[np.ndarray], Traced]
"""Samples at pixel coordinates (N, 2)."""
SMALLEST = 6
"""Halvings for the sake of a small object: one of a sixtieth of a pixel still adds its share."""


@dataclass(frozen=True)
class Antialiasing:
    """When a pixel's square is halved, and how often.

    subdivisions : halvings at most; 3 puts 81 samples into a pixel, which resolves an edge's coverage to a hundredth
    tolerance : corners may differ by this share of the brightest; with a tenth the error
        is that of a hundredth, for corners that see different things are always halved
    """

    subdivisions: int = 3
    tolerance: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= self.subdivisions <= 8 or not 0 <= self.tolerance < np.inf:
            raise ValueError(
                f"subdivisions {self.subdivisions}, tolerance {self.tolerance}; expected 0 to 8, and 0 or more"
            )


@dataclass(frozen=True, eq=False)
class Small:
    """Objects that may fall between samples: the spheres around them, as the picture shows them.

    centre : (S, 2) pixel coordinates
    radius : (S,) pixels
    """

    centre: np.ndarray
    radius: np.ndarray


def sampled(
    trace: Tracer,
    region: tuple[int, int, int, int],
    how: Antialiasing,
    small: Small,
    reference: float,
) -> tuple[np.ndarray, np.ndarray]:
    """The mean channels (H, W, C) float32 of a region's pixels, and the rays (H, W) int32 that went into each.

    trace : gives samples at pixel coordinates (N, 2)
    region : left, top, right, bottom, pixels
    small : objects that are looked for
    reference : radiance below which differences count for less
    """
    left, top, right, bottom = region
    width, height = right - left, bottom - top
    levels = max(how.subdivisions, SMALLEST if len(small.radius) else 0)
    x, y = np.meshgrid(np.arange(left, right + 1.0), np.arange(top, bottom + 1.0))
    values, keys, counts = trace(np.column_stack([x.ravel(), y.ravel()]))
    pixels = np.zeros((height * width, values.shape[1]))
    rays = np.zeros(height * width, np.int32)
    corner = (np.arange(height)[:, None] * (width + 1) + np.arange(width)).reshape(-1, 1)
    squares = (corner + np.array([0, 1, width + 1, width + 2])).astype(np.int32)
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    # Where a square begins, in units of the finest one's side, and which pixel it belongs to.
    place = np.stack([column.ravel(), row.ravel(), np.arange(height * width)], axis=1).astype(np.int64)
    place[:, :2] <<= levels
    marks = _marked(small, region)
    # The corners of the right and the lower border belong to the last pixels.
    whose = np.minimum(np.arange(height + 1), height - 1)[:, None] * width + np.minimum(np.arange(width + 1), width - 1)
    rays += np.bincount(whose.ravel(), counts, len(rays)).astype(np.int32)
    for level in range(levels + 1):
        if not len(squares):
            break
        size = 1 << (levels - level)
        split = np.zeros(len(squares), bool)
        if level < levels:
            if level < how.subdivisions:
                _differing(squares, values, keys, how.tolerance, reference, split)
            if len(small.radius):
                _holding(squares, place, values, size / 2**levels, 2.0**-levels, *marks, split)
        _add(pixels, values, squares, place[:, 2], split, 4.0**-level)
        squares, place = squares[split], place[split]
        if not len(squares):
            break
        # Five new corners each: four halve the sides, which neighbours share, and one is in the middle.
        fresh, needed = _halved(squares, place, size // 2, len(values))
        at = needed[:, :2] * 2.0**-levels + np.array([left, top])
        more_values, more_keys, more_counts = trace(at)
        rays += np.bincount(needed[:, 2], more_counts, len(rays)).astype(np.int32)
        values, keys = np.concatenate([values, more_values]), np.concatenate([keys, more_keys])
        squares, place = _quarters(squares, fresh, place, size // 2)
    return pixels.reshape(height, width, -1).astype(np.float32), rays.reshape(height, width)


def _marked(small: Small, region: tuple[int, int, int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each pixel of the region the small objects that touch it: where its list begins, the list's entries
    (centre x, y and radius from the region's corner), and how many."""
    left, top, right, bottom = region
    width, height = right - left, bottom - top
    begin = np.zeros(height * width + 1, np.int64)
    if not len(small.radius):
        return begin, np.zeros((0, 3)), begin
    centre = small.centre - np.array([left, top])
    found = []
    for (x, y), radius in zip(centre, small.radius, strict=True):
        columns = range(max(int(np.floor(x - radius)), 0), min(int(np.floor(x + radius)) + 1, width))
        rows = range(max(int(np.floor(y - radius)), 0), min(int(np.floor(y + radius)) + 1, height))
        found += [(row * width + column, x, y, radius) for row in rows for column in columns]
    table = np.array(sorted(found), np.float64).reshape(-1, 4)
    begin[1:] = np.cumsum(np.bincount(table[:, 0].astype(int), minlength=height * width))
    return begin, np.ascontiguousarray(table[:, 1:]), np.diff(begin)


@exact_kernel
def _differing(squares, values, keys, tolerance, reference, split):
    """Which squares have corners that differ, in intensity or in what they saw."""
    for i in range(len(squares)):
        a, b, c, d = squares[i, 0], squares[i, 1], squares[i, 2], squares[i, 3]
        for channel in range(3):
            low = min(values[a, channel], values[b, channel], values[c, channel], values[d, channel])
            high = max(values[a, channel], values[b, channel], values[c, channel], values[d, channel])
            split[i] |= high - low > tolerance * (high + reference)
        # A stripe of a texture may lie between corners of one colour: what they saw differs even so.
        split[i] |= keys[a] != keys[b] or keys[a] != keys[c] or keys[a] != keys[d]


@exact_kernel
def _holding(squares, place, values, size, unit, begin, entries, counts, split):
    """Which squares hold a small object that none of their corners has found, or are much larger than it is."""
    for i in range(len(squares)):
        x, y, pixel = place[i, 0] * unit, place[i, 1] * unit, place[i, 2]
        for k in range(begin[pixel], begin[pixel] + counts[pixel]):
            away_x = max(x - entries[k, 0], 0.0, entries[k, 0] - x - size)
            away_y = max(y - entries[k, 1], 0.0, entries[k, 1] - y - size)
            if away_x * away_x + away_y * away_y < entries[k, 2] ** 2 and size > 0.5 * entries[k, 2]:
                split[i] = True


@exact_kernel
def _add(pixels, values, squares, pixel, split, area):
    """Add the mean of the corners of every square that stays whole, weighed by its area."""
    for i in range(len(squares)):
        if not split[i]:
            a, b, c, d = squares[i, 0], squares[i, 1], squares[i, 2], squares[i, 3]
            for channel in range(values.shape[1]):
                corners = values[a, channel] + values[b, channel] + values[c, channel] + values[d, channel]
                pixels[pixel[i], channel] += 0.25 * area * corners


@exact_kernel
def _halved(squares, place, half, first):
    """The samples that halve squares: their numbers (N, 5) from `first` on, above, left, middle, right and below, and
    where they are with the pixel that asked (M, 3)."""
    slots = 16
    while slots < 8 * len(squares):
        slots *= 2
    table = np.full(slots, -1, np.int32)
    fresh = np.empty((len(squares), 5), np.int32)
    needed = np.empty((5 * len(squares), 3), np.int64)
    count = 0
    for i in range(len(squares)):
        x, y = place[i, 0], place[i, 1]
        for k, (right, down) in enumerate(((1, 0), (0, 1), (1, 1), (2, 1), (1, 2))):
            column, row = x + right * half, y + down * half
            slot = _slot(column, row, slots)
            while table[slot] >= 0 and (needed[table[slot], 0] != column or needed[table[slot], 1] != row):
                slot = (slot + 1) & (slots - 1)
            if table[slot] < 0:
                table[slot] = count
                needed[count, 0], needed[count, 1], needed[count, 2] = column, row, place[i, 2]
                count += 1
            fresh[i, k] = first + table[slot]
    return fresh, needed[:count].copy()


@exact_small
def _slot(column, row, slots):
    mixed = np.uint64(column) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(row) * np.uint64(0xC2B2AE3D27D4EB4F)
    return np.int64((mixed ^ (mixed >> np.uint64(29))) & np.uint64(slots - 1))


def _quarters(squares: np.ndarray, fresh: np.ndarray, place: np.ndarray, half: int) -> tuple[np.ndarray, np.ndarray]:
    """The four squares that each is made into, and where they begin."""
    # Each one's corners, among those of the old square and the five new ones.
    corners = np.array([[0, 4, 5, 6], [4, 1, 6, 7], [5, 6, 2, 8], [6, 7, 8, 3]])
    smaller = np.concatenate([squares, fresh], axis=1)[:, corners].reshape(-1, 4)
    steps = half * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    return smaller, (place[:, None] + steps).reshape(-1, 3)
