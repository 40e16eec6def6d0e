"""Bodies that several tests put into scenes."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from relume.scene.materials.materials import Diffuse, Material
from relume.scene.shapes.shapes import AnyMaterial, Mesh


def built(body: trimesh.Trimesh, material: AnyMaterial, name: str = "body") -> Mesh:
    """A body of trimesh as flat triangles."""
    return Mesh(np.asarray(body.vertices, np.float32), np.asarray(body.faces, np.int32), material, name=name)


def quad(corners: ArrayLike, material: AnyMaterial, *, textured: bool = False, name: str = "quad") -> Mesh:
    """Two triangles between four corners (4, 3); the first has the texture coordinates (0, 0), the third (1, 1)."""
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) if textured else None
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Mesh(np.asarray(corners, np.float32), faces, material, uv=uv, name=name)


def grid_faces(rows: int, columns: int) -> np.ndarray:
    """The triangles (M, 3) of a grid of squares whose points stand in rows, one more than squares each way."""
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = corner + columns + 1
    return np.concatenate([np.stack([corner, below, below + 1], -1), np.stack([corner, below + 1, corner + 1], -1)])


def sphere(
    material: Material | Diffuse, *, centre: tuple[float, float, float] = (0, 0, 0), radius: float = 1.0, fine: int = 4
) -> Mesh:
    """A sphere of 20·4^fine triangles with smooth normals."""
    ball = trimesh.creation.icosphere(subdivisions=fine)
    vertices, normals = np.asarray(centre) + radius * ball.vertices, ball.vertices.astype(np.float32)
    return Mesh(vertices.astype(np.float32), ball.faces.astype(np.int32), material, normals, name="ball")


def room(*materials: AnyMaterial) -> tuple[Mesh, ...]:
    """The unit cube as seen from inside: x = 0 and 1, y = 0 and 1, z = 0 and 1, of these six materials or of one."""
    walls = []
    for index, material in enumerate(materials if len(materials) == 6 else materials * 6):
        axis, far = divmod(index, 2)
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        corners = np.insert(square, axis, far, axis=1)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])[axis]
        # Its normal points away from the wall.
        inward = corners if (normal > 0) == (far == 0) else corners[::-1]
        walls.append(quad(inward, material, name=f"{'xyz'[axis]} = {far}"))
    return tuple(walls)
