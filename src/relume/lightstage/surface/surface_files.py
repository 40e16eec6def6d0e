"""What a subject's surface is like, from its stage to files: what `relume stage separate` calls.

The maps lie on a mesh as the camera saw it, as a glTF material for `relume insert` and everything else that reads glTF:
texture coordinates are the picture's, (0, 0) its lower left corner. What the camera did not see has one material of the
maps' medians. Metres, world frame.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from relume.composite.surface.projection import projected
from relume.errors import warn
from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files.atomic import made_folder
from relume.image.photograph import Photograph
from relume.lightstage.blocks import Cluster, scratch_if
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.polarised import PolarisedPair
from relume.lightstage.relighting.relighting import MEMORY, Progress
from relume.lightstage.surface.surface_maps import DIELECTRIC, MAPS, SurfaceMaps, surface_maps, surface_maps_by_colour
from relume.scene.cameras.camera import Camera
from relume.scene.gltf.writing import write_glb
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh

SOOT = 0.01
"""An albedo below that of soot and black velvet."""
MAP_BYTES = 80
"""Bytes a pixel of the maps, and of those that a separation needs for them."""
LEAST_OVERLAP = 0.5
"""Share of the mesh's seen surface, as the picture shows it, that must lie on known pixels of the maps; less, and the
mesh is that of another subject, pose or camera."""
LEAST_WEIGHT = 0.02
"""Of a pixel (`SurfaceMaps.weight`) below which it is filled in from its neighbours."""
LARGEST_TURN = np.pi / 3
"""Radians between the normal of the maps and the mesh's beyond which the mesh's stands."""


def measure_surface(
    field: ReflectanceField,
    crossed: ReflectanceField | None = None,
    *,
    cluster: Cluster = None,
    memory: int = MEMORY,
    scratch: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> SurfaceMaps:
    """Normals, albedo, specular energy and reflectance, and roughness of a subject (Debevec et al. 2000, §4.2).

    Diffuse and specular reflection are separated by the colour of the light, or from a pair of polarised stages, which
    grey and black subjects need.

    field : one light at a time, by one camera
    crossed : the same stage through a crossed polariser; `field` is then the parallel one
    cluster : whose workers take bands of rows, as `relume.cluster.run_tasks` takes it; this process for None, with the
        same bytes. Incomplete names the rows that failed
    memory : bytes for a band of rows, of each worker
    scratch : a folder, or an fsspec URL, that every worker sees, for what bands write until it is put together; the
        system's temporary folder unless given
    progress : called with the share of the work that is done, 0 to 1
    Warns of an albedo that no subject has. Raises ValueError where no pixel can be explained.
    """
    large = field.shape[0] * field.shape[1] * MAP_BYTES > memory // 2
    with scratch_if(large, scratch, cluster) as place:
        if crossed is None:
            maps = surface_maps_by_colour(field, cluster=cluster, place=place, memory=memory, progress=progress)
        else:
            pair = PolarisedPair(field, crossed)
            maps = surface_maps(pair, cluster=cluster, place=place, memory=memory, progress=progress)
    known = maps.weight > 0
    if not known.any():
        raise ValueError(
            f"none of the {known.size} pixels answers to the lights as a surface does; check the pictures and the "
            "directions of the lights"
        )
    # Pictures hold the albedo in the unit of the lights' irradiance.
    usual = float(np.median(maps.albedo[known].mean(axis=-1)))
    if not SOOT < usual < 1:
        warn(
            f"the median albedo is {usual:.3g}, which no subject has: the lights' irradiance is given too "
            f"{'small' if usual >= 1 else 'large'}, or not at all; normals and roughness alone are right"
        )
    return maps


def write_surface(
    folder: str | os.PathLike[str], maps: SurfaceMaps, meshes: Sequence[Mesh] = (), camera: Camera | None = None
) -> tuple[Path, ...]:
    """Write maps.exr, a .png of each map and, with meshes, subject.glb with the maps as its material.

    folder : made where it is missing
    maps : as `measure_surface` found them
    meshes : of the subject, metres, in the stage's frame
    camera : that the maps were taken with; needed with meshes
    Returns the files. Raises ValueError where no mesh has anything of the maps, OutputNotWritten.
    """
    if meshes and camera is None:
        raise ValueError("the mesh needs the stage's camera; give it in stage.json")
    place = made_folder(folder)
    files.write_layers(place / "maps.exr", {name: getattr(maps, name) for name in MAPS})
    for name, picture in maps.pictures().items():
        # Albedo as the eye expects it; numbers of directions and shares as they are.
        shown = encode_srgb(picture) if name == "albedo" else picture
        codes = np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)
        files.write(place / f"{name}.png", Photograph(codes))
    written = [place / "maps.exr", *(place / f"{name}.png" for name in MAPS)]
    if meshes and camera is not None:
        write_material(place / "subject.glb", meshes, camera, maps)
        written.append(place / "subject.glb")
    return tuple(written)


def textured(mesh: Mesh, camera: Camera, maps: SurfaceMaps, others: tuple[Mesh, ...] = ()) -> tuple[Mesh, ...]:
    """The mesh with the maps as its material: what the camera saw of it, then the rest of it where there is any.

    others : meshes that may hide it from the camera
    The diffuse albedo becomes the base colour of a dielectric, the reflectance at normal incidence its specular
    colour, the roughness its own; the normals of the maps become the normals of the vertices.
    Raises ValueError where the camera's size is not the maps', does not see the mesh, or the maps know too little
    of it.
    """
    if maps.albedo.shape[:2] != (camera.height, camera.width):
        raise ValueError(
            f"the camera takes pictures of {camera.width}×{camera.height}, but the maps are "
            f"{maps.albedo.shape[1]}×{maps.albedo.shape[0]}; give the camera they were taken with"
        )
    parts = projected(mesh, camera, others)
    if parts.seen is None:
        raise ValueError(f"the camera does not see the mesh {mesh.name!r}; check its placement and the camera's")
    known = maps.weight > LEAST_WEIGHT
    rows, columns, areas = _triangles(parts.seen, known.shape)
    overlap = float((areas * known[rows, columns]).sum() / max(areas.sum(), 1e-30))
    if overlap < LEAST_OVERLAP:
        raise ValueError(
            f"only {overlap:.0%} of the mesh {mesh.name!r} lies on known pixels of the maps; expected "
            f"{LEAST_OVERLAP:.0%} or more: is it this subject's, in this pose, and the camera the field's?"
        )
    nearest = _nearest_inner(known)
    normals = _normals(parts.seen, maps.normal[nearest])
    seen = replace(parts.seen, material=_material(maps, nearest, mesh.name), normals=normals)
    if parts.unseen is None:
        return (seen,)
    shown = np.zeros_like(known)
    shown[rows, columns] = known[rows, columns]
    rest = _median_material(maps, shown, mesh.name)
    return seen, replace(parts.unseen, material=rest, uv=None, name=rest.name)


def write_material(path: str | os.PathLike[str], meshes: Sequence[Mesh], camera: Camera, maps: SurfaceMaps) -> None:
    """Write the meshes that the maps know, with the maps as their material, as a .glb file, whole or not at all.

    Warns of meshes that are left out. Raises ValueError as `textured` where none is left, and for another suffix;
    OutputNotWritten.
    """
    made, faults = [], []
    for index, mesh in enumerate(meshes):
        try:
            made += textured(mesh, camera, maps, (*meshes[:index], *meshes[index + 1 :]))
        except ValueError as error:
            faults.append(str(error))
    if not made:
        raise ValueError(faults[0])
    for fault in faults:
        warn(f"{fault}; it is left out of {os.fspath(path)}")
    write_glb(path, tuple(made))


def _triangles(mesh: Mesh, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (M,) of the pixels of the triangles' middles, and the areas (M,) that the picture shows."""
    assert mesh.uv is not None
    height, width = shape
    corners = mesh.uv[mesh.faces].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    u, v = corners.mean(axis=1).T
    rows = np.clip(((1 - v) * height).astype(int), 0, height - 1)
    columns = np.clip((u * width).astype(int), 0, width - 1)
    return rows, columns, np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _nearest_inner(known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns (H, W) of the nearest known pixel, but not one of its rim.

    Pixels of the outline hold the background too, and a texture is looked up between pixels.
    """
    inner = np.asarray(ndimage.binary_erosion(known), bool)
    inner = inner if inner.any() else known
    nearest = ndimage.distance_transform_edt(np.logical_not(inner), return_distances=False, return_indices=True)
    rows, columns = np.asarray(nearest)
    return rows, columns


def _material(maps: SurfaceMaps, nearest: tuple[np.ndarray, np.ndarray], name: str) -> Material:
    specular = np.clip(maps.specular_reflectance[nearest] / DIELECTRIC, 0, 1 / DIELECTRIC)
    return Material(
        base_color=np.clip(maps.albedo[nearest], 0, 1),
        roughness=np.clip(maps.roughness[nearest], 0, 1),
        specular_color=np.repeat(specular[..., None], 3, axis=-1),
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


def _normals(mesh: Mesh, picture: np.ndarray) -> np.ndarray:
    """Unit normals (N, 3) of the vertices: the picture's (H, W, 3) between pixels, the mesh's where they disagree."""
    assert mesh.uv is not None
    height, width = picture.shape[:2]
    at = [(1 - mesh.uv[:, 1]) * height - 0.5, mesh.uv[:, 0] * width - 0.5]
    mapped = np.stack([ndimage.map_coordinates(picture[..., i], at, order=1, mode="nearest") for i in range(3)], -1)
    length = np.linalg.norm(mapped, axis=1, keepdims=True)
    mapped = np.divide(mapped, length, out=np.zeros_like(mapped), where=length > 1e-6)
    own = _own_normals(mesh)
    agree = np.einsum("ij,ij->i", mapped, own) > np.cos(LARGEST_TURN)
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
