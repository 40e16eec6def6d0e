"""A glTF file's JSON and buffers, from .glb and .gltf: the one reader for meshes, materials, motion and cameras."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.motion.animation import matrix_of

NUMBERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
"""How numbers of each component type are stored (§3.6.2.2)."""
AT_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
"""What a node has that says nothing of itself (§5.25)."""
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, eq=False)
class GltfDocument:
    """A glTF file, its buffers not read yet.

    path : where it lies; buffers and pictures beside it are found from there
    header : its JSON
    chunks : of a .glb all that follows the JSON, as stored; None for a .gltf
    """

    path: Path
    header: dict[str, Any]
    chunks: bytes | None = None

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer: the file's own, written into the JSON, or those of a file beside it."""
        if index not in self._buffers:
            uri = self.header["buffers"][index].get("uri")
            self._buffers[index] = (self.chunks or b"")[8:] if uri is None else self.fetched(uri)
        return self._buffers[index]

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view."""
        view = self.header["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffer(view["buffer"])[start : start + view["byteLength"]]

    def accessor(self, index: int) -> np.ndarray:
        """(count, width) float64; whole numbers said to be normalised stand for shares of their largest (§3.11)."""
        table = self.header["accessors"][index]
        if "sparse" in table or "bufferView" not in table:
            raise ValueError("sparse numbers are not read")
        view = self.header["bufferViews"][table["bufferView"]]
        kind, width = np.dtype(NUMBERS[table["componentType"]]), _WIDTHS[table["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0) + table.get("byteOffset", 0)
        values = np.ndarray((table["count"], width), kind, self.buffer(view["buffer"]), start, (stride, kind.itemsize))
        return shares_of(values) if table.get("normalized") else values.astype(np.float64)

    def fetched(self, uri: str) -> bytes:
        """What a URI of the file holds. Raises ValueError for a file outside of this one's folder."""
        if uri.startswith("data:"):
            try:
                return base64.b64decode("".join(uri.partition(",")[2].split()), validate=True)
            except binascii.Error:
                raise ValueError("its data: URI is not base64") from None
        beside = (self.path.parent / unquote(uri)).resolve()
        if self.path.parent.resolve() not in beside.parents:
            raise ValueError(f"{uri} lies outside of the file's folder")
        return beside.read_bytes()

    @cached_property
    def _buffers(self) -> dict[int, bytes]:
        return {}


def shares_of(stored: np.ndarray) -> np.ndarray:
    """Whole numbers as shares of their largest, float64 (§3.11); floats as they are."""
    values = stored.astype(np.float64)
    return values if stored.dtype.kind == "f" else np.maximum(values / np.iinfo(stored.dtype).max, -1.0)


def read_document(path: Path) -> GltfDocument:
    """A .glb or .gltf file; raises UnreadableFile where it is missing or damaged."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    chunks = None
    try:
        if data[:4] == b"glTF":
            if len(data) < 20:
                raise ValueError("cut short")
            end = 20 + struct.unpack_from("<I", data, 12)[0]
            data, chunks = data[20:end], data[end:]
        elif path.suffix.lower() == ".glb":
            raise ValueError("no glTF header")
        header = json.loads(data)
        if not isinstance(header, dict):
            raise ValueError("its JSON is no object")
    except (RecursionError, ValueError) as error:
        raise UnreadableFile(f"{path}: not a readable glTF file ({error}); export it again as .glb") from None
    return GltfDocument(path, header, chunks)


def local_matrix(node: dict[str, Any]) -> np.ndarray:
    """A node's matrix (4, 4) to its parent, of column vectors; glTF writes them column by column (§3.5.3)."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    return matrix_of(*(node.get(what, default) for what, default in AT_REST.items()))
