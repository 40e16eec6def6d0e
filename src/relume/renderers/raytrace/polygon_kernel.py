"""Rays against flat polygons: where the ray meets the plane, and whether that is inside (Whitted 1980, §3).

The vertices are seen along the ray, as those of triangles are: polygons that share an edge compute the same side of it
and leave no crack, which two planes' own points would.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel
from relume.scene.shapes.shapes import Polygon


def polygon_measures(polygon: Polygon) -> np.ndarray:
    """What `meet_polygon` takes: the unit normal, the number N of vertices, the vertices: (4 + 3·N,) float64."""
    normal = polygon.area_vector / np.linalg.norm(polygon.area_vector)
    return np.concatenate([normal, [len(polygon.vertices)], np.ravel(polygon.vertices)])


def polygon_frame(polygon: Polygon) -> np.ndarray:
    """What its texture coordinates are computed from: (12,) float64.

    Its unit normal; the corner of the rectangle around it where both are 0; and the rectangle's two sides, u's along
    the first edge.
    """
    normal, vertices = polygon.area_vector / np.linalg.norm(polygon.area_vector), polygon.vertices
    edges = np.roll(vertices, -1, axis=0) - vertices
    lengths = np.linalg.norm(edges, axis=-1)
    first = edges[np.argmax(lengths > 1e-12 * lengths.max())]  # a vertex may stand twice in a row
    first = first - (first @ normal) * normal
    along = first / np.linalg.norm(first)
    across = np.cross(normal, along)
    u, v = vertices @ along, vertices @ across
    corner = u.min() * along + v.min() * across + (vertices[0] @ normal) * normal
    return np.concatenate([normal, corner, np.ptp(u) * along, np.ptp(v) * across])


@exact_kernel
def meet_polygon(measures, i, axes, eye, shear, origin, direction):
    """The distance of a polygon's plane along the ray; ∞ outside the polygon. Its edges belong to it.

    i : where its measures begin
    axes, eye, shear : as for a triangle
    """
    x, y, z = np.int64(axes[0]), np.int64(axes[1]), np.int64(axes[2])
    base = i + 4
    end = base + 3 * int(measures[i + 3])
    slope = measures[i] * direction[0] + measures[i + 1] * direction[1] + measures[i + 2] * direction[2]
    if slope == 0:
        return np.inf
    bz = measures[end - 3 + z] - eye[2]
    bx, by = measures[end - 3 + x] - eye[0] - shear[0] * bz, measures[end - 3 + y] - eye[1] - shear[1] * bz
    inside = False
    for k in range(base, end, 3):
        ax, ay = bx, by
        bz = measures[k + z] - eye[2]
        bx, by = measures[k + x] - eye[0] - shear[0] * bz, measures[k + y] - eye[1] - shear[1] * bz
        # A neighbour computes the same two products for the edge they share, in the other order.
        side = ax * by - ay * bx
        if side == 0 and min(ax, bx) <= 0 <= max(ax, bx) and min(ay, by) <= 0 <= max(ay, by):
            inside = True
            break
        if (ay > 0) != (by > 0) and (side > 0) == (by > ay):
            inside = not inside
    if not inside:
        return np.inf
    # Nearly edge-on a vertex's last digits move the plane far along the ray: no farther than the polygon reaches.
    near, far = np.inf, -np.inf
    for k in range(base, end, 3):
        along = (measures[k + z] - eye[2]) * shear[2]
        near, far = min(near, along), max(far, along)
    height = (
        measures[i] * (measures[base] - origin[0])
        + measures[i + 1] * (measures[base + 1] - origin[1])
        + measures[i + 2] * (measures[base + 2] - origin[2])
    )
    return min(max(height / slope, near), far)
