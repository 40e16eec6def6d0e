"""Meshes whose texture is mirrored in parts: their bumps' frames turn over there, and so must their normal maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh


def with_mirrored_apart(mesh: Mesh) -> tuple[Mesh, ...]:
    """The mesh itself, or, where its normal map lies mirrored on some triangles, those as a mesh of their own.

    glTF's bitangent points up in the picture. A renderer that takes the cross product of the normal and the tangent
    has it downwards on triangles whose texture is mirrored; their own normal map has its y turned over.
    """
    material = mesh.material
    if mesh.uv is None or not isinstance(material, Material) or material.normal is None:
        return (mesh,)
    a, b, c = (mesh.uv[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    mirrored = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    if not mirrored.any():
        return (mesh,)
    turned = _part(mesh, mirrored, replace(material, normal=material.normal * np.array([1, -1, 1], np.float32)))
    if mirrored.all():
        return (turned,)
    return _part(mesh, ~mirrored, material), turned


def _part(mesh: Mesh, chosen: np.ndarray, material: Material) -> Mesh:
    kept, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        faces=faces.reshape(-1, 3).astype(np.int32),
        material=material,
        normals=None if mesh.normals is None else mesh.normals[kept],
        uv=None if mesh.uv is None else mesh.uv[kept],
    )
