"""Normals for smooth shading of meshes whose files have none: OBJ and PLY often, STL always."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.watertight import places_of


def smoothed(meshes: Sequence[Mesh], degrees: float) -> tuple[Mesh, ...]:
    """The meshes with normals that turn evenly over every edge where two faces turn by no more than an angle.

    meshes : of one thing, which a file may have split by materials
    degrees : between the normals of two faces with a common edge; above 0, up to 180

    Corners at one place that such edges join have one normal: the mean of their faces', each by its angle there
    (Thürmer and Wüthrich 1998), however the surface is cut into triangles. Corners at equal places are one, also along
    seams of texture coordinates. The file's own normals are replaced; triangles share no corners any more.
    """
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes])
    exact = corners.astype(np.float64)
    faces, angles = _normals(exact), _angles(exact)
    own = np.repeat(faces, 3, axis=0)
    group = _groups(places_of(corners.reshape(-1, 3)), faces, np.cos(np.radians(degrees)) - 1e-6)
    weighed = angles.reshape(-1, 1) * own
    total = np.stack([np.bincount(group, weighed[:, axis]) for axis in range(3)], axis=1)[group]
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # The two sides of a sheet add up to nothing.
    normals = np.where(length > 1e-9, total / np.maximum(length, 1e-9), own)
    # Faces without area have none, and are met by no ray.
    normals[~normals.any(axis=1)] = [0, 1, 0]
    parts = np.split(normals.astype(np.float32), np.cumsum([mesh.faces.size for mesh in meshes])[:-1])
    return tuple(_apart(mesh, part) for mesh, part in zip(meshes, parts, strict=True))


def _apart(mesh: Mesh, normals: np.ndarray) -> Mesh:
    """The mesh whose triangles share no corners, with a normal for each of them."""
    return replace(
        mesh,
        vertices=mesh.vertices[mesh.faces].reshape(-1, 3),
        faces=np.arange(mesh.faces.size, dtype=np.int32).reshape(-1, 3),
        normals=normals,
        uv=None if mesh.uv is None else mesh.uv[mesh.faces].reshape(-1, 2),
    )


def _groups(place: np.ndarray, faces: np.ndarray, least: float) -> np.ndarray:
    """(3M,) which corners are joined by smooth edges: the same number for each of a group.

    place : (3M,) of each corner
    faces : (M, 3) normals
    least : cosine between the normals of the faces at an edge from which on it is smooth
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    here = np.arange(len(place))
    ahead = here.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    low, high = np.where(place < place[ahead], (here, ahead), (ahead, here))
    edge = place[low].astype(np.int64) * (int(place.max()) + 1) + place[high]
    order = np.argsort(edge, kind="stable")
    # The faces at an edge stand beside each other: each is held against the next, the one after it, and so on.
    ones, others = [here[:0]], [here[:0]]
    first, step = np.arange(len(order)), 1
    while len(first := first[first + step < len(order)]):
        first = first[edge[order[first]] == edge[order[first + step]]]
        one, other = order[first], order[first + step]
        smooth = np.einsum("ij,ij->i", faces[one // 3], faces[other // 3]) >= least
        for end in (low, high):
            ones.append(end[one[smooth]])
            others.append(end[other[smooth]])
        step += 1
    pairs = np.concatenate(ones), np.concatenate(others)
    joined = coo_array((np.ones(len(pairs[0]), bool), pairs), shape=(len(place), len(place)))
    return connected_components(joined, directed=False)[1]


def _normals(corners: np.ndarray) -> np.ndarray:
    """Unit normals of triangles (M, 3, 3); 0 where they have no area."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.divide(across, length, out=np.zeros_like(across), where=length > 0)


def _angles(corners: np.ndarray) -> np.ndarray:
    """The angles (M, 3) at the corners of triangles, radians."""
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    return np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=-1), np.einsum("ijk,ijk->ij", ahead, behind))
