"""A place's radiance in textures: photographs blended once and for all, holes filled from what surrounds them.

The textures shine: a baked place is a mesh of light that is seen, and lights objects, from wherever it is looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.spatial import KDTree

from relume.renderers.projective.atlas import Atlas, atlas_of, face_normals
from relume.renderers.projective.blending import VIEWS, Blend, blended
from relume.renderers.projective.photographs import ProjectedPhotograph, Projector, projectors
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh

NEIGHBOURS = 24
"""Known texels that fill one of a hole: enough that no single one is drawn out into it."""
FINEST = 0.25
"""Of the mesh's parts, the share that the photographs show more finely than the texels are."""

MOST = 16384**2
"""Texels of one mesh, at most, that may be asked for: a picture as large as graphics cards take, 3 GB of colour."""


@dataclass(frozen=True, eq=False)
class BakedMesh:
    """A mesh whose surface shines as photographs showed it.

    mesh : black but for its emission, an image (H, W, 3) over texture coordinates of its own
    seen : (H, W) bool, texels that a photograph shows; the others were filled, or lie on no surface
    used : (H, W) bool, texels whose middle lies on the surface
    points : (H, W, 3) float32, where each texel lies, metres, world; NaN where it lies on no surface
    faces : (H, W) int32, the triangle of the mesh that it lies on; −1 for none
    texel : metres
    """

    mesh: Mesh
    seen: np.ndarray
    used: np.ndarray
    points: np.ndarray
    faces: np.ndarray
    texel: float

    @property
    def radiance(self) -> np.ndarray:
        """The radiance (H, W, 3) float32 of the texels, in the photographs' unit."""
        assert isinstance(self.mesh.material, Material)
        return np.asarray(self.mesh.material.emission)

    def shining(self, radiance: np.ndarray) -> BakedMesh:
        """The same mesh with another `radiance` (H, W, 3)."""
        material = replace(self.mesh.material, emission=np.ascontiguousarray(radiance, np.float32))
        return replace(self, mesh=replace(self.mesh, material=material))

    @property
    def normals(self) -> np.ndarray:
        """The unit normals (M, 3) float64 of its triangles, to the side that they shine to."""
        return face_normals(self.mesh)[0]

    @property
    def holes(self) -> float:
        """The share of its surface that no photograph shows, 0 to 1."""
        return 1 - float(self.seen[self.used].mean()) if self.used.any() else 0.0


@dataclass(frozen=True, eq=False)
class BakedPlace:
    """The meshes of a place with their radiance.

    parts : one of each mesh, in their order
    unit : of the radiance
    """

    parts: tuple[BakedMesh, ...]
    unit: str = "relative"

    def known(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Points (N, 3) and radiance (N, 3) of the seen texels of a mesh, or of all meshes where it has none.

        index : of the mesh, from 0
        """
        parts = [self.parts[index]] if self.parts[index].seen.any() else self.parts
        return (
            np.concatenate([part.points[part.seen] for part in parts]).astype(np.float64),
            np.concatenate([part.radiance[part.seen] for part in parts]),
        )

    def meshes(self) -> tuple[Mesh, ...]:
        """Meshes that shine: the real surfaces of a scene that is lit by them."""
        return tuple(part.mesh for part in self.parts)

    @property
    def holes(self) -> float:
        """The share of all surface that no photograph shows, 0 to 1."""
        areas = np.array([part.used.sum() * part.texel**2 for part in self.parts])
        return float(areas @ [part.holes for part in self.parts] / max(areas.sum(), 1e-300))


def bake(
    meshes: Sequence[Mesh], photographs: Sequence[ProjectedPhotograph], *,
    texel: float | None = None, largest: int = 2048, views: int = VIEWS,
) -> BakedPlace:  # fmt: skip
    """The radiance of a place's meshes in a texture each, as photographs of it show it.

    meshes : metres, world. Triangles turn to the side from which photographs see them, for a surface shines to one
    photographs : of radiance in one unit
    texel : metres; as fine as the photographs show a quarter of the surface, unless given
    largest : texels along a side of a texture; a finer one gets coarser. 2048² are 50 MB of float32 colour
    views : photographs that a texel is blended of at most; 3, as triangles of views are blended (Debevec, Yu &
        Borshukov 1998)

    Holes are filled from the nearest known texels of the same mesh, by inverse squared distance (Shepard 1968).
    Raises ValueError for no meshes, no photographs, units that differ, photographs that show none of the meshes, and a
    texel of no width or of which a mesh has more than 16384².
    """
    if not meshes:
        raise ValueError("there are no meshes to bake; give the place's")
    if texel is not None:
        _require_texel(texel, meshes)
    units = {photograph.radiance.unit for photograph in photographs}
    if len(units) > 1:
        raise ValueError("some photographs are calibrated (cd/m²) and some relative; bring them to one scale first")
    caster = RayCaster.of(meshes)
    among = projectors(photographs, caster)
    atlases = [atlas_of(mesh, _fineness(mesh, among) if texel is None else texel, largest) for mesh in meshes]
    found = [_shown(atlas, among, views) for atlas in atlases]
    if not any(blend.seen.any() for blend, _ in found):
        raise ValueError("no photograph shows any of the meshes; are cameras and meshes of one place, in metres?")
    everywhere = _known(atlases, [blend for blend, _ in found])
    parts = tuple(
        _part(atlas, blend, turned, everywhere) for atlas, (blend, turned) in zip(atlases, found, strict=True)
    )
    return BakedPlace(parts, units.pop())


def _require_texel(texel: float, meshes: Sequence[Mesh]) -> None:
    if not 0 < texel < np.inf:
        raise ValueError(f"texel is {texel}; expected its width in metres, like 0.01")
    for mesh in meshes:
        area = float(face_normals(mesh)[1].sum())
        if not area / texel / texel <= MOST:
            raise ValueError(
                f"texel is {texel} m, of which {mesh.name!r} with its {area:.3g} m² has {area / texel / texel:.2g}; a "
                f"texture has {MOST:.2g} at most: give {1.01 * (area / MOST) ** 0.5:.2g} or more"
            )


def _fineness(mesh: Mesh, among: Sequence[Projector]) -> float:
    """The width of texel that is as fine as the photographs show a mesh, metres."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    normals, area = face_normals(mesh)
    # Places spread over the triangles, as many as their area is of the whole; each triangle's middle at least.
    share = np.maximum((2000 * area / max(area.sum(), 1e-300)).astype(int), 1)
    face = np.repeat(np.arange(len(area)), share)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], len(face))
    points = np.einsum("tc,tcx->tx", weights, corners[face])
    finest = np.full(len(points), np.inf)
    for projector in among:
        there = np.flatnonzero(projector.sees(points)[1] > 0)
        width = projector.footprints(points[there], normals[face[there]])
        finest[there] = np.minimum(finest[there], width)
    seen = finest[np.isfinite(finest)]
    # Of a mesh that nobody sees any texel serves.
    return float(np.quantile(seen, FINEST)) if seen.size else float(np.sqrt(area.sum())) / 16


