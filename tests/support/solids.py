"""Bodies that several tests put into scenes."""

from __future__ import annotations

import numpy as np
import trimesh

from relume.scene.materials.materials import Diffuse, Material
from relume.scene.shapes.shapes import Mesh


def sphere(
    material: Material | Diffuse, *, centre: tuple[float, float, float] = (0, 0, 0), radius: float = 1.0, fine: int = 4
) -> Mesh:
    """A sphere of 20·4^fine triangles with smooth normals."""
    ball = trimesh.creation.icosphere(subdivisions=fine)
    vertices, normals = np.asarray(centre) + radius * ball.vertices, ball.vertices.astype(np.float32)
    return Mesh(vertices.astype(np.float32), ball.faces.astype(np.int32), material, normals, name="ball")
