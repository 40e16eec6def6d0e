"""Bilinear look-up in lat-long tables inside kernels: `EnvironmentMap.lookup`, some 20 times faster.

Tables are padded by one entry on every side (`padded`), round the seam and over the poles, so that no look-up asks
where it is, and by a fourth channel, so that the processor works on all channels at once.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined
from relume.sphere.mappings.mapping import continued_round


def padded(radiance: np.ndarray) -> np.ndarray:
    """A lat-long table (H, 2H, 3) with its border continued round the seam and over the poles: (H + 2, 2H + 2, 4)."""
    return in_fours(continued_round(radiance))


def in_fours(values: np.ndarray) -> np.ndarray:
    """Three channels (…, 3) with a fourth of zeros, float32."""
    return np.concatenate([values, np.zeros((*values.shape[:-1], 1))], axis=-1, dtype=np.float32)


@inlined
def arctangent2(y, x):
    """atan2 in float32 to 4e-7 rad, without a branch: a minimax polynomial on [0, 1] and its reflections."""
    across, along = abs(x), abs(y)
    large, small = max(across, along), min(across, along)
    ratio = small / max(large, np.float32(1e-30))
    square = ratio * ratio
    series = np.float32(0.0218629397) - np.float32(0.00405456205) * square
    series = np.float32(-0.0559123013) + square * series
    series = np.float32(0.0964219552) + square * series
    series = np.float32(-0.139086289) + square * series
    series = np.float32(0.199465655) + square * series
    series = np.float32(-0.333298608) + square * series
    series = np.float32(0.999999336) + square * series
    angle = ratio * series
    angle = np.float32(np.pi / 2) - angle if along > across else angle
    angle = np.float32(np.pi) - angle if x < 0 else angle
    return -angle if y < 0 else angle


@inlined
def polar_point(x, y, z):
    """Image point (u, v) of a direction in a lat-long map; it need not be of unit length."""
    u = np.float32(0.5) + arctangent2(x, -z) * np.float32(0.5 / np.pi)
    v = arctangent2(np.sqrt(x * x + z * z), y) * np.float32(1 / np.pi)
    return u, v


@inlined
def cell(table, u, v):
    """The upper left entry of the four round an image point, and the point's place among them."""
    x = u * np.float32(table.shape[1] - 2) + np.float32(0.5)
    y = v * np.float32(table.shape[0] - 2) + np.float32(0.5)
    # Rounding may put a point half an entry past the border, never more.
    column = min(max(int(x), 0), table.shape[1] - 2)
    row = min(max(int(y), 0), table.shape[0] - 2)
    return row, column, y - np.float32(row), x - np.float32(column)


@inlined
def looked_up(entries, begin, rows, u, v):
    """The four channels of a padded table at an image point, bilinear between four entries.

    entries : the table, or several one behind the other, flat
    begin : where it begins
    rows : its height without the padding
    """
    x = u * np.float32(2 * rows) + np.float32(0.5)
    y = v * np.float32(rows) + np.float32(0.5)
    # Unsigned, so that no index is asked whether it counts from the end.
    column, row = np.uint32(min(max(int(x), 0), 2 * rows)), np.uint32(min(max(int(y), 0), rows))
    right, down = x - np.float32(column), y - np.float32(row)
    left, above = np.float32(1) - right, np.float32(1) - down
    upper = np.uint64(begin) + (row * np.uint64(2 * rows + 2) + column) * np.uint64(4)
    lower = upper + np.uint64(2 * rows + 2) * np.uint64(4)
    a, b, c, d = left * above, right * above, left * down, right * down
    o1, o2, o3, o4 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
    o5, o6, o7 = np.uint64(5), np.uint64(6), np.uint64(7)
    return (
        entries[upper] * a + entries[upper + o4] * b + entries[lower] * c + entries[lower + o4] * d,
        entries[upper + o1] * a + entries[upper + o5] * b + entries[lower + o1] * c + entries[lower + o5] * d,
        entries[upper + o2] * a + entries[upper + o6] * b + entries[lower + o2] * c + entries[lower + o6] * d,
        entries[upper + o3] * a + entries[upper + o7] * b + entries[lower + o3] * c + entries[lower + o7] * d,
    )
