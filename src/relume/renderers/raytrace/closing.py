"""What closes a surface of triangles, and how its triangles face.

A ray that starts outside a closed surface leaves it as often as it enters it, so that the triangles of one side are
enough to find whether it meets any. Edges that are passed more often one way than the other are the rims of holes; a
cone over a rim closes it, whatever the holes look like, since rims are closed paths.
"""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-6
"""Of a sine, by which normals are taken to be off."""
_TURN = 0.08
"""Of the triangles' extent, that a difference of 1 between unit normals counts as."""


def closing_triangles(corners: np.ndarray) -> np.ndarray:
    """Triangles (Q, 9) float32 that close P others: every edge is then passed as often one way as the other.

    corners : (P, 9) float32, metres; corners in one place are one
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    ends = corners.reshape(-1, 3) + np.float32(0)
    order = np.lexsort(ends.T)
    new = np.any(np.diff(ends[order], axis=0, prepend=np.nan) != 0, axis=1)
    place = np.empty(len(ends), np.int64)
    place[order] = np.cumsum(new) - 1
    places, count = ends[order[new]], int(new.sum())
    # An edge counts upwards from its lower end to its higher one, and downwards the other way.
    begin, end = place.reshape(-1, 3), np.roll(place.reshape(-1, 3), -1, axis=1)
    edges, edge = np.unique(np.minimum(begin, end) * count + np.maximum(begin, end), return_inverse=True)
    passed = np.bincount(edge.ravel(), np.sign(end - begin).ravel(), len(edges)).astype(int)
    often = np.abs(passed)
    low, high = np.repeat(edges // count, often), np.repeat(edges % count, often)
    if not len(low):
        return np.zeros((0, 9), np.float32)
    first, second = np.where(np.repeat(passed, often) > 0, (high, low), (low, high))
    # One tip a rim, in its middle.
    rim = connected_components(coo_matrix((np.ones(len(low)), (low, high)), (count, count)), directed=False)[1][low]
    tips = [np.bincount(rim, places[first, axis]) / np.maximum(np.bincount(rim), 1) for axis in range(3)]
    tip = np.stack(tips, axis=1)[rim].astype(np.float32)
    return np.concatenate([places[first], places[second], tip], axis=1)


def unit_normals(corners: np.ndarray) -> np.ndarray:
    """(P, 3) float64 of triangles (P, 9) with an area, counter-clockwise from their outer side."""
    a, b, c = corners.astype(np.float64).reshape(-1, 3, 3).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def alike(corners: np.ndarray, size: int) -> np.ndarray:
    """Triangles (P, 9) in an order (P,) in which each `size` in a row are near each other and face alike."""
    middles = corners.astype(np.float64).reshape(-1, 3, 3).mean(axis=1)
    extent = np.linalg.norm(np.ptp(middles, axis=0)) if len(middles) else 0.0
    places = np.concatenate([middles, _TURN * extent * unit_normals(corners)], axis=1)
    order, waiting = np.arange(len(places)), [(0, len(places))]
    while waiting:
        begin, end = waiting.pop()
        if end - begin <= size:
            continue
        part = order[begin:end]
        own = places[part]
        half = size * -(-(end - begin) // (2 * size))
        order[begin:end] = part[np.argpartition(own[:, np.argmax(np.ptp(own, axis=0))], half)]
        waiting += [(begin, begin + half), (begin + half, end)]
    return order


def facing_cones(corners: np.ndarray, size: int) -> np.ndarray:
    """How each `size` triangles in a row face: (C, 4) float64, an axis, and the cosine to it above which a direction
    is on the outer side of all of them; 2 where there is none.

    corners : (P, 9) of triangles with an area
    """
    normals = unit_normals(corners)
    begins = np.arange(0, len(normals), size)
    axes = np.add.reduceat(normals, begins)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-12)
    cosines = np.einsum("ij,ij->i", normals, np.repeat(axes, size, axis=0)[: len(normals)])
    least = np.minimum.reduceat(cosines, begins)
    sines = np.sqrt(np.maximum(1 - least**2, 0)) + ROUNDING
    return np.concatenate([axes, np.where(least > 0, sines, 2)[:, None]], axis=1)
