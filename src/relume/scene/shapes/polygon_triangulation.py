"""A flat polygon cut into triangles, ear by ear (Meisters 1975)."""

from __future__ import annotations

import numpy as np


def triangles_of(points: np.ndarray) -> np.ndarray:
    """Triangles (M, 3) int32, counter-clockwise, that fill a polygon which need not be convex.

    points : (N, 2), counter-clockwise; those between two others on a line, and repeated ones, may be among them
    Raises ValueError where no ear is left, which only a polygon that crosses itself comes to.
    """
    points = np.asarray(points, np.float64)
    # Twice an area that rounding may take for one.
    nothing = 1e-14 * np.ptp(points, axis=0).max() ** 2
    left, triangles = list(range(len(points))), []
    while len(left) > 2:
        ring = np.array(left)
        before, after = np.roll(ring, 1), np.roll(ring, -1)
        areas = _twice_areas(points[before], points[ring], points[after])
        flat = np.flatnonzero(np.abs(areas) <= nothing)
        if flat.size:
            del left[int(flat[0])]
            continue
        # The widest ear first, so that slivers come last, where nothing else is left.
        shapely = [i for i in np.argsort(-_sines(points[before], points[ring], points[after])) if areas[i] > 0]
        ear = next((i for i in shapely if _is_ear(points, ring, int(i))), None)
        if ear is None:
            raise ValueError("its outline crosses itself; split it into polygons that do not")
        triangles.append((before[ear], ring[ear], after[ear]))
        del left[int(ear)]
    return np.array(triangles, np.int32).reshape(-1, 3)


def _is_ear(points: np.ndarray, ring: np.ndarray, i: int) -> bool:
    """Whether no other vertex lies in the triangle of the vertices i − 1, i and i + 1, or on its new side."""
    corners = points[ring[i - 1]], points[ring[i]], points[ring[(i + 1) % len(ring)]]
    a, b, c = corners
    # A vertex where a corner is may be the same one repeated, and bars nothing.
    others = points[ring][~np.any([np.all(points[ring] == corner, axis=-1) for corner in corners], axis=0)]
    inside = (_twice_areas(a, b, others) >= 0) & (_twice_areas(b, c, others) >= 0) & (_twice_areas(c, a, others) >= 0)
    return not np.any(inside)


def _twice_areas(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Of triangles, positive where they are counter-clockwise."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _sines(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """A measure of how far triangles are from slivers: twice the area by the longest side squared."""
    sides = [np.sum((p - q) ** 2, axis=-1) for p, q in ((a, b), (b, c), (c, a))]
    return _twice_areas(a, b, c) / np.maximum(np.max(sides, axis=0), 1e-300)
