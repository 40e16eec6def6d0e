"""Meshes with their materials as a .glb file (glTF 2.0 with KHR_materials_specular).

What surface maps hold, and no more: base colour, roughness, metal and specular colour, each a number or an image over
the whole picture, which ends at its rim. Metres, world frame.
"""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.files.photographs import png
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh

FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
CLAMP = 33071
"""Numbers of glTF 2.0, §5: kinds of components, uses of a buffer, a texture that ends at its rim."""


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
        codes = np.round(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
        image = {"bufferView": self.view(png.encode(codes)), "mimeType": "image/png"}
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
