"""Meshes with their materials as a glTF binary, .glb (glTF 2.0 and its ratified material extensions)."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files.photographs import png
from relume.scene.gltf.textures import CLAMP, REPEAT
from relume.scene.materials.materials import Diffuse, Material, enlarged, is_image, mean_colour, mean_number
from relume.scene.shapes.shapes import Mesh

FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
"""Numbers of glTF 2.0, §5: kinds of components, uses of a buffer."""
SOLID = 1.0
"""thicknessFactor of a body: path tracers follow its own walls, and any thickness above 0 says that it has some."""


SHOWN = 0.99
"""Of an emission that a file beside holds whole, the share that its picture of 8 bits shows; brighter is cut off."""
RADIANCE = "relume_radiance"
"""Of a material's extras: the file beside, scene-linear and in full precision, of what its emissiveTexture shows."""


def write_glb(path: str | os.PathLike[str], meshes: Sequence[Mesh], *, radiance: Mapping[str, str] = {}) -> None:
    """Write meshes whose images end at their rims as a .glb file, whole or not at all; see `glb`.

    Raises ValueError for another suffix or another kind of material, OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".glb":
        raise ValueError(f"{path}: materials are written as .glb; give it that suffix")
    data = glb(meshes, repeats=False, radiance=radiance)
    with files.replacing(path) as temporary:
        Path(temporary).write_bytes(data)


def glb(
    meshes: Sequence[Mesh], *, images: bool = True, repeats: bool = True, radiance: Mapping[str, str] = {}
) -> bytes:
    """A .glb of the meshes: a node each of the mesh's name at the origin, vertices in world coordinates, metres.

    images : keep images over the texture coordinates, as PNG of 8 bits; else their means are in their place
    repeats : images repeat beyond their rim; else they end there
    radiance : by the name of a mesh, the file beside that holds its emission whole: an image of 8 bits cannot

    Ray tracers read attenuation and transmission as those of solid bodies; `thin` bodies get no thickness.
    Raises ValueError for a material that is neither a Material nor Diffuse.
    """
    contents = _Contents(images, REPEAT if repeats else CLAMP, radiance)
    for mesh in meshes:
        node = {"name": mesh.name, "mesh": contents.entry("meshes", _mesh(mesh, contents))}
        contents.header["scenes"][0]["nodes"].append(contents.entry("nodes", node))
    header = contents.header
    used = sorted({key for material in header.get("materials", []) for key in material.get("extensions", {})})
    header |= {"buffers": [{"byteLength": len(contents.buffer)}]} | ({"extensionsUsed": used} if used else {})
    data = bytes(contents.buffer)
    return glb_bytes(header, struct.pack("<I4s", len(data), b"BIN\0") + data)


def glb_bytes(header: dict[str, Any], chunks: bytes) -> bytes:
    """The file of a JSON header and of the chunks that follow it, each with its length and kind before it (§4.4)."""
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(chunks), len(text), b"JSON") + text + chunks


class _Contents:
    """What accumulates while a file is written: its header and its one buffer."""

    def __init__(self, keeps_images: bool, wrap: int, radiance: Mapping[str, str]) -> None:
        self.keeps_images, self.wrap, self.radiance = keeps_images, wrap, radiance
        self.buffer = bytearray()
        self.header: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "relume"},
            "scene": 0,
            "scenes": [{"nodes": []}],
        }

    def entry(self, kind: str, value: dict[str, Any]) -> int:
        """The index of a new entry of this kind."""
        entries = self.header.setdefault(kind, [])
        entries.append(value)
        return len(entries) - 1

    def view(self, data: bytes, target: int | None = None) -> int:
        """The buffer view of these bytes, which begin at a multiple of four."""
        place = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data)}
        self.buffer += data + b"\0" * (-len(data) % 4)
        return self.entry("bufferViews", place if target is None else place | {"target": target})

    def numbers(self, values: np.ndarray, kind: str, component: int, target: int) -> int:
        """The accessor of an array, (N, K) or (N,)."""
        accessor = {
            "bufferView": self.view(np.ascontiguousarray(values).tobytes(), target),
            "componentType": component,
            "count": len(values),
            "type": kind,
            "min": np.atleast_1d(values.min(axis=0)).tolist(),
            "max": np.atleast_1d(values.max(axis=0)).tolist(),
        }
        return self.entry("accessors", accessor)

    def texture(self, values: np.ndarray, *, colour: bool) -> dict[str, int]:
        """The texture of values from 0 to 1, (H, W, 3); colours are encoded by the sRGB curve."""
        codes = encode_srgb(np.clip(values, 0, 1)) if colour else np.clip(values, 0, 1)
        data = png.encode(np.rint(255 * codes).astype(np.uint8))
        image = self.entry("images", {"bufferView": self.view(data), "mimeType": "image/png"})
        if "samplers" not in self.header:
            self.entry("samplers", {"wrapS": self.wrap, "wrapT": self.wrap})
        return {"index": self.entry("textures", {"source": image, "sampler": 0})}

    def colour(self, value: Any, factor: str, texture: str) -> dict[str, Any]:
        """A colour as glTF's factor, or as its texture."""
        if is_image(value) and self.keeps_images:
            return {texture: self.texture(np.asarray(value), colour=True)}
        return {factor: list(mean_colour(value))}

    def share(self, value: Any, factor: str, texture: str, channel: int) -> dict[str, Any]:
        """A number as glTF's factor, or as one channel of its texture beside a factor of 1."""
        if not (is_image(value) and self.keeps_images):
            return {factor: mean_number(value)}
        packed = np.ones((*np.shape(value), 3), np.float32)
        packed[..., channel] = value
        return {factor: 1.0, texture: self.texture(packed, colour=False)}


