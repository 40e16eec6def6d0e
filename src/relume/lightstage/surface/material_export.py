"""Surface maps on a mesh, as a glTF material for `relume insert` and everything else that reads glTF.

The maps lie on the mesh as the camera saw it: texture coordinates are the picture's, (0, 0) its lower left corner.
What the camera did not see has one material of the maps' medians. Metres, world frame.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from relume.lightstage.surface.surface_maps import SurfaceMaps
from relume.scene.cameras.camera import Camera
from relume.scene.gltf.writing import write_glb
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh
from relume.surface.projection import projected

DIELECTRIC = 0.04
"""What a dielectric of glTF reflects at normal incidence unless its specular colour says otherwise."""


@dataclass(frozen=True)
class Texturing:
    """How maps are laid on a mesh.

    least_overlap : share of the mesh's seen surface, as the picture shows it, that must lie on known pixels of the
        maps; less, and the mesh is that of another subject, pose or camera
    least_weight : of a pixel (`SurfaceMaps.weight`) below which it is filled in from its neighbours
    largest_turn : radians between the normal of the maps and the mesh's beyond which the mesh's stands
    """

    least_overlap: float = 0.5
    least_weight: float = 0.02
    largest_turn: float = np.pi / 3


def textured(
    mesh: Mesh, camera: Camera, maps: SurfaceMaps, others: tuple[Mesh, ...] = (), texturing: Texturing = Texturing()
) -> tuple[Mesh, ...]:
    """The mesh with the maps as its material: what the camera saw of it, then the rest of it where there is any.

    others : meshes that may hide it from the camera
    The diffuse albedo becomes the base colour of a dielectric, the reflectance at normal incidence its specular
    colour, the roughness its own; the normals of the maps become the normals of the vertices.
    Raises ValueError where the camera's size is not the maps', does not see the mesh, or the maps know less of it
    than `texturing` asks for.
    """
    if maps.albedo.shape[:2] != (camera.height, camera.width):
        raise ValueError(
            f"the camera takes pictures of {camera.width}×{camera.height}, but the maps are "
            f"{maps.albedo.shape[1]}×{maps.albedo.shape[0]}; give the camera they were taken with"
        )
    parts = projected(mesh, camera, others)
    if parts.seen is None:
        raise ValueError(f"the camera does not see the mesh {mesh.name!r}; check its placement and the camera's")
    known = maps.weight > texturing.least_weight
    overlap = _overlap(parts.seen, known)
    if overlap < texturing.least_overlap:
        raise ValueError(
            f"only {overlap:.0%} of the mesh {mesh.name!r} lies on known pixels of the maps; expected "
            f"{texturing.least_overlap:.0%} or more: is it this subject's, in this pose, and the camera the field's?"
        )
    seen = replace(
        parts.seen, material=_material(maps, known, mesh.name), normals=_normals(parts.seen, maps, known, texturing)
    )
    if parts.unseen is None:
        return (seen,)
    rest = _median_material(maps, _on(parts.seen, known), mesh.name)
    return seen, replace(parts.unseen, material=rest, uv=None, name=rest.name)


def write_material(
    path: str | os.PathLike[str],
    meshes: Sequence[Mesh],
    camera: Camera,
    maps: SurfaceMaps,
    texturing: Texturing = Texturing(),
) -> None:
    """Write the meshes that the maps know, with the maps as their material, as a .glb file, whole or not at all.

    Warns of meshes that are left out. Raises ValueError as `textured` where none is left, and for another suffix;
    OutputNotWritten.
    """
    made, faults = [], []
    for index, mesh in enumerate(meshes):
        try:
            made += textured(mesh, camera, maps, (*meshes[:index], *meshes[index + 1 :]), texturing)
        except ValueError as error:
            faults.append(str(error))
    if not made:
        raise ValueError(faults[0])
    for fault in faults:
        warnings.warn(f"{fault}; it is left out of {os.fspath(path)}", stacklevel=2)
    write_glb(path, tuple(made))


def _pixel_of(shape: tuple[int, ...], uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels that texture coordinates (…, 2) lie in."""
    height, width = shape[:2]
    columns = np.clip((uv[..., 0] * width).astype(int), 0, width - 1)
    return np.clip(((1 - uv[..., 1]) * height).astype(int), 0, height - 1), columns


