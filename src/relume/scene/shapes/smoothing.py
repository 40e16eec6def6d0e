"""Normals for smooth shading of meshes whose files have none: OBJ and PLY often, STL always."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.watertight import places_of


def smoothed(mesh: Mesh, degrees: float) -> Mesh:
    """The mesh with normals that turn evenly over all edges but those that are sharper than an angle.

    degrees : between the normals of two faces at one place, up to which they count for each other; 0 to 180

    A corner's normal is the mean of those of the faces about it, each by its angle there (Thürmer and Wüthrich 1998),
    however the surface is cut into triangles. Corners at equal places are one, also along seams of texture coordinates;
    triangles no longer share any. Normals of the file are left.
    """
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    faces, angles = _normals(corners), _angles(corners).ravel()
    place = places_of(mesh.vertices)[mesh.faces].ravel()
    order = np.argsort(place, kind="stable")
    place, normal = place[order], faces[order // 3]
    weighed = angles[order, None] * normal
    total, least = weighed.copy(), np.cos(np.radians(degrees)) - 1e-6
    # The corners of a place stand beside each other: each is held against the next, the one after it, and so on.
    first, step = np.arange(len(order)), 1
    while len(first := first[first + step < len(order)]):
        first = first[place[first] == place[first + step]]
        other = first + step
        near = np.einsum("ij,ij->i", normal[first], normal[other]) >= least
        one, two = first[near], other[near]
        total[one] += weighed[two]
        total[two] += weighed[one]
        step += 1
    normals = np.empty_like(total)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # Faces without area have no normal, and are met by no ray.
    normals[order] = np.where(length > 1e-12, total / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])
    return replace(
        mesh,
        vertices=mesh.vertices[mesh.faces].reshape(-1, 3),
        faces=np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3),
        normals=normals.astype(np.float32),
        uv=None if mesh.uv is None else mesh.uv[mesh.faces].reshape(-1, 2),
    )


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of triangles (M, 3, 3); 0 where they have no area."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.divide(across, length, out=np.zeros_like(across), where=length > 0)


def _angles(corners: np.ndarray) -> np.ndarray:
    """The angles (M, 3) at the corners of triangles, radians."""
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=-1), np.einsum("ijk,ijk->ij", ahead, behind))
