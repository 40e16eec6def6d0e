"""Small glTF binaries written here by hand from the specification, so that no exporter's habits are tested."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

CORNERS = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], np.float32)
"""A square that faces +Z, from its upper left corner clockwise."""
TRIANGLES = np.array([0, 3, 2, 0, 2, 1], np.uint16)
TEXTURE_POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
"""glTF 2.0, §3.8.3: (0, 0) is the upper left corner of the image."""
TYPES = {"float32": 5126, "uint16": 5123, "int16": 5122, "uint8": 5121, "int8": 5120}


def square_glb(
    *,
    image: np.ndarray | None = None,
    material: dict[str, Any] | None = None,
    node: dict[str, Any] | None = None,
    corners: np.ndarray = CORNERS,
    texture_points: np.ndarray = TEXTURE_POINTS,
    top: dict[str, Any] | None = None,
    colours: np.ndarray | None = None,
) -> bytes:
    """A textured square as the bytes of a .glb file; `node` places it, `colours` (4, 3) are at its corners.

    top : keys that are added to the header
    """
    views: list[dict[str, int]] = []
    blob = b""

    def stored(data: bytes) -> int:
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    def accessor(array: np.ndarray, kind: str) -> dict[str, Any]:
        return {
            "bufferView": stored(array.tobytes()),
            "componentType": TYPES[array.dtype.name],
            "count": len(array),
            "type": kind,
            "normalized": kind != "SCALAR" and array.dtype.name != "float32",
        }

    accessors = [accessor(corners, "VEC3"), accessor(texture_points, "VEC2"), accessor(TRIANGLES, "SCALAR")]
    header: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "accessors": accessors,
        "materials": [material or {"name": "paint", "pbrMetallicRoughness": {"metallicFactor": 0}}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]},
        ],
        "nodes": [{"mesh": 0, "name": "square"} | (node or {})],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    if image is not None:
        from PIL import Image

        png = io.BytesIO()
        Image.fromarray(image).save(png, "PNG")
        header["images"] = [{"bufferView": stored(png.getvalue()), "mimeType": "image/png"}]
        header["textures"] = [{"source": 0}]
        header["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    if colours is not None:  # rows of whole words, as §3.6.2.4 wants: alpha is the fourth
        opaque = np.ones(4) * (1 if colours.dtype.kind == "f" else np.iinfo(colours.dtype).max)
        accessors.append(accessor(np.column_stack([colours, opaque]).astype(colours.dtype), "VEC4"))
        header["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = len(accessors) - 1
    header |= {"bufferViews": views, "buffers": [{"byteLength": len(blob)}]} | (top or {})
    return as_glb(header, blob)


def as_glb(header: dict[str, Any], blob: bytes = b"") -> bytes:
    """A header and its buffer in one file (glTF 2.0, §4.4)."""
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if blob:
        chunks += struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def parts_of(glb: bytes) -> tuple[dict[str, Any], bytes]:
    """The header and the buffer of a .glb file."""
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


Channels = list[tuple[int, str, list[float], Any, str]]


def animated(
    channels: Channels,
    nodes: list[dict[str, Any]],
    short: bool = False,
) -> tuple[dict[str, Any], bytes]:
    """Header and buffer of a square that moves; a channel is node, path, times, values and interpolation."""
    blob, views, accessors = b"", [], []

    def stored(array: np.ndarray, kind: str) -> int:
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
        code = {"float32": 5126, "uint16": 5123, "int16": 5122}[array.dtype.name]
        accessors.append({"bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": kind,
                          "normalized": array.dtype.name == "int16"})  # fmt: skip
        blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(accessors) - 1

    position, indices = stored(CORNERS, "VEC3"), stored(TRIANGLES, "SCALAR")
    samplers, targets = [], []
    for node, path, times, values, kind in channels:
        values = np.asarray(values, np.float32)
        if short:
            values = np.round(values * 32767).astype(np.int16)
        samplers.append({
            "input": stored(np.array(times, np.float32), "SCALAR"),
            "output": stored(values, f"VEC{values.shape[1]}"),
            "interpolation": kind,
        })  # fmt: skip
        targets.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})
    header = {
        "asset": {"version": "2.0"}, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}], "nodes": nodes, "scenes": [{"nodes": [0]}], "scene": 0,
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "indices": indices}]}],
        "animations": [{"samplers": samplers, "channels": targets}],
    }  # fmt: skip
    return header, blob


def moving_gltf(path: Path) -> Path:
    """A camera that goes from x = 0 to x = 2 in two seconds, in a node one metre up, and turns half about y."""
    times, places = np.array([0, 2], "<f4"), np.array([[0, 0, 0], [2, 0, 0]], "<f4")
    turns = np.array([[0, 0, 0, 1], [0, 1, 0, 0]], "<f4")
    blob = times.tobytes() + places.tobytes() + turns.tobytes()
    spans = [(0, 8), (8, 24), (32, 32)]
    header = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"translation": [0, 1, 0], "children": [1]}, {"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.5}}],
        "buffers": [
            {
                "byteLength": len(blob),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(blob).decode(),
            }
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in spans],
        "accessors": [
            {"bufferView": view, "componentType": 5126, "count": 2, "type": kind}
            for view, kind in enumerate(("SCALAR", "VEC3", "VEC4"))
        ],
        "animations": [
            {
                "samplers": [{"input": 0, "output": 1}, {"input": 0, "output": 2}],
                "channels": [
                    {"sampler": 0, "target": {"node": 1, "path": "translation"}},
                    {"sampler": 1, "target": {"node": 1, "path": "rotation"}},
                ],
            }
        ],
    }
    path.write_text(json.dumps(header))
    return path
