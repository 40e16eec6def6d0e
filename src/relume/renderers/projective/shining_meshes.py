"""Meshes that shine by a texture, taken as a baked place: as they come back from a file, or from another program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.renderers.projective.atlas import covered, face_normals
from relume.renderers.projective.baking import BakedMesh, BakedPlace
from relume.scene.materials.materials import Material, is_image
from relume.scene.shapes.shapes import Mesh


def place_of(meshes: Sequence[Mesh], unit: str = "relative") -> BakedPlace:
    """The place of meshes whose materials have an emission as an image over their texture coordinates.

    meshes : with an image as emission each
    unit : of the radiance
    All of it counts as seen; a texel stands for its share of its mesh's area. Raises ValueError naming the mesh for one
    that has no such image, or coordinates beyond the image.
    """
    if not meshes:
        raise ValueError("a place has no meshes; give one or more")
    return BakedPlace(tuple(map(_part, meshes)), unit)


def _part(mesh: Mesh) -> BakedMesh:
    material = mesh.material
    if not isinstance(material, Material) or not is_image(material.emission) or mesh.uv is None:
        raise ValueError(
            f"mesh {mesh.name!r} has no radiance of its own: it needs an emissive texture, as rl.renderers.bake makes"
        )
    if mesh.uv.min() < -1e-3 or mesh.uv.max() > 1 + 1e-3:
        raise ValueError(f"the emissive texture of mesh {mesh.name!r} repeats; lay each of its faces down once")
    height, width = np.shape(material.emission)[:2]
    placed = (mesh.uv[mesh.faces].astype(np.float64) * [1, -1] + [0, 1]) * [width, height]
    rows, columns, face, weights, inner = covered(placed, (width, height))
    points, faces = np.full((height, width, 3), np.nan, np.float32), np.full((height, width), -1, np.int32)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    points[rows, columns] = np.einsum("tc,tcx->tx", weights, corners[face])
    faces[rows, columns] = face
    used = np.zeros((height, width), bool)
    used[rows, columns] = inner
    texel = float(np.sqrt(face_normals(mesh)[1].sum() / max(int(used.sum()), 1)))
    return BakedMesh(mesh, used, used, points, faces, texel)
