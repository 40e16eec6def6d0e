"""Meshes that a file moves: where each node is at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from relume.scene.motion.keyframes import Track
from relume.scene.shapes.shapes import Mesh, carried


@dataclass(frozen=True, eq=False)
class Node:
    """One of a file's nodes.

    name : its own, or its number
    parent : the index of the node it hangs on, or None
    matrix : (4, 4) to its parent, or None where it is scaled, turned and moved by the three below
    at_rest : by name "translation", metres; "rotation", a unit quaternion (x, y, z, w); "scale", factors
    tracks : what of the three moves, over seconds
    shaped : whether it holds a mesh
    """

    name: str
    parent: int | None
    matrix: np.ndarray | None
    at_rest: Mapping[str, np.ndarray]
    tracks: Mapping[str, Track]
    shaped: bool = False

    def to_parent(self, time: float | None) -> np.ndarray:
        """(4, 4) at a time in seconds; None for the place where the file puts it at rest."""
        if self.matrix is not None:
            return self.matrix
        moving = {} if time is None else {what: track.at(time) for what, track in self.tracks.items()}
        return matrix_of(**{**self.at_rest, **moving})


def matrix_of(translation: ArrayLike, rotation: ArrayLike, scale: ArrayLike) -> np.ndarray:
    """(4, 4) of column vectors that scales, then turns by a quaternion (x, y, z, w), then moves."""
    from scipy.spatial.transform import Rotation

    result = np.eye(4)
    # A cubic between two unit quaternions is none itself; it is made one.
    result[:3, :3] = Rotation.from_quat(rotation).as_matrix() * np.asarray(scale, np.float64)
    result[:3, 3] = translation
    return result


@dataclass(frozen=True, eq=False)
class Animation:
    """The motion that a file holds.

    nodes : all of the file's
    source : the file, for messages
    """

    nodes: tuple[Node, ...]
    source: str = "the animation"

    def to_world(self, index: int, time: float | None) -> np.ndarray:
        """(4, 4) of a node at a time in seconds, or at rest."""
        node = self.nodes[index]
        own = node.to_parent(time)
        return own if node.parent is None else self.to_world(node.parent, time) @ own


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
