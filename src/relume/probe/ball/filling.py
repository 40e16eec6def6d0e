"""Filling what no view of a ball saw, smoothly from round about it."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation

from relume.sphere.mappings.mapping import LatLong, pixel_points

AT_ONCE = 4_000_000
"""Pairs of pixels that are held at a time."""


def filled(radiance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """A lat-long map (H, 2H, 3) whose unknown pixels continue the known ones; `known` is (H, 2H) bool.

    Every unknown pixel takes the mean of the rim of known ones weighted by rim length over squared distance. In a
    round patch, the blind cone of a lone view, that is the harmonic continuation of its rim (Poisson's integral, which
    stereographic projection carries to the sphere): without streaks, level with the rim, nowhere beyond its extremes.
    """
    if known.all() or not known.any():
        return radiance
    tiled = np.concatenate([known[:, -1:], known, known[:, :1]], axis=1)
    # The rows beside the poles touch each other across them.
    half = known.shape[1] // 2
    tall = np.concatenate([np.roll(tiled[:1], half, 1), tiled, np.roll(tiled[-1:], half, 1)])
    rim = (binary_dilation(~tall, np.ones((3, 3), bool)) & tall)[1:-1, 1:-1] & known
    directions = LatLong().directions(pixel_points(LatLong(), len(radiance)))
    # A pixel near a pole is narrow, so it stands for less of the rim.
    length = np.sqrt(LatLong().solid_angles(len(radiance)))[rim]
    sources, light = directions[rim], radiance[rim].astype(np.float64)
    targets = directions[~known]
    found = np.empty((len(targets), 3))
    step = max(1, AT_ONCE // max(len(sources), 1))
    for start in range(0, len(targets), step):
        part = slice(start, start + step)
        squared = np.maximum(2 - 2 * targets[part] @ sources.T, 1e-12)
        weights = length / squared
        found[part] = weights @ light / weights.sum(1, keepdims=True)
    result = np.array(radiance, np.float64)
    result[~known] = found
    return result
