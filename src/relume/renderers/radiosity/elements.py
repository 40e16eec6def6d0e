"""Surfaces divided into triangles at two levels: patches, which shoot, and their elements, which receive (Cohen 1986).

An edge that is too long is halved in both triangles that share it, so that no vertex lies on another's side.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from relume.renderers.diffuse.scenes import DiffuseScene, emission_of, reflectance_of
from relume.renderers.raytrace.lamps import painted
from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.tessellation import as_mesh

MOST = 2_000_000
"""Triangles: more than that hold no light in some gigabytes of memory."""


def divided(mesh: Mesh, parent: np.ndarray, edges: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """The mesh with some edges halved, and whose part each of its triangles is.

    parent : (F,) of each triangle; its parts inherit it
    edges : (F, 3) bool, which edges to halve, from each triangle's vertex to the next; halved if either side says so
    """
    faces, count = np.asarray(mesh.faces, np.int64), len(mesh.vertices)
    pairs = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    keys, edge = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    halved = np.zeros(len(keys), bool)
    np.logical_or.at(halved, edge, edges.reshape(-1))
    middle = np.where(halved, count + np.cumsum(halved) - 1, -1)
    ends = np.stack(np.divmod(keys[halved], count), axis=-1)

    # Each triangle turned so that its halved edges come first, and cut as their number says.
    middles = middle[edge].reshape(-1, 3)
    number = (middles >= 0).sum(axis=1)
    first = np.where(number == 1, np.argmax(middles >= 0, axis=1), (np.argmin(middles >= 0, axis=1) + 1) % 3)
    turned = (np.arange(3) + first[:, None]) % 3
    a, b, c = np.take_along_axis(faces, turned, axis=1).T
    p, q, r = np.take_along_axis(middles, turned, axis=1).T
    parts = {
        0: [(a, b, c)],
        1: [(a, p, c), (p, b, c)],
        2: [(p, b, q), (a, p, q), (a, q, c)],
        3: [(a, p, r), (p, b, q), (r, q, c), (p, q, r)],
    }
    cut = [(np.flatnonzero(number == n), corners) for n, every in parts.items() for corners in every]
    rows = np.concatenate([np.stack(corners, axis=1)[which] for which, corners in cut])
    # In the order of the triangles that they are parts of.
    whose = np.concatenate([which for which, _ in cut])
    order = np.argsort(whose, kind="stable")

    def longer(values: np.ndarray | None, unit: bool = False) -> np.ndarray | None:
        if values is None:
            return None
        new = 0.5 * (np.asarray(values, np.float64)[ends[:, 0]] + np.asarray(values, np.float64)[ends[:, 1]])
        if unit:
            new /= np.maximum(np.linalg.norm(new, axis=-1, keepdims=True), 1e-300)
        return np.concatenate([values, new.astype(np.float32)])

    vertices = longer(mesh.vertices)
    assert vertices is not None
    faces32 = rows[order].astype(np.int32)
    finer = replace(mesh, vertices=vertices, faces=faces32, normals=longer(mesh.normals, True), uv=longer(mesh.uv))
    return finer, parent[whose[order]]


def edge_lengths(mesh: Mesh) -> np.ndarray:
    """(F, 3) metres, from each triangle's vertex to the next."""
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1)


def no_longer_than(mesh: Mesh, parent: np.ndarray, limit: float) -> tuple[Mesh, np.ndarray]:
    """The mesh divided until no edge is longer, metres; raises ValueError where that takes too many triangles."""
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1).sum()
    # A triangle without a longer edge has less than half its square.
    if 2 * area / limit**2 > MOST:
        raise ValueError(
            f"{mesh.name!r} makes more than {MOST} triangles with sides of {limit:g} m; make patches larger"
        )
    while np.any(long := edge_lengths(mesh) > limit):
        mesh, parent = divided(mesh, parent, long)
    return mesh, parent