def _mesh(mesh: Mesh, contents: _Contents) -> dict[str, Any]:
    attributes = {"POSITION": contents.numbers(mesh.vertices.astype("<f4"), "VEC3", FLOAT, VERTICES)}
    if mesh.normals is not None:
        attributes["NORMAL"] = contents.numbers(mesh.normals.astype("<f4"), "VEC3", FLOAT, VERTICES)
    if mesh.uv is not None:
        # glTF's (0, 0) is the image's upper left corner, ours the lower left.
        down = (mesh.uv * [1, -1] + [0, 1]).astype("<f4")
        attributes["TEXCOORD_0"] = contents.numbers(down, "VEC2", FLOAT, VERTICES)
    indices = contents.numbers(mesh.faces.astype("<u4").reshape(-1), "SCALAR", UNSIGNED, INDICES)
    material = contents.entry("materials", _material(mesh, contents))
    return {"name": mesh.name, "primitives": [{"attributes": attributes, "indices": indices, "material": material}]}


def _material(mesh: Mesh, contents: _Contents) -> dict[str, Any]:
    material = mesh.material
    written: dict[str, Any] = {"name": getattr(material, "name", "") or mesh.name, "doubleSided": True}
    if isinstance(material, Diffuse):
        pbr = {"metallicFactor": 0.0, "roughnessFactor": 1.0} | _base(material.reflectance, 1.0, contents)
        # No specular part: a Lambert surface.
        return written | {
            "pbrMetallicRoughness": pbr,
            "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
        }
    if not isinstance(material, Material):
        raise ValueError(f"the material of {mesh.name!r} is a {type(material).__name__}; expected a Material")
    alpha = mean_number(material.alpha)
    written["pbrMetallicRoughness"] = _base(material.base_color, alpha, contents) | _metallic(material, contents)
    if alpha < 1:
        written["alphaMode"] = "BLEND"
    if material.normal is not None and contents.keeps_images:
        written["normalTexture"] = contents.texture(np.asarray(material.normal) / 2 + 0.5, colour=False)
    extensions = _extensions(material, contents)
    if material.emits:
        # The factor holds 1 at most; the strength is what is above it.
        strongest = max(float(np.max(material.emission)), 1.0)
        if mesh.name in contents.radiance:
            strongest = max(float(np.quantile(material.emission, SHOWN)), 1e-6)
            written["extras"] = {RADIANCE: contents.radiance[mesh.name]}
        written |= contents.colour(np.asarray(material.emission) / strongest, "emissiveFactor", "emissiveTexture")
        written.setdefault("emissiveFactor", [1.0, 1.0, 1.0])
        extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strongest}
    return written | ({"extensions": extensions} if extensions else {})


