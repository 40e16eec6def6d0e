"""Holes in environment maps filled from their rims, by distance on the sphere."""

from __future__ import annotations

import numpy as np

from relume.sphere.mappings.mapping import LatLong, continued_round, pixel_points

AT_ONCE = 4_000_000
"""Pairs of pixels that are held at a time."""


def mean_by_distance(
    targets: np.ndarray, sources: np.ndarray, values: np.ndarray, *, power: int, shares: np.ndarray | None = None
) -> np.ndarray:
    """The mean of `values` at each target, weighted by 1/distance^power on the sphere (Shepard 1968): (M, C) float64.

    targets, sources : (M, 3), (N, 3) unit directions
    values : (N, C) at the sources
    power : even
    shares : (N,) what each source stands for; all alike unless given
    """
    values = np.asarray(values, np.float64)
    found = np.empty((len(targets), values.shape[1]))
    step = max(1, AT_ONCE // max(len(sources), 1))
    for start in range(0, len(targets), step):
        part = slice(start, start + step)
        squared = np.maximum(2 - 2 * targets[part] @ sources.T, 1e-12)
        weights = (1.0 if shares is None else shares) / squared ** (power // 2)
        found[part] = weights @ values / weights.sum(1, keepdims=True)
    return found


def continued(radiance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """An equirectangular map (H, 2H, 3) whose unknown pixels continue the known ones; `known` is (H, 2H) bool.

    Every unknown pixel takes the mean of the rim of known ones weighted by rim length over squared distance. In a
    round patch, the blind cone of a single view of a ball, that is the harmonic continuation of its rim (Poisson's
    integral, which stereographic projection carries to the sphere): without streaks, level with the rim, nowhere
    beyond its extremes.
    """
    from scipy.ndimage import binary_dilation

    if known.all() or not known.any():
        return radiance
    # The rows beside the poles touch each other across them.
    around = continued_round(known)
    rim = (binary_dilation(~around, np.ones((3, 3), bool)) & around)[1:-1, 1:-1]
    directions = LatLong().directions(pixel_points(LatLong(), len(radiance)))
    # A pixel near a pole is narrow, so it stands for less of the rim.
    length = np.sqrt(LatLong().solid_angles(len(radiance)))[rim]
    result = np.array(radiance, np.float64)
    result[~known] = mean_by_distance(directions[~known], directions[rim], radiance[rim], power=2, shares=length)
    return result
