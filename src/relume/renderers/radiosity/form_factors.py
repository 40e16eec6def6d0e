"""Form factors between the shapes of a scene, by rays: the share of one's diffuse light that another receives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.renderers.diffuse.scenes import NEAR
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.scene import Scene
from relume.scene.shapes.tessellation import as_mesh
from relume.sphere.sampling import by_cosine, chosen, sequences, within_triangles


@dataclass(frozen=True, eq=False)
class FormFactors:
    """How S shapes see each other.

    factors : (S, S), from the outer side of the row's shape to that of the column's; 1 − a row's sum is what leaves the
        scene or ends on the inner side of something
    deviation : (S, S), the standard deviation of the factors at most: that of rays that are independent
    area : (S,) m²
    """

    factors: np.ndarray
    deviation: np.ndarray
    area: np.ndarray


def form_factors(scene: Scene, *, rays: int = 1 << 16, seed: int = 0) -> FormFactors:
    """The form factors between all shapes of a scene, the local ones first.

    scene : whose shapes they are; its light is not used
    rays : from each shape; what they carry does not matter, so that any material will do
    seed : of the rays
    Raises ValueError for less than one ray.
    """
    if rays < 1:
        raise ValueError(f"rays is {rays}; expected at least 1")
    meshes = [as_mesh(shape) for shape in (*scene.local, *scene.objects)]
    caster = RayCaster.of(meshes)
    corners = [np.asarray(mesh.vertices, np.float64)[mesh.faces] for mesh in meshes]
    across = [0.5 * np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]) for each in corners]
    size = float(np.ptp(np.concatenate(corners).reshape(-1, 3), axis=0).max())
    factors, area = np.zeros((len(meshes), len(meshes))), np.zeros(len(meshes))
    for index, (triangles, normals) in enumerate(zip(corners, across, strict=True)):
        areas = np.linalg.norm(normals, axis=-1)
        area[index] = areas.sum()
        # The first number chooses the triangle, two the place in it, two the direction.
        u = sequences(np.random.default_rng([seed, index]), rays, 5)[0]
        which = chosen(u[:, 0], np.cumsum(areas))
        points, _ = within_triangles(u[:, 1:3], triangles[which])
        directions = by_cosine(u[:, 3:], normals[which] / areas[which, None])
        hits = caster.nearest(points, directions, beyond=NEAR * size)
        there = np.flatnonzero(hits.shape >= 0)
        for other in range(len(meshes)):
            met = there[hits.shape[there] == other]
            front = np.einsum("ij,ij->i", across[other][hits.primitive[met]], directions[met]) < 0
            factors[index, other] = front.sum() / rays
    return FormFactors(factors, np.sqrt(factors * (1 - factors) / rays), area)
