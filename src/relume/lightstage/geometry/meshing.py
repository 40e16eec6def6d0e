"""Points on a camera's lattice of pixels cleaned and made a mesh: neighbouring pixels are neighbouring vertices.

What lies between two surfaces is no surface: an edge much longer than a pixel is wide there is a jump, and is not
closed. Points that few neighbours agree with and islands of few points are noise, and are dropped and counted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from relume.lightstage.geometry.triangulation import ScannedPoints
from relume.scene.cameras.camera import Camera

_ROUND = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


@dataclass(frozen=True)
class CleaningSettings:
    """What of a scan is kept.

    longest_edge : of a mesh, in pixels as wide as they are at that distance; 6 is a surface seen at 80° from its
        normal, whose pixels say little
    widest_gap : between a point's two rays, in medians of all; further, and the two did not see the same place
    least_neighbours : of eight, how many a point needs within an edge's length
    least_island : points of a piece that stays, as a share of the largest piece; an ear behind a cheek is a piece too
    """

    longest_edge: float = 6.0
    widest_gap: float = 8.0
    least_neighbours: int = 4
    least_island: float = 0.005


def cleaned(scanned: ScannedPoints, camera: Camera, settings: CleaningSettings = CleaningSettings()) -> np.ndarray:
    """Which points (H, W) bool are surface.

    camera : that saw them
    Raises ValueError where none is left.
    """
    kept = scanned.known & (scanned.gap <= settings.widest_gap * np.nanmedian(scanned.gap))
    points = np.where(kept[..., None], scanned.points, np.nan)
    limit = settings.longest_edge * pixel_widths(points, camera)
    # Points that their neighbours contradict; twice, since the first pass takes neighbours away.
    for _ in range(2):
        near = np.zeros(kept.shape, int)
        for down, across in _ROUND:
            there = _moved(points, down, across)
            length = np.linalg.norm(there - points, axis=-1)
            near += np.nan_to_num(length, nan=np.inf) < limit * np.hypot(down, across)
        kept &= near >= settings.least_neighbours
        points = np.where(kept[..., None], points, np.nan)
    # Islands.
    number = np.arange(kept.size).reshape(kept.shape)
    ends = []
    for down, across in ((0, 1), (1, 0)):
        joined = np.nan_to_num(np.linalg.norm(_moved(points, down, across) - points, axis=-1), nan=np.inf) < limit
        ends.append(np.stack([number[joined], _moved(number, down, across, -1)[joined]]))
    first, second = np.concatenate(ends, axis=1).astype(int)
    graph = sparse.coo_array((np.ones(len(first), bool), (first, second)), shape=(kept.size, kept.size))
    _, piece = csgraph.connected_components(graph, directed=False)
    size = np.bincount(piece[kept.ravel()], minlength=piece.max() + 1)
    kept &= (size[piece] >= settings.least_island * size.max()).reshape(kept.shape)
    if kept.sum() < 4:
        raise ValueError("no surface is left of the scan: its points contradict each other; check the rig")
    return kept


def lattice_mesh(
    points: np.ndarray, kept: np.ndarray, camera: Camera, settings: CleaningSettings = CleaningSettings()
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices' pixels (N, 2), rows and columns, and faces (M, 3) over them, counter-clockwise to the camera.

    points : (H, W, 3); kept : (H, W) bool
    Four neighbouring pixels make two triangles, divided along the shorter diagonal, and three make one; none with a
    longer edge than the settings allow.
    """
    rows, columns = np.nonzero(kept)
    number = np.full(kept.shape, -1)
    number[rows, columns] = np.arange(len(rows))
    # Corners of each square of pixels: upper left, lower left, lower right, upper right, counter-clockwise as seen.
    upper, lower = number[:-1], number[1:]
    a, b, c, d = upper[:, :-1], lower[:, :-1], lower[:, 1:], upper[:, 1:]
    place = points[rows, columns]

    def apart(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(place[first] - place[second], axis=-1)
        return np.where((first >= 0) & (second >= 0), length, np.inf)

    falling = (apart(a, c) <= apart(b, d)).ravel()
    halves = np.stack([[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]]).reshape(2, 2, 3, -1)
    faces = np.where(falling, halves[0], halves[1]).transpose(0, 2, 1).reshape(-1, 3)
    faces = faces[(faces >= 0).all(axis=1)]
    limit = settings.longest_edge * np.sqrt(2) * pixel_widths(place, camera)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        length = np.linalg.norm(place[faces[:, first]] - place[faces[:, second]], axis=-1)
        faces = faces[length < limit[faces[:, first]]]
    used, faces = np.unique(faces, return_inverse=True)
    return np.stack([rows[used], columns[used]], axis=-1), faces.reshape(-1, 3).astype(np.int32)


def surface_normals(points: np.ndarray, camera: Camera) -> np.ndarray:
    """Unit normals (H, W, 3) of points on the lattice, towards the camera, from neighbours on both sides; else NaN."""
    across = _moved(points, 0, 1) - _moved(points, 0, -1)
    down = _moved(points, 1, 0) - _moved(points, -1, 0)
    normal = np.cross(down, across)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
    facing = np.einsum("...k,...k->...", normal, camera.position - points)
    return np.where(facing[..., None] > 0, normal, np.nan)


def pixel_widths(points: np.ndarray, camera: Camera) -> np.ndarray:
    """How wide a pixel is at each point (…, 3), metres."""
    return np.linalg.norm(points - camera.position, axis=-1) / camera.focal_length


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) at vertices (N, 3): the mean of their faces' (M, 3), each by its area."""
    sides = vertices[faces]
    across = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], across)
    return total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-30)


def _moved(values: np.ndarray, down: int, across: int, beyond: float = np.nan) -> np.ndarray:
    """What each pixel has so many pixels below and to the right of it; `beyond` past the edge."""
    found = np.full(values.shape, beyond)
    height, width = values.shape[:2]
    here = slice(max(0, -down), height - max(0, down)), slice(max(0, -across), width - max(0, across))
    there = slice(max(0, down), height - max(0, -down)), slice(max(0, across), width - max(0, -across))
    found[here] = values[there]
    return found
