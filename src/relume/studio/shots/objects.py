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

MOST_TRIANGLES = 200_000
"""Of an object that is drawn while it is dragged; of a finer one every so-manieth triangle is."""
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
        """An object's triangles: for each corner position, normal and base colour, nine little-endian floats.

        Raises LookupError for an object there is none of, RelumeError.
        """
        table = rl.read_shot(shot)
        if not 0 <= number < len(table.objects):
            raise LookupError
        _, meshes = self._placed(table, table.objects[number])
        parts = []
        total = sum(len(mesh.faces) for mesh in meshes)
        step = -(-total // MOST_TRIANGLES)
        for mesh in meshes:
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


def _colour(material: Any) -> tuple[float, float, float]:
    """One colour that stands for a material while it is dragged."""
    for name in ("base_color", "reflectance", "diffuse"):
        value = getattr(material, name, None)
        if isinstance(value, tuple) and len(value) == 3 and all(isinstance(each, int | float) for each in value):
            return value
    return (0.5, 0.5, 0.5)
