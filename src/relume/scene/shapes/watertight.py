"""Whether a mesh bounds a body: closed, wound one way, facing outwards; and whether a point lies inside of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.errors import warn
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh


@dataclass(frozen=True)
class Watertightness:
    """What a mesh lacks to be the boundary of a body.

    open_edges : edges with a triangle on one side alone
    crowded_edges : edges where more than two triangles meet
    turned_edges : edges whose two triangles are wound against each other
    volume : enclosed, m³; negative where it faces inwards; of no meaning where edges are open
    """

    open_edges: int
    crowded_edges: int
    turned_edges: int
    volume: float

    @property
    def closed(self) -> bool:
        """Whether it bounds a body all around, wound one way."""
        return not (self.open_edges or self.crowded_edges or self.turned_edges)


def watertightness(mesh: Mesh) -> Watertightness:
    """How closed a mesh is, its vertices at equal places taken as one and triangles without area left out."""
    faces = _welded(mesh)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends).astype(np.int64), np.maximum(starts, ends)
    forward = np.where(starts < ends, 1, -1)
    key = low * (int(faces.max(initial=0)) + 1) + high
    _, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    balance = np.bincount(edge, forward, len(count))
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    middle = mesh.vertices.mean(axis=0, dtype=np.float64)
    volume = np.sum(np.cross(a - middle, b - middle) * (c - middle)) / 6
    # Bodies may touch along an edge: an even number of triangles, half of them each way, closes it.
    paired = (count % 2 == 0) & (balance == 0)
    return Watertightness(
        int(np.sum(count == 1)),
        int(np.sum((count > 2) & ~paired)),
        int(np.sum((count == 2) & (balance != 0))),
        float(volume),
    )


def _welded(mesh: Mesh) -> np.ndarray:
    """(M, 3) triangles over vertices at different places, those without area left out."""
    faces = places_of(mesh.vertices)[mesh.faces].astype(np.int64)
    kept = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return faces[kept]


def places_of(vertices: np.ndarray) -> np.ndarray:
    """(N,) a number for each of the places that vertices (N, 3) stand at, the same for equal ones."""
    # Adding zero makes −0 into 0, which are the same place.
    places = (vertices.astype(np.float32) + np.float32(0)).view(np.uint32).astype(np.uint64)
    # One number a place, of odd multipliers from the golden ratio: a million places meet once in 10⁷ meshes.
    mixed = (places * np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)) >> np.uint64(1)
    key = mixed[:, 0] ^ (mixed[:, 1] * np.uint64(3)) ^ (mixed[:, 2] * np.uint64(7))
    return np.unique(key, return_inverse=True)[1]


def facing_outwards(mesh: Mesh) -> Mesh:
    """The mesh, facing outwards if its material lets light in; warns where it cannot be the boundary of a body.

    Only meshes that light goes through bent, or that are filled, are looked at: others are as good open as closed.
    """
    material = mesh.material
    if not isinstance(material, Material) or material.thin or not np.any(material.through):
        return mesh
    found = watertightness(mesh)
    if not found.closed:
        parts = {
            "open edges": found.open_edges,
            "edges of more than two triangles": found.crowded_edges,
            "edges wound both ways": found.turned_edges,
        }
        faults = ", ".join(f"{count} {name}" for name, count in parts.items() if count)
        warn(
            f"mesh {mesh.name!r} lets light in but does not bound a body ({faults}): light that enters may not leave; "
            "close it, or set thin = true for a sheet"
        )
        return mesh
    if found.volume >= 0:
        return mesh
    warn(f"mesh {mesh.name!r} lets light in and was inside out; it was turned")
    normals = None if mesh.normals is None else -mesh.normals
    return replace(mesh, faces=np.ascontiguousarray(mesh.faces[:, ::-1]), normals=normals)


def inside(mesh: Mesh, point: np.ndarray) -> bool:
    """Whether a point lies inside a mesh, by its winding number (Van Oosterom and Strackee 1983).

    point : (3,), metres, world
    A mesh with small holes still has an inside; one wound inwards has the same.
    """
    corners = mesh.vertices.astype(np.float64) - np.asarray(point, np.float64)
    if np.any(corners.max(axis=0) < 0) or np.any(corners.min(axis=0) > 0):
        return False
    lengths = np.linalg.norm(corners, axis=1)
    a, b, c = (corners[mesh.faces[:, corner]] for corner in range(3))
    la, lb, lc = (lengths[mesh.faces[:, corner]] for corner in range(3))
    ax, ay, az = a.T
    bx, by, bz = b.T
    cx, cy, cz = c.T
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
    solid_angle = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return bool(abs(solid_angle.sum()) > 2 * np.pi)
