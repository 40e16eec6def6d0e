"""How a mesh of a shot or a scene file is placed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.project.schema import Positive, Table, Vector
from relume.scene.shapes.shapes import Mesh, Patches
from relume.sphere.directions import rotation_about


class Placement(Table):
    """How a mesh is scaled, then turned about x, y and z, then moved, after its own transform."""

    scale: Positive = 1.0
    rotate: Vector = (0.0, 0.0, 0.0)
    translate: Vector = (0.0, 0.0, 0.0)


def placed(mesh: Mesh, placement: Placement) -> Mesh:
    """The mesh scaled, then turned about x, then y, then z, then moved."""
    turn = turn_of(placement)
    vertices = placement.scale * (mesh.vertices @ turn.T) + np.array(placement.translate)
    normals = None if mesh.normals is None else (mesh.normals @ turn.T).astype(np.float32)
    return replace(mesh, vertices=vertices.astype(np.float32), normals=normals)


def placed_patches(patches: Patches, placement: Placement) -> Patches:
    """The patches placed as a mesh is."""
    control = placement.scale * (patches.control @ turn_of(placement).T) + np.array(placement.translate)
    return replace(patches, control=control)


def turn_of(placement: Placement) -> np.ndarray:
    """The rotation of a placement."""
    x, y, z = np.radians(placement.rotate)
    return rotation_about([0, 0, 1], z) @ rotation_about([0, 1, 0], y) @ rotation_about([1, 0, 0], x)
