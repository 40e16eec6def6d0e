"""Compressed and quantised vertices of a glTF file (Draco, KHR_mesh_quantization) as plain numbers."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from relume.scene.gltf.document import NUMBERS, GltfDocument, shares_of

DRACO = "KHR_draco_mesh_compression"
_FLOAT, _TRIANGLES = 5126, 4
_KINDS = {kind[1:]: number for number, kind in NUMBERS.items()} | {"u4": 5125}
_SCALED = ("POSITION", "NORMAL", "TEXCOORD_")
"""Attributes that are numbers of their own; colours stay as stored, their reader scales them."""
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def plain_vertices(document: GltfDocument) -> None:
    """Give the header accessors of plain numbers in the place of compressed and quantised ones.

    A reader without either extension then finds triangles, and places, normals and texture coordinates as 32-bit
    floats. What is appended lies in one more buffer, written into the JSON.
    Raises ValueError where the compressed data is damaged.
    """
    header = document.header
    appended = _Appended(header)
    for primitive in (p for mesh in header.get("meshes", []) for p in mesh["primitives"]):
        attributes = primitive["attributes"]
        if compressed := primitive.get("extensions", {}).pop(DRACO, None):
            faces, decoded = _decompressed(document.view(compressed["bufferView"]), compressed["attributes"])
            for name in list(attributes):  # what is not compressed lies beside, in the order of the compressed
                stored = header["accessors"][attributes[name]]
                if name in decoded:
                    values = decoded[name].astype(NUMBERS[stored["componentType"]])  # the decoder widens some
                    scaled = stored.get("normalized") and name.startswith(_SCALED)
                    attributes[name] = appended.accessor(shares_of(values).astype(np.float32) if scaled else values)
                elif "bufferView" not in stored or stored["count"] != len(decoded["POSITION"]):
                    raise ValueError(f"its {name} is not of the mesh that Draco compressed")
            primitive["indices"] = appended.accessor(faces.reshape(-1, 1))
            primitive["mode"] = _TRIANGLES  # Draco has unrolled a strip
        else:
            for name in [name for name in attributes if name.startswith(_SCALED)]:
                if header["accessors"][attributes[name]]["componentType"] != _FLOAT:
                    values = document.accessor(attributes[name]).astype(np.float32)
                    attributes[name] = appended.accessor(values)
    appended.write()


def _decompressed(data: bytes, names: dict[str, int]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Triangles (m, 3) and the attributes (n, width) that `names` numbers, as Google's decoder has them."""
    import DracoPy

    try:
        mesh = DracoPy.decode(data)
        by_number = {each["unique_id"]: np.asarray(each["data"]) for each in mesh.attributes}
        faces = np.asarray(mesh.faces, np.uint32).reshape(-1, 3)
    except Exception as error:  # the decoder has errors of its own
        raise ValueError(f"its Draco data is damaged: {error}") from None
    decoded = {name: by_number[number] for name, number in names.items() if number in by_number}
    if "POSITION" not in decoded or faces.max(initial=0) >= len(decoded["POSITION"]):
        raise ValueError("its Draco data is damaged: triangles without places")
    return faces, {name: values.reshape(len(decoded["POSITION"]), -1) for name, values in decoded.items()}


@dataclass(eq=False)
class _Appended:
    """Arrays on their way into one more buffer of a header."""

    header: dict[str, Any]
    parts: list[bytes] = field(default_factory=list)

    def accessor(self, values: np.ndarray) -> int:
        """The index of a new accessor of these (count, width) numbers."""
        values = np.ascontiguousarray(values)
        start = sum(map(len, self.parts))
        data = values.tobytes()
        self.parts.append(data + bytes(-len(data) % 4))
        accessors = self.header.setdefault("accessors", [])
        views = self.header.setdefault("bufferViews", [])
        views.append({"buffer": len(self.header.get("buffers", [])), "byteOffset": start, "byteLength": len(data)})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": _KINDS[values.dtype.str[1:]],
                "count": len(values),
                "type": _TYPES[values.shape[1]],
            }
        )
        return len(accessors) - 1

    def write(self) -> None:
        """The buffer itself, as a data: URI."""
        if self.parts:
            data = b"".join(self.parts)
            uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
            self.header.setdefault("buffers", []).append({"byteLength": len(data), "uri": uri})