def _middles(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Texture coordinates (M, 2) of the triangles' middles and the areas (M,) that the picture shows of them."""
    if mesh.uv is None:
        raise ValueError(f"the mesh {mesh.name!r} has no texture coordinates")
    corners = mesh.uv[mesh.faces].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return corners.mean(axis=1), np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _overlap(mesh: Mesh, known: np.ndarray) -> float:
    """Share of what the picture shows of the mesh that lies on known pixels."""
    middles, areas = _middles(mesh)
    rows, columns = _pixel_of(known.shape, middles)
    return float((areas * known[rows, columns]).sum() / max(areas.sum(), 1e-30))


def _on(mesh: Mesh, known: np.ndarray) -> np.ndarray:
    """The known pixels (H, W) bool in which the mesh's triangles lie."""
    rows, columns = _pixel_of(known.shape, _middles(mesh)[0])
    chosen = np.zeros_like(known)
    chosen[rows, columns] = True
    return chosen & known


def _filled(picture: np.ndarray, known: np.ndarray) -> np.ndarray:
    """The picture with its unknown pixels taken from the nearest known one, but not from its rim.

    Pixels of the outline hold the background too, and a texture is looked up between pixels.
    """
    inner = np.asarray(ndimage.binary_erosion(known), bool)
    inner = inner if inner.any() else known
    nearest = ndimage.distance_transform_edt(np.logical_not(inner), return_distances=False, return_indices=True)
    rows, columns = np.asarray(nearest)
    return picture[rows, columns]


def _material(maps: SurfaceMaps, known: np.ndarray, name: str) -> Material:
    reflectance = _filled(maps.specular_reflectance, known) / DIELECTRIC
    return Material(
        base_color=np.clip(_filled(maps.albedo, known), 0, 1),
        roughness=np.clip(_filled(maps.roughness, known), 0, 1),
        specular_color=np.repeat(np.clip(reflectance, 0, 1 / DIELECTRIC)[..., None], 3, axis=-1),
        name=name,
    )


def _median_material(maps: SurfaceMaps, chosen: np.ndarray, name: str) -> Material:
    """One material for what was not seen: the medians over the pixels of what was."""
    red, green, blue = (float(value) for value in np.clip(np.median(maps.albedo[chosen], axis=0), 0, 1))
    specular = float(np.clip(np.median(maps.specular_reflectance[chosen]) / DIELECTRIC, 0, 1 / DIELECTRIC))
    return Material(
        base_color=(red, green, blue),
        roughness=float(np.clip(np.median(maps.roughness[chosen]), 0, 1)),
        specular_color=(specular, specular, specular),
        name=f"{name}, unseen",
    )


def _normals(mesh: Mesh, maps: SurfaceMaps, known: np.ndarray, texturing: Texturing) -> np.ndarray:
    """Unit normals (N, 3) of the vertices: the maps' between pixels, the mesh's where the two disagree."""
    if mesh.uv is None:
        raise ValueError(f"the mesh {mesh.name!r} has no texture coordinates")
    height, width = known.shape
    at = [(1 - mesh.uv[:, 1]) * height - 0.5, mesh.uv[:, 0] * width - 0.5]
    picture = _filled(maps.normal, known)
    mapped = np.stack([ndimage.map_coordinates(picture[..., i], at, order=1, mode="nearest") for i in range(3)], -1)
    length = np.linalg.norm(mapped, axis=1, keepdims=True)
    mapped = np.divide(mapped, length, out=np.zeros_like(mapped), where=length > 1e-6)
    own = _own_normals(mesh)
    agree = np.einsum("ij,ij->i", mapped, own) > np.cos(texturing.largest_turn)
    return np.where(agree[:, None], mapped, own).astype(np.float32)


def _own_normals(mesh: Mesh) -> np.ndarray:
    """The mesh's normals (N, 3); where it has none, those of the triangles about each vertex."""
    if mesh.normals is not None:
        return mesh.normals
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(total, mesh.faces[:, corner], across)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30))
