"""Surface maps on a mesh, as a glTF material for `relume insert` and everything else that reads glTF.

The maps lie on the mesh as the camera saw it: texture coordinates are the picture's, (0, 0) its lower left corner.
What the camera did not see has one material of the maps' medians. Metres, world frame.
"""

from __future__ import annotations

import json
import os
import struct
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from relume.composite.projection import projected
from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.photograph import Photograph
from relume.lightstage.surface_maps import SurfaceMaps
from relume.scene.camera import Camera
from relume.scene.materials import Material
from relume.scene.shapes import Mesh

FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
CLAMP = 33071
"""Numbers of glTF 2.0, §5: kinds of components, uses of a buffer, a texture that ends at its rim."""
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
    mesh: Mesh,
    camera: Camera,
    maps: SurfaceMaps,
    others: tuple[Mesh, ...] = (),
    texturing: Texturing = Texturing(),
) -> None:
    """Write the mesh with the maps as its material as a .glb file, whole or not at all; see `textured`.

    Raises ValueError as `textured` does and for another suffix, OutputNotWritten.
    """
    write_glb(path, textured(mesh, camera, maps, others, texturing))


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


class _Contents:
    """What is gathered for a file: its header and its one buffer."""

    def __init__(self) -> None:
        self.buffer = bytearray()
        self.header: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "relume"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "samplers": [{"wrapS": CLAMP, "wrapT": CLAMP}],
        }

    def entry(self, kind: str, value: dict[str, Any]) -> int:
        """The index of a new entry of this kind."""
        entries = self.header.setdefault(kind, [])
        entries.append(value)
        return len(entries) - 1

    def view(self, data: bytes, target: int | None = None) -> int:
        """The buffer view of these bytes, which begin at a multiple of four."""
        self.buffer += b"\0" * (-len(self.buffer) % 4)
        place: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data)}
        if target is not None:
            place["target"] = target
        self.buffer += data
        return self.entry("bufferViews", place)

    def numbers(self, values: np.ndarray, kind: str, component: int, target: int) -> int:
        """The accessor of an array, (N, K) or (N,)."""
        accessor: dict[str, Any] = {
            "bufferView": self.view(np.ascontiguousarray(values).tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": kind,
            "min": np.atleast_1d(values.min(axis=0)).tolist(),
            "max": np.atleast_1d(values.max(axis=0)).tolist(),
        }
        return self.entry("accessors", accessor)

    def texture(self, pixels: np.ndarray) -> dict[str, int]:
        """The texture of a picture (H, W, 3), 0 to 1 as stored: 8 bits."""
        image = {"bufferView": self.view(_png(pixels)), "mimeType": "image/png"}
        return {"index": self.entry("textures", {"source": self.entry("images", image), "sampler": 0})}


def write_glb(path: str | os.PathLike[str], meshes: tuple[Mesh, ...]) -> None:
    """Write meshes as a .glb file, whole or not at all.

    Base colour, roughness, metal and specular colour of their materials are written, as images of 8 bits where they
    are images; colours are encoded as sRGB, as glTF wants them.
    Raises ValueError for another suffix or another kind of material, OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".glb":
        raise ValueError(f"{path}: materials are written as .glb; give it that suffix")
    contents = _Contents()
    for mesh in meshes:
        node = {"mesh": contents.entry("meshes", _gltf_mesh(contents, mesh)), "name": mesh.name}
        contents.header["scenes"][0]["nodes"].append(contents.entry("nodes", node))
    contents.header["buffers"] = [{"byteLength": len(contents.buffer)}]
    text = json.dumps(contents.header).encode()
    text += b" " * (-len(text) % 4)
    data = bytes(contents.buffer) + b"\0" * (-len(contents.buffer) % 4)
    with files.replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
        stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
        stream.write(struct.pack("<I4s", len(data), b"BIN\0") + data)


def _gltf_mesh(contents: _Contents, mesh: Mesh) -> dict[str, Any]:
    attributes = {"POSITION": contents.numbers(mesh.vertices.astype("<f4"), "VEC3", FLOAT, VERTICES)}
    if mesh.normals is not None:
        attributes["NORMAL"] = contents.numbers(mesh.normals.astype("<f4"), "VEC3", FLOAT, VERTICES)
    if mesh.uv is not None:
        # glTF's texture coordinates go downwards.
        down = (mesh.uv * [1, -1] + [0, 1]).astype("<f4")
        attributes["TEXCOORD_0"] = contents.numbers(down, "VEC2", FLOAT, VERTICES)
    indices = contents.numbers(mesh.faces.astype("<u4").reshape(-1), "SCALAR", UNSIGNED, INDICES)
    material = contents.entry("materials", _gltf_material(contents, mesh))
    return {"primitives": [{"attributes": attributes, "indices": indices, "material": material}], "name": mesh.name}


def _gltf_material(contents: _Contents, mesh: Mesh) -> dict[str, Any]:
    material = mesh.material
    if not isinstance(material, Material):
        raise ValueError(f"the material of {mesh.name!r} is a {type(material).__name__}; expected a Material")
    surface: dict[str, Any] = {}
    if isinstance(material.base_color, np.ndarray):
        surface["baseColorTexture"] = contents.texture(encode_srgb(material.base_color))
    else:
        surface["baseColorFactor"] = [*material.base_color, 1.0]
    if isinstance(material.roughness, np.ndarray) or isinstance(material.metallic, np.ndarray):
        rough, metal = np.broadcast_arrays(material.roughness, material.metallic)
        # Green is the roughness, blue the metal.
        surface["metallicRoughnessTexture"] = contents.texture(np.stack([np.zeros_like(rough), rough, metal], axis=-1))
    else:
        surface |= {"roughnessFactor": float(material.roughness), "metallicFactor": float(material.metallic)}
    described: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
    if specular := _specular(contents, material):
        described["extensions"] = {"KHR_materials_specular": specular}
        contents.header["extensionsUsed"] = ["KHR_materials_specular"]
    return described


def _specular(contents: _Contents, material: Material) -> dict[str, Any]:
    """KHR_materials_specular: an image of what is at most 1, times a factor that may be more."""
    colour = np.asarray(material.specular_color)
    if colour.ndim == 1:
        return {} if np.all(colour == 1) else {"specularColorFactor": colour.tolist()}
    highest = max(float(colour.max()), 1e-6)
    return {
        "specularColorFactor": [highest] * 3,
        "specularColorTexture": contents.texture(encode_srgb(colour / highest)),
    }


def _png(pixels: np.ndarray) -> bytes:
    """A PNG of 8 bits of values from 0 to 1."""
    whole = np.round(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "texture.png"
        files.write(picture, Photograph(whole))
        return picture.read_bytes()
