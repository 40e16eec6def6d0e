"""Parts as a glTF binary, with their materials and images inside (glTF 2.0 and its ratified material extensions)."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from relume.export.parts import Part, base_colour, is_image, mean_colour, mean_number
from relume.image.colour import encode_srgb
from relume.image.files.photographs import png
from relume.scene.materials.materials import Diffuse, Material

FLOAT, UINT32 = 5126, 5125
SOLID = 1.0
"""thicknessFactor of a body: path tracers follow its own walls, and any thickness above 0 says that it has some."""


def glb(parts: Sequence[Part], *, images: bool = True) -> bytes:
    """A .glb of the parts, a node each of the part's name at the origin, vertices in world coordinates.

    images : keep images over the texture coordinates, as PNG of 8 bits; else their means are in their place

    Ray tracers read attenuation and transmission as those of solid bodies; `thin` bodies get no thickness.
    """
    writer = _Writer(images)
    nodes, meshes, materials = [], [], []
    for index, part in enumerate(parts):
        mesh = part.mesh
        attributes = {"POSITION": writer.accessor(mesh.vertices.astype("<f4"), "VEC3", FLOAT, extent=True)}
        if mesh.normals is not None:
            attributes["NORMAL"] = writer.accessor(mesh.normals.astype("<f4"), "VEC3", FLOAT)
        if mesh.uv is not None:
            # glTF's (0, 0) is the image's upper left corner, ours the lower left.
            attributes["TEXCOORD_0"] = writer.accessor((mesh.uv * [1, -1] + [0, 1]).astype("<f4"), "VEC2", FLOAT)
        indices = writer.accessor(mesh.faces.astype("<u4").reshape(-1), "SCALAR", UINT32)
        meshes.append(
            {"name": part.name, "primitives": [{"attributes": attributes, "indices": indices, "material": index}]}
        )
        nodes.append({"name": part.name, "mesh": index})
        materials.append(_material(part, writer))
    used = sorted({key for material in materials for key in material.get("extensions", {})})
    header: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "relume"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": writer.accessors,
        "bufferViews": writer.views,
        "buffers": [{"byteLength": len(writer.blob)}],
    }
    if used:
        header["extensionsUsed"] = used
    if writer.images:
        header |= {
            "images": writer.images,
            "textures": [{"source": index, "sampler": 0} for index in range(len(writer.images))],
            "samplers": [{"wrapS": 10497, "wrapT": 10497}],
        }
    text = json.dumps(header, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(writer.blob)
    return b"".join(
        [
            struct.pack("<4sII", b"glTF", 2, size),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(writer.blob), b"BIN\0"),
            bytes(writer.blob),
        ]
    )


class _Writer:
    """What accumulates while the parts are written."""

    def __init__(self, keep_images: bool) -> None:
        self.keep_images = keep_images
        self.blob = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []
        self.images: list[dict[str, Any]] = []

    def view(self, data: bytes) -> int:
        self.views.append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data)})
        self.blob += data + b"\0" * (-len(data) % 4)
        return len(self.views) - 1

    def accessor(self, array: np.ndarray, kind: str, number: int, *, extent: bool = False) -> int:
        told: dict[str, Any] = {
            "bufferView": self.view(np.ascontiguousarray(array).tobytes()),
            "componentType": number,
            "count": len(array),
            "type": kind,
        }
        if extent:
            told |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.accessors.append(told)
        return len(self.accessors) - 1

    def image(self, values: np.ndarray, *, colour: bool) -> dict[str, int]:
        """A texture of values from 0 to 1, (H, W, 3); colours are encoded by the sRGB curve."""
        codes = encode_srgb(np.clip(values, 0, 1)) if colour else np.clip(values, 0, 1)
        data = png.encode(np.rint(255 * codes).astype(np.uint8))
        self.images.append({"bufferView": self.view(data), "mimeType": "image/png"})
        return {"index": len(self.images) - 1}

    def colour(self, value: Any, factor: str, texture: str) -> dict[str, Any]:
        """A colour as glTF's factor, or as its texture."""
        if is_image(value) and self.keep_images:
            return {texture: self.image(np.asarray(value), colour=True)}
        return {factor: list(mean_colour(value))}

    def share(self, value: Any, factor: str, texture: str, channel: int) -> dict[str, Any]:
        """A number as glTF's factor, or as one channel of its texture beside a factor of 1."""
        if not (is_image(value) and self.keep_images):
            return {factor: mean_number(value)}
        packed = np.ones((*np.shape(value), 3), np.float32)
        packed[..., channel] = value
        return {factor: 1.0, texture: self.image(packed, colour=False)}