def _base(base: Any, alpha: float, contents: _Contents) -> dict[str, Any]:
    written = contents.colour(base, "baseColorFactor", "baseColorTexture")
    return written | {"baseColorFactor": [*written.get("baseColorFactor", [1.0, 1.0, 1.0]), alpha]}


def _metallic(material: Material, contents: _Contents) -> dict[str, Any]:
    """Metallic and roughness, which share a texture: green is the roughness, blue the metal."""
    metallic, roughness = material.metallic, material.roughness
    images = [np.asarray(value) for value in (metallic, roughness) if is_image(value)]
    if not images or not contents.keeps_images:
        return {"metallicFactor": mean_number(metallic), "roughnessFactor": mean_number(roughness)}
    height, width = np.max([image.shape for image in images], axis=0)
    packed = np.zeros((height, width, 3), np.float32)
    packed[..., 1], packed[..., 2] = enlarged(roughness, height, width), enlarged(metallic, height, width)
    texture = contents.texture(packed, colour=False)
    return {"metallicFactor": 1.0, "roughnessFactor": 1.0, "metallicRoughnessTexture": texture}


def _extensions(material: Material, contents: _Contents) -> dict[str, Any]:
    """Those whose values are not glTF's defaults."""
    found: dict[str, Any] = {}
    if np.any(material.transmission):
        found["KHR_materials_transmission"] = contents.share(
            material.transmission, "transmissionFactor", "transmissionTexture", 0
        )
        if not material.thin:
            volume: dict[str, Any] = {"thicknessFactor": SOLID}
            if np.isfinite(material.attenuation_distance):
                volume |= {
                    "attenuationColor": list(map(float, material.attenuation_color)),
                    "attenuationDistance": float(material.attenuation_distance),
                }
            found["KHR_materials_volume"] = volume
    if material.ior != 1.5:
        found["KHR_materials_ior"] = {"ior": float(material.ior)}
    if np.any(material.clearcoat):
        found["KHR_materials_clearcoat"] = contents.share(
            material.clearcoat, "clearcoatFactor", "clearcoatTexture", 0
        ) | contents.share(material.clearcoat_roughness, "clearcoatRoughnessFactor", "clearcoatRoughnessTexture", 1)
    if np.any(material.sheen_color):
        found["KHR_materials_sheen"] = {
            **contents.colour(material.sheen_color, "sheenColorFactor", "sheenColorTexture"),
            "sheenRoughnessFactor": mean_number(material.sheen_roughness),
        }
        found["KHR_materials_sheen"].setdefault("sheenColorFactor", [1.0, 1.0, 1.0])
    if material.anisotropy:
        found["KHR_materials_anisotropy"] = {
            "anisotropyStrength": float(material.anisotropy),
            "anisotropyRotation": float(material.anisotropy_rotation),
        }
    if specular := _specular(material, contents):
        found["KHR_materials_specular"] = specular
    if material.dispersion:
        found["KHR_materials_dispersion"] = {"dispersion": float(material.dispersion)}
    return found


def _specular(material: Material, contents: _Contents) -> dict[str, Any]:
    """KHR_materials_specular: a colour that may be above 1, so an image is of shares, times a factor."""
    colour, share = np.asarray(material.specular_color), mean_number(material.specular)
    if np.all(colour == 1) and np.all(np.asarray(material.specular) == 1):
        return {}
    if not is_image(colour) or not contents.keeps_images:
        return {"specularFactor": share, "specularColorFactor": list(mean_colour(colour))}
    highest = max(float(colour.max()), 1e-6)
    texture = contents.texture(colour / highest, colour=True)
    return {"specularFactor": share, "specularColorFactor": [highest] * 3, "specularColorTexture": texture}
