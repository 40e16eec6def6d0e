"""The objects of a shot as triangles in the world, for the page to draw while they are dragged."""

from __future__ import annotations

import hashlib
import json
import threading
import warnings
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl

MOST_TRIANGLES = 2500
"""Of an object that is drawn while it is dragged: a processor that draws by software draws eight such in a twentieth of
a second."""
ONE_AT_A_TIME = threading.Lock()
"""fast-simplification keeps what it works on in variables of its own, and lets other threads in meanwhile."""
MOST_KEPT = 8
"""Objects kept as they are placed, of shots with fewer."""


class PlacedObjects:
    """The objects of a shot where the job has them; safe to use from several threads.

    What is placed is kept: where one of several is moved the others are not read again.
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[str, tuple[rl.Mesh, ...]] = OrderedDict()
        self._changing = threading.Lock()

    def facts(self, shot: Path) -> list[dict[str, Any]]:
        """Each object's foot and extent, in metres, and what names its triangles, for JSON; raises RelumeError."""
        found = []
        table = rl.read_shot(shot)
        for each in table.objects:
            name, meshes = self._placed(table, each)
            points = np.concatenate([mesh.vertices for mesh in meshes])
            low, high = points.min(0), points.max(0)
            found.append(
                {
                    "low": low.tolist(), "high": high.tolist(), "digest": name,
                    "foot": [float((low[0] + high[0]) / 2), float(low[1]), float((low[2] + high[2]) / 2)],
                    "triangles": sum(len(mesh.faces) for mesh in meshes),
                }
            )  # fmt: skip
        return found

    def mesh_bytes(self, shot: Path, number: int) -> bytes:
        """An object's triangles: the number of its vertices; of each, position, normal and base colour; the corners.

        Little-endian: an unsigned integer, nine floats a vertex, and an unsigned integer a corner.

        Raises LookupError for an object there is none of, RelumeError.
        """
        table = rl.read_shot(shot)
        if not 0 <= number < len(table.objects):
            raise LookupError
        _, meshes = self._placed(table, table.objects[number])
        parts = []
        share = min(1.0, MOST_TRIANGLES / sum(len(mesh.faces) for mesh in meshes))
        for mesh in meshes:
            corners, normals = drawn_triangles(mesh, max(4, round(share * len(mesh.faces))))
            colour = np.broadcast_to(np.array(_colour(mesh.material)), corners.shape)
            parts.append(np.concatenate([corners, normals, colour], axis=-1).reshape(-1, 9))
        vertices, corners = np.unique(np.concatenate(parts).astype("<f4"), axis=0, return_inverse=True)
        return np.uint32(len(vertices)).tobytes() + vertices.tobytes() + corners.astype("<u4").tobytes()

    def _placed(self, table: rl.Shot, one: Any) -> tuple[str, tuple[rl.Mesh, ...]]:
        """The meshes of one object, and a name for them as they are."""
        path = table.path(one.mesh)
        try:
            stamp = path.stat().st_mtime_ns
        except OSError:  # placing it says so
            stamp = 0
        made_from = [one.model_dump(mode="json"), table.camera.model_dump(mode="json"), str(path), stamp]
        name = hashlib.sha256(json.dumps(made_from).encode()).hexdigest()[:24]
        with self._changing:
            if name not in self._kept:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self._kept[name] = rl.report.placed_meshes(table.model_copy(update={"objects": [one]}))
            self._kept.move_to_end(name)
            while len(self._kept) > max(len(table.objects), MOST_KEPT):
                self._kept.popitem(last=False)
            return name, self._kept[name]


def drawn_triangles(mesh: rl.Mesh, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Corners and normals (N, 3, 3) of about `most` triangles that look like a mesh of more."""
    if len(mesh.faces) <= most:
        corners = mesh.vertices[mesh.faces]
        flat = _across(corners)[:, None]
        return corners, np.broadcast_to(flat, corners.shape) if mesh.normals is None else mesh.normals[mesh.faces]
    from fast_simplification import simplify
    from scipy.spatial import KDTree

    # A mesh has several vertices where its normals or its image's coordinates break; as a body it has one.
    places, of = np.unique(mesh.vertices, axis=0, return_inverse=True)
    with ONE_AT_A_TIME:
        points, faces = simplify(places, of.reshape(-1)[mesh.faces].astype(np.int32), target_count=most)[:2]
    corners = points[faces].astype(np.float64)
    flat = _across(corners)[:, None]
    if mesh.normals is None:
        return corners, np.broadcast_to(flat, corners.shape)
    # Of the mesh's own normals near a corner, the nearest that fits its triangle: edges stay sharp.
    _, near = KDTree(mesh.vertices).query(corners, k=min(4, len(mesh.vertices)))
    normals = mesh.normals[near]
    fits = (normals * flat[:, None]).sum(-1)
    best = np.argmax(np.minimum(fits, 0.7), axis=-1)
    return corners, np.take_along_axis(normals, best[..., None, None], axis=2)[:, :, 0]


def _across(corners: np.ndarray) -> np.ndarray:
    """The unit normals (N, 3) of triangles (N, 3, 3)."""
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return flat / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1e-12)


def _colour(material: Any) -> tuple[float, float, float]:
    """One colour that stands for a material while it is dragged."""
    for name in ("base_color", "reflectance", "diffuse"):
        value = getattr(material, name, None)
        if isinstance(value, tuple) and len(value) == 3 and all(isinstance(each, int | float) for each in value):
            return value
    return (0.5, 0.5, 0.5)