def _material(part: Part, writer: _Writer) -> dict[str, Any]:
    material = part.material
    base = base_colour(material)
    told: dict[str, Any] = {"name": part.name, "doubleSided": True}
    if isinstance(material, Diffuse):
        pbr = {"metallicFactor": 0.0, "roughnessFactor": 1.0} | _base(base, 1.0, writer)
        # No specular part: a Lambert surface.
        return told | {"pbrMetallicRoughness": pbr, "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}}}
    alpha = mean_number(material.alpha)
    told["pbrMetallicRoughness"] = _base(base, alpha, writer) | _metallic_roughness(material, writer)
    if alpha < 1:
        told["alphaMode"] = "BLEND"
    if material.normal is not None and writer.keep_images:
        told["normalTexture"] = writer.image(np.asarray(material.normal) / 2 + 0.5, colour=False)
    extensions = _extensions(material, writer)
    if material.emits:
        # The factor holds 1 at most; the strength is what is above it.
        strongest = max(float(np.max(material.emission)), 1.0)
        told |= writer.colour(np.asarray(material.emission) / strongest, "emissiveFactor", "emissiveTexture")
        told.setdefault("emissiveFactor", [1.0, 1.0, 1.0])
        extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": strongest}
    return told | ({"extensions": extensions} if extensions else {})


def _base(base: Any, alpha: float, writer: _Writer) -> dict[str, Any]:
    told = writer.colour(base, "baseColorFactor", "baseColorTexture")
    return told | {"baseColorFactor": [*told.get("baseColorFactor", [1.0, 1.0, 1.0]), alpha]}


def _metallic_roughness(material: Material, writer: _Writer) -> dict[str, Any]:
    metallic, roughness = material.metallic, material.roughness
    images = [np.asarray(value) for value in (metallic, roughness) if is_image(value)]
    if not images or not writer.keep_images:
        return {"metallicFactor": mean_number(metallic), "roughnessFactor": mean_number(roughness)}
    height, width = np.max([image.shape for image in images], axis=0)
    packed = np.zeros((height, width, 3), np.float32)
    packed[..., 1], packed[..., 2] = _enlarged(roughness, height, width), _enlarged(metallic, height, width)
    return {
        "metallicFactor": 1.0,
        "roughnessFactor": 1.0,
        "metallicRoughnessTexture": writer.image(packed, colour=False),
    }


def _enlarged(value: Any, height: int, width: int) -> np.ndarray:
    """An image of another size by its nearest pixels; a number all over."""
    image = np.atleast_2d(np.asarray(value, np.float32))
    rows, columns = np.arange(height) * image.shape[0] // height, np.arange(width) * image.shape[1] // width
    return image[rows[:, None], columns]


def _extensions(material: Material, writer: _Writer) -> dict[str, Any]:
    """Those that say something: glTF's defaults are ours."""
    found: dict[str, Any] = {}
    if np.any(material.transmission):
        found["KHR_materials_transmission"] = writer.share(
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
        found["KHR_materials_clearcoat"] = writer.share(
            material.clearcoat, "clearcoatFactor", "clearcoatTexture", 0
        ) | writer.share(material.clearcoat_roughness, "clearcoatRoughnessFactor", "clearcoatRoughnessTexture", 1)
    if np.any(material.sheen_color):
        found["KHR_materials_sheen"] = {
            **writer.colour(material.sheen_color, "sheenColorFactor", "sheenColorTexture"),
            "sheenRoughnessFactor": mean_number(material.sheen_roughness),
        }
        found["KHR_materials_sheen"].setdefault("sheenColorFactor", [1.0, 1.0, 1.0])
    if material.anisotropy:
        found["KHR_materials_anisotropy"] = {
            "anisotropyStrength": float(material.anisotropy),
            "anisotropyRotation": float(material.anisotropy_rotation),
        }
    if np.any(np.asarray(material.specular) != 1) or np.any(np.asarray(material.specular_color) != 1):
        found["KHR_materials_specular"] = {
            "specularFactor": mean_number(material.specular),
            "specularColorFactor": list(mean_colour(material.specular_color)),
        }
    if material.dispersion:
        found["KHR_materials_dispersion"] = {"dispersion": float(material.dispersion)}
    return found