def _shown(atlas: Atlas, among: Sequence[Projector], views: int) -> tuple[Blend, np.ndarray]:
    """What photographs show of an atlas's texels, and which triangles (M,) they see from behind."""
    blend = blended(among, atlas.points, atlas.normals, None, views)
    eyes = np.array([projector.photograph.camera.position for projector in among])
    there = np.flatnonzero(blend.seen)
    facing = np.einsum("ij,ij->i", eyes[blend.best[there]] - atlas.points[there], atlas.normals[there])
    balance = np.bincount(atlas.faces[there], np.sign(facing), len(atlas.mesh.faces))
    return blend, balance < 0


def _known(atlases: Sequence[Atlas], blends: Sequence[Blend]) -> tuple[np.ndarray, np.ndarray]:
    """Points and radiance of all texels that are seen."""
    points = np.concatenate([atlas.points[blend.seen] for atlas, blend in zip(atlases, blends, strict=True)])
    return points, np.concatenate([blend.radiance[blend.seen] for blend in blends])


def _part(atlas: Atlas, blend: Blend, turned: np.ndarray, everywhere: tuple[np.ndarray, np.ndarray]) -> BakedMesh:
    values = blend.radiance.copy()
    if not blend.seen.all():
        own = (atlas.points[blend.seen], blend.radiance[blend.seen]) if blend.seen.any() else everywhere
        values[~blend.seen] = filled(atlas.points[~blend.seen], *own)
    width, height = atlas.size
    image, used, seen = np.zeros((height, width, 3), np.float32), *np.zeros((2, height, width), bool)
    points, face = np.full((height, width, 3), np.nan, np.float32), np.full((height, width), -1, np.int32)
    face[atlas.rows, atlas.columns] = atlas.faces
    image[atlas.rows, atlas.columns], points[atlas.rows, atlas.columns] = values, atlas.points
    seen[atlas.rows, atlas.columns], used[atlas.rows, atlas.columns] = blend.seen, atlas.inner
    # What lies on no surface continues what does, for programs that look a texture up coarsely.
    known = np.zeros((height, width), bool)
    known[atlas.rows, atlas.columns] = True
    row, column = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
    material = Material(
        (0.0, 0.0, 0.0), specular=0.0, emission=np.ascontiguousarray(image[row, column]), name=atlas.mesh.name
    )
    faces = np.where(turned[:, None], atlas.mesh.faces[:, ::-1], atlas.mesh.faces)
    mesh = replace(atlas.mesh, faces=np.ascontiguousarray(faces), material=material, normals=None)
    return BakedMesh(mesh, seen, used, points, face, atlas.texel)


def filled(wanted: np.ndarray, points: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The mean of values (N, 3) at points (N, 3) about each wanted point (M, 3), by inverse squared distance."""
    count = min(NEIGHBOURS, len(points))
    away, index = KDTree(points).query(wanted, k=count)
    away, index = away.reshape(len(wanted), count), index.reshape(len(wanted), count)
    weights = 1 / np.maximum(away, 1e-9) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("mk,mkc->mc", weights, values[index]).astype(np.float32)
