"""The cells of a stage's lights: which part of the sphere each speaks for.

A cell is all directions nearer to its light than to any other (spherical Voronoi); cells fill the sphere. On a grid
of inclination θ and azimuth their solid angles go as sin θ (Debevec et al. 2000, eq. 4).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree, QhullError, SphericalVoronoi

CLOSEST = 1e-5
"""Radians: lights nearer to each other are one."""
_SAMPLES = 1 << 20


def voronoi_solid_angles(directions: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Steradians (N,) of the cells of lights in unit directions (N, 3); they sum to 4π.

    Exact polygons, or lunes for lights on one circle; where neither fills the sphere, counted among a million
    directions, to 1e-3.

    names : what a message calls the lights
    Raises ValueError for two lights in one direction: half a cell each would hide a mistake.
    """
    if len(directions) == 1:
        return np.array([4 * np.pi])
    tree = KDTree(directions)
    for first, second in sorted(tree.query_pairs(CLOSEST)):
        raise ValueError(f'the lights "{names[first]}" and "{names[second]}" have one direction; leave one out')
    areas = _lunes(directions)
    if areas is None:
        try:
            areas = SphericalVoronoi(directions, threshold=CLOSEST / 10).calculate_areas()
        except (QhullError, ValueError):  # nearly on one circle
            areas = None
    if areas is None or not np.isclose(areas.sum(), 4 * np.pi, rtol=1e-6) or areas.min() <= 0:
        areas = np.bincount(tree.query(even_directions(_SAMPLES))[1], minlength=len(directions)) + 1e-9
    return areas * (4 * np.pi / areas.sum())


def _lunes(directions: np.ndarray) -> np.ndarray | None:
    """Steradians (N,) of the cells of lights on one circle, as any three are; None where the lights are on none.

    All planes half-way between two of them hold the circle's axis: each cell reaches from one of its poles to the
    other, as wide as half the way to the light on either side, and a lune's solid angle is twice its width.
    """
    middle = directions.mean(axis=0)
    offsets = directions - middle
    axis, down, across = np.linalg.eigh(offsets.T @ offsets)[1].T
    if np.abs(offsets @ axis).max() > CLOSEST / 10:
        return None
    centre = axis * (middle @ axis)
    azimuth = np.arctan2((directions - centre) @ down, (directions - centre) @ across)
    order = np.argsort(azimuth)
    gaps = np.diff(azimuth[order], append=azimuth[order[0]] + 2 * np.pi)
    areas = np.empty(len(directions))
    areas[order] = gaps + np.roll(gaps, 1)
    return areas


def even_directions(count: int, radius: float = np.pi) -> np.ndarray:
    """Unit directions (count, 3) spread evenly over the sphere, on a spiral with golden turns.

    radius : radians, of the cap about +Y that they are spread over instead
    """
    index = np.arange(count)
    height = 1 - (1 - np.cos(radius)) * (index + 0.5) / count
    turn = np.pi * (3 - np.sqrt(5)) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)
