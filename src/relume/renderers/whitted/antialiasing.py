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
    points = np.empty((height + 1, width + 1, 2))
    points[..., 0], points[..., 1] = np.arange(left, right + 1.0), np.arange(top, bottom + 1.0)[:, None]
    values, keys, counts = trace(points.reshape(-1, 2))
    # The corners of the right and the lower border belong to the last pixels.
    of_corners = counts.reshape(height + 1, width + 1)
    rays = of_corners[:-1, :-1].copy()
    rays[-1] += of_corners[-1, :-1]
    rays[:, -1] += of_corners[:-1, -1]
    rays[-1, -1] += of_corners[-1, -1]
    rays = rays.reshape(-1)
    corner = (np.arange(height, dtype=np.int32)[:, None] * (width + 1) + np.arange(width, dtype=np.int32)).reshape(
        -1, 1
    )
    squares = corner + np.array([0, 1, width + 1, width + 2], np.int32)
    # Where a square begins, in units of the finest one's side, and which pixel it belongs to.
    place = np.empty((height, width, 3), np.int32)
    place[..., 0], place[..., 1] = np.arange(width) << levels, np.arange(height)[:, None] << levels
    place[..., 2] = np.arange(height * width).reshape(height, width)
    place = place.reshape(-1, 3)
    marks = _marked(small, region)
    # Most pixels stay whole and are done at once; of the others sums are taken, in double precision.
    pixels = np.zeros((height * width, values.shape[1]), np.float32)
    sums, whose, halved = pixels, np.arange(height * width, dtype=np.int32), None
    for level in range(levels + 1):
        size = 1 << (levels - level)
        split = np.zeros(len(squares), bool)
        if level < levels and len(small.radius):
            _holding(squares, place, values, size / 2**levels, 2.0**-levels, *marks, split)
        _settle(
            squares, values, keys, level < how.subdivisions, how.tolerance, reference, split, sums,
            whose, place, 4.0**-level,
        )  # fmt: skip
        if halved is None:
            halved = np.flatnonzero(split)
            sums, whose[halved] = np.zeros((len(halved), values.shape[1])), np.arange(len(halved), dtype=np.int32)
        count = int(np.count_nonzero(split))
        if not count:
            break
        # Five new corners each: four halve the sides, which neighbours share, and one is in the middle.
        squares, place, at, asked = _halved(
            squares, place, split, count, size // 2, len(values), left, top, 2.0**-levels
        )
        more_values, more_keys, more_counts = trace(at)
        _pay(rays, asked, more_counts)
        values, keys = np.concatenate([values, more_values]), np.concatenate([keys, more_keys])
    pixels[halved] = sums
    return pixels.reshape(height, width, -1), rays.reshape(height, width)


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
def _settle(squares, values, keys, halving, tolerance, reference, split, sums, whose, place, area):
    """Which squares are to be halved besides those that are said to be, for their corners differ in intensity or in
    what they saw; the mean of the corners of each that stays whole, weighed by its area, goes to its pixel's sums."""
    for i in range(len(squares)):
        a, b, c, d = squares[i, 0], squares[i, 1], squares[i, 2], squares[i, 3]
        if halving:
            # A stripe of a texture may lie between corners of one colour: what they saw differs even so.
            differs = keys[a] != keys[b] or keys[a] != keys[c] or keys[a] != keys[d]
            for channel in range(3):
                low = min(values[a, channel], values[b, channel], values[c, channel], values[d, channel])
                high = max(values[a, channel], values[b, channel], values[c, channel], values[d, channel])
                differs |= high - low > tolerance * (high + reference)
            split[i] |= differs
        if not split[i]:
            row = whose[place[i, 2]]
            for channel in range(values.shape[1]):
                corners = values[a, channel] + values[b, channel] + values[c, channel] + values[d, channel]
                sums[row, channel] += 0.25 * area * corners


@exact_kernel
def _pay(rays, asked, counts):
    """Add the rays of samples to those of the pixels that asked for them."""
    for i in range(len(asked)):
        rays[asked[i]] += counts[i]


@exact_kernel
def _halved(squares, place, split, count, half, first, left, top, unit):
    """The four quarters of each of `count` squares that are halved, their corners and where they begin; the samples
    that these ask for, numbered from `first` on: pixel coordinates (M, 2), and the pixel that asked."""
    slots = 16
    while slots < 8 * count:
        slots *= 2
    table = np.full(slots, -1, np.int32)
    quarters, places = np.empty((4 * count, 4), np.int32), np.empty((4 * count, 3), np.int32)
    needed, asked = np.empty((5 * count, 2), np.int32), np.empty(5 * count, np.int32)
    fresh = np.empty(5, np.int32)
    done, samples = 0, 0
    for i in range(len(squares)):
        if not split[i]:
            continue
        x, y = place[i, 0], place[i, 1]
        # Above, left, in the middle, right, below.
        for k, (right, down) in enumerate(((1, 0), (0, 1), (1, 1), (2, 1), (1, 2))):
            column, row = np.int32(x + right * half), np.int32(y + down * half)
            slot = _slot(column, row, slots)
            while table[slot] >= 0 and (needed[table[slot], 0] != column or needed[table[slot], 1] != row):
                slot = (slot + 1) & (slots - 1)
            if table[slot] < 0:
                table[slot] = samples
                needed[samples, 0], needed[samples, 1], asked[samples] = column, row, place[i, 2]
                samples += 1
            fresh[k] = first + table[slot]
        corners = (
            (squares[i, 0], fresh[0], fresh[1], fresh[2]), (fresh[0], squares[i, 1], fresh[2], fresh[3]),
            (fresh[1], fresh[2], squares[i, 2], fresh[4]), (fresh[2], fresh[3], fresh[4], squares[i, 3]),
        )  # fmt: skip
        for k in range(4):
            quarter = 4 * done + k
            quarters[quarter, 0], quarters[quarter, 1], quarters[quarter, 2], quarters[quarter, 3] = corners[k]
            places[quarter, 0], places[quarter, 1] = x + (k & 1) * half, y + (k >> 1) * half
            places[quarter, 2] = place[i, 2]
        done += 1
    at = np.empty((samples, 2))
    for k in range(samples):
        at[k, 0], at[k, 1] = needed[k, 0] * unit + left, needed[k, 1] * unit + top
    return quarters, places, at, asked[:samples].copy()


@exact_small
def _slot(column, row, slots):
    mixed = np.uint64(column) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(row) * np.uint64(0xC2B2AE3D27D4EB4F)
    return np.int64((mixed ^ (mixed >> np.uint64(29))) & np.uint64(slots - 1))


@exact_kernel
def write_layers(means, begin, radiance, matte, depth, normal, albedo):
    """The channels of pixels (H, W, CHANNELS) as a picture's layers, from a row on: what is seen is weighed by how much
    of a pixel anything covers."""
    for row in range(means.shape[0]):
        for column in range(means.shape[1]):
            mean, there = means[row, column], begin + row
            hit = max(mean[4], np.float32(1e-30))
            matte[there, column], depth[there, column] = mean[3], mean[5] / hit
            for k in range(3):
                radiance[there, column, k] = mean[k]
                normal[there, column, k], albedo[there, column, k] = mean[6 + k] / hit, mean[9 + k] / hit
