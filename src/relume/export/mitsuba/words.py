"""Our scene as plain values for Mitsuba's XML: `Notebook` stands in for Mitsuba's module.

`renderers.mitsuba.scene` builds a scene through the module that it is given. Given a `Notebook`, the scene stays
plain values: the very scene that would be rendered, without Mitsuba.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Bitmap:
    """An image (H, W, 1) or (H, W, 3), float32."""

    pixels: np.ndarray


@dataclass(frozen=True, eq=False)
class Transform:
    """A matrix (4, 4), world from object."""

    matrix: np.ndarray


@dataclass(frozen=True, eq=False)
class MeshWords:
    """Triangles: flat arrays by Mitsuba's names, and what hangs on the mesh by its names."""

    name: str
    parts: dict[str, Any]
    has_normals: bool
    has_texcoords: bool
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


class Notebook:
    """What of Mitsuba's module `mitsuba_scene` needs, as values.

    It speaks for the scalar variant, for which every material is one of Mitsuba's own plugins and none of ours.
    """

    def variant(self) -> str:
        return "scalar_rgb"

    def Bitmap(self, pixels: np.ndarray) -> Bitmap:
        return Bitmap(pixels)

    def ScalarTransform4f(self, matrix: np.ndarray) -> Transform:
        return Transform(np.asarray(matrix, np.float64))

    def Properties(self) -> dict[str, Any]:
        return {}

    def load_dict(self, words: dict[str, Any]) -> dict[str, Any]:
        return words

    def Mesh(
        self,
        name: str,
        vertex_count: int,
        face_count: int,
        props: dict[str, Any] | None = None,
        has_vertex_normals: bool = False,
        has_vertex_texcoords: bool = False,
    ) -> MeshWords:
        return MeshWords(name, dict(props or {}), has_vertex_normals, has_vertex_texcoords)

    def traverse(self, mesh: MeshWords) -> dict[str, np.ndarray]:
        """Its arrays; a dictionary's `update` without arguments does what Mitsuba's needs: nothing."""
        return mesh.arrays


def ply(mesh: MeshWords) -> bytes:
    """The mesh as a binary PLY file (Turk 1994), with the properties by the names that Mitsuba's loader knows."""
    columns: Sequence[tuple[str, str, int]] = [("vertex_positions", "x y z", 3)]
    if mesh.has_normals:
        columns = [*columns, ("vertex_normals", "nx ny nz", 3)]
    if mesh.has_texcoords:
        columns = [*columns, ("vertex_texcoords", "u v", 2)]
    vertices = np.concatenate([mesh.arrays[key].reshape(-1, width) for key, _, width in columns], axis=1)
    faces = mesh.arrays["faces"].reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for _, names, _ in columns for name in names.split()]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    return "\n".join([*header, ""]).encode() + vertices.astype("<f4").tobytes() + rows.tobytes()
