"""A camera of a glTF file (.glb, .gltf): perspective cameras and the nodes that place them."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, warn_of_aspect

DEEPEST = 1000
"""Nodes within nodes; more than that is a node within itself."""


def read_gltf_camera(
    path: str | Path,
    width: int,
    height: int,
    *,
    name: str | None = None,
    up: UpAxis | None = None,
    unit: float | None = None,
) -> Camera:
    """Read a perspective camera of a glTF file; its vertical field of view is that of the picture.

    name : of the camera or of the node that places it; not needed where there is one only
    up : "y" unless given, as glTF says
    unit : metres to a unit; 1 unless given, as glTF says
    Raises UnreadableFile where there is no such camera, or several to choose from. glTF 2.0, §3.10.
    """
    path = Path(path)
    header = _header(path)
    try:
        placed = _placed(path, header)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: its nodes cannot be followed ({error!r}); export it again") from None
    labels = [(node or camera.get("name") or f"camera {index}") for node, index, camera, _ in placed]
    if not placed:
        raise UnreadableFile(f"{path}: holds no camera that a node places; export it with its cameras")
    chosen = [p for p, label in zip(placed, labels, strict=True) if name is None or name in (label, p[2].get("name"))]
    if len(chosen) != 1:
        fault = "holds" if name is None else f"{len(chosen)} of its cameras are named {name!r}; it holds"
        raise UnreadableFile(f"{path}: {fault} {', '.join(map(repr, labels))}; give the name of one")
    _, _, camera, matrix = chosen[0]
    lens = camera.get("perspective")
    if not isinstance(lens, dict) or not isinstance(lens.get("yfov"), int | float) or not 0 < lens["yfov"] < np.pi:
        raise UnreadableFile(f"{path}: the camera has no perspective field of view; export a perspective camera")
    if isinstance(lens.get("aspectRatio"), int | float) and lens["aspectRatio"] > 0:
        warn_of_aspect(path, (width, height), float(lens["aspectRatio"]), "its vertical field of view")
    position, rotation = pose(path, matrix, up or "y", unit or 1.0)
    return Camera(width, height, float(height / 2 / np.tan(lens["yfov"] / 2)), position, rotation)


def _header(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    if data[:4] == b"glTF" and len(data) >= 20:
        data = data[20 : 20 + struct.unpack_from("<I", data, 12)[0]]
    try:
        header = json.loads(data)
    except (RecursionError, ValueError):
        header = None
    if not isinstance(header, dict):
        raise UnreadableFile(f"{path}: not a readable glTF file; export it again as .glb")
    return header


def _placed(path: Path, header: dict[str, Any]) -> list[tuple[str, int, dict[str, Any], np.ndarray]]:
    """The scene's cameras: the node's name, the camera's number and description, and its matrix in the world."""
    nodes, cameras = header.get("nodes", []), header.get("cameras", [])
    scenes = header.get("scenes")
    children = {child for node in nodes for child in node.get("children", [])}
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else sorted(set(range(len(nodes))) - children)
    found = []
    stack = [(root, np.eye(4), 0) for root in reversed(roots)]
    while stack:
        index, above, depth = stack.pop()
        if depth > DEEPEST:
            raise UnreadableFile(f"{path}: a node lies within itself; export it again")
        node = nodes[index]
        matrix = above @ _local(node)
        if "camera" in node:
            found.append((str(node.get("name", "")), int(node["camera"]), cameras[node["camera"]], matrix))
        stack += [(child, matrix, depth + 1) for child in reversed(node.get("children", []))]
    return found


def _local(node: dict[str, Any]) -> np.ndarray:
    """A node's own matrix, of column vectors; glTF writes them column by column (§3.5.3)."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_from_quaternion(w, x, y, z) * np.array(node.get("scale", (1.0, 1.0, 1.0)), np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> np.ndarray:
    """The rotation (3, 3) of a quaternion of any length but 0."""
    w, x, y, z = np.array([w, x, y, z], np.float64) / np.linalg.norm([w, x, y, z])
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
