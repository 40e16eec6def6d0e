"""The marks of a place file beside what was found: how far each point lies from its edge as the camera sees that."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.scene.places.place import PlaceBlock, PlaceMark, PlacePhotograph
from relume.scene.places.place_tables import PlaceTables, require_known
from relume.scene.places.sightings import line_errors, nearest_chords


def place_marks(
    tables: PlaceTables, blocks: Sequence[PlaceBlock], photographs: Sequence[PlacePhotograph]
) -> tuple[PlaceMark, ...]:
    """Every mark with its distances; raises ValueError naming an edge or corner that its block does not have."""
    cameras = {photograph.name: photograph.camera for photograph in photographs}
    by_name = {block.name: block for block in blocks}
    found = []
    for photograph, marked in tables.marks.items():
        for name, edges in marked.items():
            block = by_name[name]
            points_of = block.edges | {corner: point[None] for corner, point in block.corners.items()}
            for edge, points in edges.items():
                where = f"marks.{photograph}.{name}.{edge}"
                require_known(edge, points_of, where, f"edge or corner of a {block.kind}")
                pixels = np.array(points, np.float64)
                distances = _distances(cameras[photograph], points_of[edge], pixels)
                found.append(PlaceMark(photograph, name, edge, pixels, distances))
    return tuple(found)


def _distances(camera: Camera, edge: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """(N,) pixels, of points (N, 2) from an edge, a curve or a corner (K, 3), as a lens without distortion shows it."""
    rays = camera.rays_through(pixels) @ camera.rotation
    seen = camera.focal_length * rays[:, :2] / -rays[:, 2:]
    local = (edge - camera.position) @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        shown = camera.focal_length * local[:, :2] / -local[:, 2:]
    if len(edge) == 1:
        return np.linalg.norm(seen - shown, axis=-1)
    first = nearest_chords(shown, seen) if len(edge) > 2 else np.zeros(len(seen), int)
    many = len(seen)
    return np.abs(
        line_errors(
            edge[first], edge[first + 1], np.zeros((many, 3)), np.tile(camera.position, (many, 1)),
            np.full(many, camera.focal_length), np.tile(camera.rotation, (many, 1, 1)), seen,
        )
    )  # fmt: skip
