"""The keys of an animated glTF file: nodes, what moves them, and cameras (glTF 2.0, §3.6, §3.10, §3.11).

The reader of meshes does not read animations, so that JSON and buffers are read here.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.motion.animation import Animation, Lens, Node
from relume.scene.motion.keyframes import Interpolation, Linear, Slerp, Step, Tangents, Track

_NUMBERS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_MOVING = {"translation": 3, "rotation": 4, "scale": 3}


def read_animation(path: str | Path) -> Animation | None:
    """The motion that a .glb or .gltf file holds; None where it holds none, and for files of other kinds.

    Warns of what is not rendered of it: skins, morph targets, more than one animation. Raises UnreadableFile.
    """
    path = Path(path)
    if path.suffix.lower() not in (".glb", ".gltf"):
        return None
    try:
        header, blob = _parts(path)
        if not header.get("animations"):
            return None
        return _animation(path, header, _Buffers(path, header, blob))
    except (OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnreadableFile(f"{path}: its animation cannot be read ({reason}); export it again as .glb") from None


def _parts(path: Path) -> tuple[dict[str, Any], bytes]:
    data = path.read_bytes()
    if path.suffix.lower() == ".gltf":
        return json.loads(data), b""
    if data[:4] != b"glTF" or len(data) < 20:
        raise ValueError("no glTF header")
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


class _Buffers:
    def __init__(self, path: Path, header: dict[str, Any], blob: bytes) -> None:
        self.path, self.header, self.blob = path, header, blob
        self.read: dict[int, bytes] = {}

    def accessor(self, index: int) -> np.ndarray:
        """(count, width) float64; whole numbers stand for shares of their largest."""
        table = self.header["accessors"][index]
        if "sparse" in table or "bufferView" not in table:
            raise ValueError("sparse keys are not read")
        view = self.header["bufferViews"][table["bufferView"]]
        kind, width = np.dtype(_NUMBERS[table["componentType"]]), _WIDTHS[table["type"]]
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0) + table.get("byteOffset", 0)
        values = np.ndarray(
            (table["count"], width), kind, self._buffer(view["buffer"]), start, (stride, kind.itemsize)
        ).astype(np.float64)
        if kind.kind == "f":
            return values
        return np.maximum(values / np.iinfo(kind).max, -1.0)

    def _buffer(self, index: int) -> bytes:
        if index not in self.read:
            uri = self.header["buffers"][index].get("uri")
            if uri is None:
                self.read[index] = self.blob
            elif uri.startswith("data:"):
                try:
                    self.read[index] = base64.b64decode(uri.split(",", 1)[1], validate=True)
                except binascii.Error:
                    raise ValueError(f"buffer {index} is no base64") from None
            else:
                self.read[index] = (self.path.parent / unquote(uri)).read_bytes()
        return self.read[index]


def _animation(path: Path, header: dict[str, Any], buffers: _Buffers) -> Animation:
    chosen, *others = header["animations"]
    lost = [f"the animation {other.get('name', '')!r}" for other in others]
    tracks: dict[tuple[int, str], Track] = {}
    for channel in chosen["channels"]:
        node, what = channel["target"].get("node"), channel["target"]["path"]
        if node is None or what not in _MOVING:
            lost.append("morph targets" if what == "weights" else f"the motion of {what}")
            continue
        tracks[node, what] = _track(what, chosen["samplers"][channel["sampler"]], buffers)
    if any("skin" in node for node in header["nodes"]):
        lost.append("skins")
    if lost:
        warnings.warn(f"{path}: not rendered of its motion: {', '.join(dict.fromkeys(lost))}", stacklevel=3)
    parents = {child: i for i, node in enumerate(header["nodes"]) for child in node.get("children", [])}
    nodes = [
        _node(i, table, parents.get(i), {what: tracks[i, what] for what in _MOVING if (i, what) in tracks}, header)
        for i, table in enumerate(header["nodes"])
    ]
    _require_tree(nodes)
    return Animation(tuple(nodes), str(path))


def _track(what: str, sampler: Mapping[str, Any], buffers: _Buffers) -> Track:
    times, values = buffers.accessor(sampler["input"])[:, 0], buffers.accessor(sampler["output"])
    if values.shape[1] != _MOVING[what] or not np.all(np.isfinite(values)):
        raise ValueError(f"the keys of {what} are not {_MOVING[what]} numbers each")
    kind = sampler.get("interpolation", "LINEAR")
    between: Interpolation
    if kind == "CUBICSPLINE":
        arriving, values, leaving = values.reshape(-1, 3, values.shape[1]).swapaxes(0, 1)
        between = Tangents(arriving, leaving)
    elif kind in ("LINEAR", "STEP"):
        between = Step() if kind == "STEP" else Slerp() if what == "rotation" else Linear()
    else:
        raise ValueError(f"the interpolation {kind} is not known")
    return Track(times, values, between)


def _node(
    index: int, table: Mapping[str, Any], parent: int | None, tracks: Mapping[str, Track], header: Mapping[str, Any]
) -> Node:
    camera = header["cameras"][table["camera"]] if "camera" in table else None
    lens = None
    if camera is not None and camera["type"] == "perspective":
        lens = Lens(float(camera["perspective"]["yfov"]))
    return Node(
        name=str(table.get("name", index)),
        parent=parent,
        matrix=np.reshape(table["matrix"], (4, 4)).T.astype(np.float64) if "matrix" in table else None,
        translation=np.array(table.get("translation", (0, 0, 0)), np.float64),
        rotation=np.array(table.get("rotation", (0, 0, 0, 1)), np.float64),
        scale=np.array(table.get("scale", (1, 1, 1)), np.float64),
        tracks=tracks,
        lens=lens,
        shaped="mesh" in table,
    )


def _require_tree(nodes: list[Node]) -> None:
    for node in nodes:
        steps, parent = 0, node.parent
        while parent is not None:
            steps, parent = steps + 1, nodes[parent].parent
            if steps > len(nodes):
                raise ValueError(f"the node {node.name!r} is inside itself")
