"""The objects of a shot as triangles in the world, for the page to draw while they are dragged."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl

MOST_TRIANGLES = 200_000
"""Of an object that is drawn while it is dragged; of a finer one every so-manieth triangle is."""


def object_facts(shot: Path) -> list[dict[str, Any]]:
    """Each object's foot and extent, in metres, for JSON; raises RelumeError."""
    found = []
    for meshes in _objects(shot):
        points = np.concatenate([mesh.vertices for mesh in meshes])
        low, high = points.min(0), points.max(0)
        found.append(
            {
                "low": low.tolist(), "high": high.tolist(),
                "foot": [float((low[0] + high[0]) / 2), float(low[1]), float((low[2] + high[2]) / 2)],
                "triangles": sum(len(mesh.faces) for mesh in meshes),
            }
        )  # fmt: skip
    return found


def mesh_bytes(shot: Path, number: int) -> bytes:
    """An object's triangles: for each corner position, normal and base colour, nine little-endian floats.

    Raises LookupError for an object there is none of, RelumeError.
    """
    objects = _objects(shot)
    if not 0 <= number < len(objects):
        raise LookupError
    parts = []
    total = sum(len(mesh.faces) for mesh in objects[number])
    step = -(-total // MOST_TRIANGLES)
    for mesh in objects[number]:
        corners = mesh.vertices[mesh.faces[::step]].astype(np.float32)
        if mesh.normals is not None:
            normals = mesh.normals[mesh.faces[::step]].astype(np.float32)
        else:
            flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            flat /= np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1e-12)
            normals = np.repeat(flat[:, None], 3, axis=1).astype(np.float32)
        colour = np.broadcast_to(np.array(_colour(mesh.material), np.float32), corners.shape)
        parts.append(np.concatenate([corners, normals, colour], axis=-1).reshape(-1, 9))
    return np.concatenate(parts).astype("<f4").tobytes()


def _objects(shot: Path) -> list[tuple[rl.Mesh, ...]]:
    """The meshes of each object, where the job itself has them."""
    table = rl.read_shot(shot)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [rl.report.placed_meshes(table.model_copy(update={"objects": [each]})) for each in table.objects]


def _colour(material: Any) -> tuple[float, float, float]:
    """One colour that stands for a material while it is dragged."""
    for name in ("base_color", "reflectance", "diffuse"):
        value = getattr(material, name, None)
        if isinstance(value, tuple) and len(value) == 3 and all(isinstance(each, int | float) for each in value):
            return value
    return (0.5, 0.5, 0.5)
