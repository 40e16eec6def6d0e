"""A camera of a glTF file (.glb, .gltf): perspective cameras and the nodes that place them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, the_only, warn_of_aspect
from relume.scene.gltf.animation import read_animation
from relume.scene.gltf.document import local_matrix, read_document
from relume.scene.motion.animation import Animation

DEEPEST = 1000
"""Nodes within nodes; more than that is a node within itself."""


def read_gltf_camera(
    path: Path, width: int, height: int, name: str | None, up: UpAxis | None, unit: float | None,
    time: float | None = None,
) -> Camera:  # fmt: skip
    """Read a perspective camera of a glTF file; its vertical field of view is that of the picture.

    name : of the camera or of the node that places it; not needed where there is one only
    up : "y" unless given, as glTF says
    unit : metres to a unit; 1 unless given, as glTF says
    time : seconds of the file's own animation, in which the camera's node may move; at rest unless given
    Raises UnreadableFile where there is no such camera, or several to choose from. glTF 2.0, §3.10.
    """
    placed = _every(path, time)
    labels = [_label(each) for each in placed]
    if not placed:
        raise UnreadableFile(f"{path}: holds no camera that a node places; export it with its cameras")
    chosen = [p for p, label in zip(placed, labels, strict=True) if name is None or name in (label, p[2].get("name"))]
    _, _, camera, matrix = the_only(path, chosen, name, labels)
    lens = camera.get("perspective")
    if not isinstance(lens, dict) or not isinstance(lens.get("yfov"), int | float) or not 0 < lens["yfov"] < np.pi:
        raise UnreadableFile(f"{path}: the camera has no perspective field of view; export a perspective camera")
    if isinstance(lens.get("aspectRatio"), int | float) and lens["aspectRatio"] > 0:
        warn_of_aspect(path, (width, height), float(lens["aspectRatio"]), "its vertical field of view")
    position, rotation = pose(path, matrix, up or "y", unit or 1.0)
    return Camera(width, height, float(height / 2 / np.tan(lens["yfov"] / 2)), position, rotation)


def gltf_camera_names(path: Path) -> tuple[str, ...]:
    """The names of all cameras that nodes of a glTF file place, in the order of the nodes; raises UnreadableFile."""
    return tuple(_label(each) for each in _every(path, None))


def _label(placed: tuple[str, int, dict[str, Any], np.ndarray]) -> str:
    node, index, camera, _ = placed
    return node or camera.get("name") or f"camera {index}"


def _every(path: Path, time: float | None) -> list[tuple[str, int, dict[str, Any], np.ndarray]]:
    """All cameras of the scene as `_placed` has them; raises UnreadableFile where the nodes cannot be followed."""
    header = read_document(path).header
    moving = None if time is None else read_animation(path)
    try:
        return _placed(path, header, moving, time)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: its nodes cannot be followed ({error!r}); export it again") from None


def _placed(
    path: Path, header: dict[str, Any], moving: Animation | None, time: float | None
) -> list[tuple[str, int, dict[str, Any], np.ndarray]]:
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
        matrix = above @ (local_matrix(node) if moving is None else moving.nodes[index].to_parent(time))
        if "camera" in node:
            found.append((str(node.get("name", "")), int(node["camera"]), cameras[node["camera"]], matrix))
        stack += [(child, matrix, depth + 1) for child in reversed(node.get("children", []))]
    return found
