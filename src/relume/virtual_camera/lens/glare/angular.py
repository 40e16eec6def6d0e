"""Patterns over half a turn: rays about a point, seen through pixels that are as wide as they are far apart."""

from __future__ import annotations

import numpy as np


def waves_of(angles: int) -> np.ndarray:
    """(angles // 2 + 1,) waves per radian, times 2π, of the transform of a pattern over half a turn: 0, 2, 4, …"""
    return 2.0 * np.arange(angles // 2 + 1)


def seen_by_pixels(pattern: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """A pattern (levels, angles) averaged over the angle 1 / r that a pixel at distance r (levels,) covers.

    Means stay; the point itself, which lies in every direction, sees the mean alone.
    """
    width = 1 / np.maximum(distances, 1e-3)[:, None]
    waves = np.fft.rfft(pattern, axis=1)
    waves *= np.sinc(waves_of(pattern.shape[1]) * width / (2 * np.pi))
    waves[distances < 0.5, 1:] = 0
    return np.maximum(np.fft.irfft(waves, pattern.shape[1], axis=1), 0)


def pattern_at(pattern: np.ndarray, reach: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A pattern (levels, angles), its levels at equal steps of r^¼ up to `reach`, at pixels x right and y down."""
    levels, angles = pattern.shape
    height = (np.hypot(x, y) / reach) ** 0.25 * (levels - 1)
    level = np.minimum(height.astype(np.intp), levels - 2)
    place = np.arctan2(y, x) % np.pi * (angles / np.pi)
    bin_ = place.astype(np.intp)
    up, across = height - level, place - bin_
    bin_, after = bin_ % angles, (bin_ + 1) % angles
    below = (1 - across) * pattern[level, bin_] + across * pattern[level, after]
    above = (1 - across) * pattern[level + 1, bin_] + across * pattern[level + 1, after]
    return (1 - up) * below + up * above
