"""Meshes and a camera that a file moves: where each node is at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import tan

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Track
from relume.scene.shapes.shapes import Mesh, carried


@dataclass(frozen=True, eq=False)
class Node:
    """One of a file's nodes.

    name : its own, or its number
    parent : the index of the node it hangs on, or None
    matrix : (4, 4) to its parent, or None where it is made of the three below, scaled first and moved last
    translation, rotation, scale : metres, a unit quaternion (x, y, z, w), factors
    tracks : what of the three moves, over seconds
    field_of_view : of a perspective camera, vertical, radians; None for other nodes
    shaped : whether it holds a mesh
    """

    name: str
    parent: int | None
    matrix: np.ndarray | None
    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    tracks: Mapping[str, Track]
    field_of_view: float | None = None
    shaped: bool = False

    def to_parent(self, time: float | None) -> np.ndarray:
        """(4, 4) at a time in seconds; None for the place where the file puts it at rest."""
        from scipy.spatial.transform import Rotation

        if self.matrix is not None:
            return self.matrix
        held = {"translation": self.translation, "rotation": self.rotation, "scale": self.scale}
        if time is not None:
            held |= {what: track.at(time) for what, track in self.tracks.items()}
        result = np.eye(4)
        # A cubic between two unit quaternions is none itself; it is made one.
        result[:3, :3] = Rotation.from_quat(held["rotation"]).as_matrix() * held["scale"]
        result[:3, 3] = held["translation"]
        return result


@dataclass(frozen=True, eq=False)
class Animation:
    """The motion that a file holds.

    nodes : all of the file's
    source : the file, for messages
    """

    nodes: tuple[Node, ...]
    source: str = "the animation"

    @cached_property
    def seconds(self) -> tuple[float, float]:
        """The times of the first and the last key."""
        times = [track.times for node in self.nodes for track in node.tracks.values()]
        if not times:
            return 0.0, 0.0
        return float(min(t[0] for t in times)), float(max(t[-1] for t in times))

    def to_world(self, index: int, time: float | None) -> np.ndarray:
        """(4, 4) of a node at a time in seconds, or at rest."""
        node = self.nodes[index]
        own = node.to_parent(time)
        return own if node.parent is None else self.to_world(node.parent, time) @ own

    def camera(self, time: float, width: int, height: int) -> Camera | None:
        """The file's first perspective camera at a time, for a picture of `width` by `height` pixels; None for none.

        Its field of view is that of the picture's height. Raises ValueError where its node is scaled to nothing.
        """
        for index, node in enumerate(self.nodes):
            if node.field_of_view is not None:
                world = self.to_world(index, time)
                left, sizes, right = np.linalg.svd(world[:3, :3])
                if sizes[-1] <= 0 or np.linalg.det(world[:3, :3]) <= 0:
                    raise ValueError(f"{self.source}: the camera {node.name!r} is mirrored or scaled to nothing")
                focal_length = height / 2 / tan(node.field_of_view / 2)
                return Camera(width, height, focal_length, world[:3, 3], left @ right)
        return None


def posed(meshes: tuple[Mesh, ...], animation: Animation, time: float) -> tuple[Mesh, ...]:
    """The file's meshes, which stand where it puts them at rest, moved to where they are at a time in seconds.

    Meshes belong to the node of their name, or to that whose name and an underscore theirs begins with, as the parts of
    one mesh have it. One that is scaled to nothing at that time is left out. Raises ValueError where a mesh that moves
    has the same name as another.
    """
    return tuple(m for m in (_posed(mesh, animation, time) for mesh in meshes) if m is not None)


def _posed(mesh: Mesh, animation: Animation, time: float) -> Mesh | None:
    index = _node_of(mesh, animation)
    rest, now = (animation.to_world(index, t) for t in (None, time))
    if np.array_equal(rest, now):
        return mesh
    if np.linalg.det(now[:3, :3]) == 0:
        return None
    vertices, faces, normals = carried(mesh.vertices, mesh.faces, mesh.normals, now @ np.linalg.inv(rest))
    return replace(mesh, vertices=vertices, faces=faces, normals=normals)


def _node_of(mesh: Mesh, animation: Animation) -> int:
    shaped = [index for index, node in enumerate(animation.nodes) if node.shaped]
    found = [index for index in shaped if animation.nodes[index].name == mesh.name]
    if not found:
        whole = [index for index in shaped if mesh.name.startswith(animation.nodes[index].name + "_")]
        longest = max((len(animation.nodes[index].name) for index in whole), default=0)
        found = [index for index in whole if len(animation.nodes[index].name) == longest]
    if len(found) != 1:
        raise ValueError(
            f"{animation.source}: {len(found)} nodes go by the name of the mesh {mesh.name!r}; give each node a name "
            "of its own"
        )
    return found[0]
