"""The shot's objects: meshes read, scaled, turned, moved and given their materials."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relume.scene.materials import Material
from relume.scene.meshes import read_meshes
from relume.scene.patches import Patches
from relume.scene.shapes import Mesh
from relume.shot.project import Object, Placement, Shot
from relume.sphere.directions import rotation_about


def placed_meshes(shot: Shot) -> tuple[Mesh, ...]:
    """Every mesh of every object of the shot, in world coordinates."""
    return tuple(
        _overridden(placed(mesh, table), table)
        for table in shot.objects
        for mesh in read_meshes(shot.folder / table.mesh)
    )


def placed(mesh: Mesh, placement: Placement) -> Mesh:
    """The mesh scaled, then turned about x, then y, then z, then moved."""
    turn = _turn(placement)
    vertices = placement.scale * (mesh.vertices @ turn.T) + np.array(placement.translate)
    normals = None if mesh.normals is None else (mesh.normals @ turn.T).astype(np.float32)
    return replace(mesh, vertices=vertices.astype(np.float32), normals=normals)


def placed_patches(patches: Patches, placement: Placement) -> Patches:
    """The patches placed as a mesh is."""
    control = placement.scale * (patches.control @ _turn(placement).T) + np.array(placement.translate)
    return replace(patches, control=control)


def _turn(placement: Placement) -> np.ndarray:
    x, y, z = np.radians(placement.rotate)
    return rotation_about([0, 0, 1], z) @ rotation_about([0, 1, 0], y) @ rotation_about([1, 0, 0], x)


def _overridden(mesh: Mesh, table: Object) -> Mesh:
    """The mesh with what the shot changes of its own material."""
    changes: dict[str, Any] = table.material.model_dump(exclude_none=True)
    if not isinstance(mesh.material, Material):
        return mesh
    return replace(mesh, material=replace(mesh.material, **changes))
