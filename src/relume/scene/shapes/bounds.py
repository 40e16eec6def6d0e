"""The box that holds solids, and the bounding sphere that every object keeps (Whitted 1980, §3)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from relume.scene.shapes.shapes import Mesh, Polygon, Solid, Sphere


def bounds(solids: Iterable[Solid]) -> np.ndarray:
    """The lowest and the highest corner (2, 3), metres, of the box round solids; two origins where there are none.

    Patches are held by the box of their control points.
    """
    points = [_points(solid) for solid in solids]
    every = np.concatenate(points) if points else np.zeros((1, 3))
    return np.stack([every.min(axis=0), every.max(axis=0)])


def bounding_sphere(solid: Solid) -> tuple[np.ndarray, float]:
    """The centre (3,) and radius, metres, of a sphere around an object: about the middle of its box."""
    if isinstance(solid, Sphere):
        return np.array(solid.centre, np.float64), solid.radius
    points = _points(solid)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def _points(solid: Solid) -> np.ndarray:
    if isinstance(solid, Sphere):
        return np.add.outer([-solid.radius, solid.radius], np.asarray(solid.centre, np.float64))
    points = solid.vertices if isinstance(solid, Mesh | Polygon) else solid.control
    return points.reshape(-1, 3).astype(np.float64)