@dataclass(frozen=True, eq=False)
class Elements:
    """T triangles of all shapes, one shape after the other; each has a front (row t) and a back (row T + t).

    meshes : one for each shape
    patch : (T,) the patch that each is a part of
    """

    meshes: tuple[Mesh, ...]
    patch: np.ndarray

    @staticmethod
    def of(scene: DiffuseScene, patch: float, element: float) -> Elements:
        """The scene's shapes with no edge of a patch longer than `patch`, and none of an element than `element`."""
        meshes, patches, before = [], [], 0
        for shape in scene.shapes:
            mesh = as_mesh(shape, quartered=2)
            coarse, _ = no_longer_than(mesh, np.arange(len(mesh.faces)), patch)
            fine, whose = no_longer_than(coarse, np.arange(len(coarse.faces)), min(element, patch))
            meshes.append(fine)
            patches.append(whose + before)
            before += len(coarse.faces)
        return Elements(tuple(meshes), np.concatenate(patches))

    def refined(self, edges: np.ndarray) -> Elements:
        """The same with some edges (T, 3) halved once."""
        pieces = [
            divided(mesh, self.patch[begin:end], edges[begin:end])
            for mesh, begin, end in zip(self.meshes, self.first[:-1], self.first[1:], strict=True)
        ]
        return Elements(tuple(mesh for mesh, _ in pieces), np.concatenate([whose for _, whose in pieces]))

    @cached_property
    def first(self) -> np.ndarray:
        """(S + 1,) each shape's first triangle, and how many there are."""
        return np.concatenate([[0], np.cumsum([len(mesh.faces) for mesh in self.meshes])])

    @cached_property
    def corners(self) -> np.ndarray:
        """(T, 3, 3) metres."""
        return np.concatenate([np.asarray(mesh.vertices, np.float64)[mesh.faces] for mesh in self.meshes])

    @cached_property
    def across(self) -> np.ndarray:
        """(T, 3), area times outward normal."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    @cached_property
    def area(self) -> np.ndarray:
        """(T,) m²; never 0, so that it may divide."""
        return np.maximum(np.linalg.norm(self.across, axis=-1), 1e-30)

    @cached_property
    def normal(self) -> np.ndarray:
        """(T, 3) outward unit normals."""
        return self.across / self.area[:, None]

    @cached_property
    def reflectance(self) -> np.ndarray:
        """(T, 3), at its middle where an image colours a surface."""
        return np.concatenate([_at_middles(mesh, reflectance_of(mesh.material)) for mesh in self.meshes])

    @cached_property
    def emission(self) -> np.ndarray:
        """(T, 3) radiance that the front sends out."""
        return np.concatenate([_at_middles(mesh, emission_of(mesh.material)) for mesh in self.meshes])

    @cached_property
    def vertex(self) -> np.ndarray:
        """(T, 3) the number of each corner's vertex: one for all triangles that meet there without a crease."""
        size = max(float(np.ptp(self.corners.reshape(-1, 3), axis=0).max()), 1e-30)
        keys = np.zeros((*self.corners.shape[:2], 7), np.int64)
        keys[..., :3] = np.round(self.corners / size * 1e6)
        for index, (begin, end) in enumerate(zip(self.first[:-1], self.first[1:], strict=True)):
            keys[begin:end, :, 3] = index
            if self.meshes[index].normals is None:
                keys[begin:end, :, 4:] = np.round(self.normal[begin:end, None] * 1e3)
        return np.unique(keys.reshape(-1, 7), axis=0, return_inverse=True)[1].reshape(-1, 3)

    def at_vertices(self, values: np.ndarray) -> np.ndarray:
        """What elements' sides (2T, 3) hold, as the means round each vertex by area: (2T, 3 corners, 3).

        What nothing reaches is covered by a body that stands on it, and does not darken its neighbours.
        """
        count, vertex = int(self.vertex.max()) + 1, self.vertex.reshape(-1)
        sides = []
        for side in np.split(values, 2):
            weight = np.repeat(self.area * np.any(side > 0, axis=1), 3)
            spread = np.repeat(side, 3, axis=0) * weight[:, None]
            sums = np.stack([np.bincount(vertex, spread[:, k], count) for k in range(3)], axis=-1)
            means = sums / np.maximum(np.bincount(vertex, weight, count), 1e-300)[:, None]
            sides.append(means[self.vertex])
        return np.concatenate(sides)


def _at_middles(mesh: Mesh, value: object) -> np.ndarray:
    """A colour, or an image of them, at the middle of each triangle: (F, 3)."""
    uv = np.zeros((len(mesh.faces), 2)) if mesh.uv is None else mesh.uv[mesh.faces].mean(axis=1)
    return painted(value)(uv)
