"""Bilinear look-up in lat-long tables inside kernels: `IlluminationMap.look_up`, some 20 times faster.

Tables are padded by one entry on every side (`padded`), round the seam and over the poles, so that no look-up asks
where it is.
"""

from __future__ import annotations

import numpy as np

from relume._kernel import inlined


def padded(radiance: np.ndarray) -> np.ndarray:
    """A lat-long table (H, 2H, C) with its border continued round the seam and over the poles, float32."""
    half = radiance.shape[1] // 2
    tall = np.concatenate([np.roll(radiance[:1], half, 1), radiance, np.roll(radiance[-1:], half, 1)])
    return np.ascontiguousarray(np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1), np.float32)


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
def blended(table, row, column, down, right, channel):
    """Bilinear between four entries."""
    upper = table[row, column, channel] * (np.float32(1) - right) + table[row, column + 1, channel] * right
    lower = table[row + 1, column, channel] * (np.float32(1) - right) + table[row + 1, column + 1, channel] * right
    return upper * (np.float32(1) - down) + lower * down
