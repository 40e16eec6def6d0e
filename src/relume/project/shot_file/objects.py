"""The shot's objects: meshes read, scaled, turned, moved and given their materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.errors import Doubt, InvalidShot, UnreadableFile
from relume.project.mesh_tables import placed, warn_of_white_glass
from relume.project.shot_file.shot import Object, Shot
from relume.scene.cameras.camera import Camera
from relume.scene.gltf.animation import read_animation
from relume.scene.motion.animation import posed
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh, Plane, Shape
from relume.scene.shapes.smoothing import smoothed
from relume.scene.shapes.watertight import facing_outwards, inside

HOVERING = 0.005
"""Metres between all objects and the plane from which on they seem to hover."""
SUNK = 0.05
"""Of an object's height: deeper in the plane than the foot of anything that stands on it."""
FOOT = 0.02
"""Of an object's height above its lowest point: what stands on the table."""
SMALL, LARGE = 0.003, 4.0
"""Of its distance: a mesh that is shorter is not seen, one that is longer is not a thing on a table."""


def placed_meshes(shot: Shot) -> tuple[Mesh, ...]:
    """Every mesh of every object of the shot, in world coordinates.

    shot : as `read_shot` or `Shot.new` made it
    """
    return tuple(_overridden(mesh, table, shot.folder) for table in shot.objects for mesh in _in_place(shot, table))


def _in_place(shot: Shot, table: Object) -> Sequence[Mesh]:
    """An object's meshes scaled, turned, stood on the table and moved, as the shot asks."""
    path = shot.path(table.mesh)
    rest = read_meshes(path)
    if table.smooth is not None:
        rest = smoothed(rest, table.smooth)
    meshes = _moved(path, rest, table.time)
    # What moves keeps the size and the place that it has at rest: else it would swell, and walk without leaving.
    if table.size is not None:
        extent = np.ptp(np.concatenate([mesh.vertices for mesh in rest]), axis=0).max()
        if not extent > 0:
            raise InvalidShot(f"objects.size: {table.mesh} has no extent; give scale instead")
        table = table.model_copy(update={"scale": table.scale * table.size / float(extent)})
    stand = table.stand
    if stand is None and shot.camera.of_ball is not None and not any(table.translate) and table.stage is None:
        stand = (0.0, 0.0)
    if stand is None or stand is False:
        return [placed(mesh, table) for mesh in meshes]
    # The middle of its foot, once it is scaled and turned.
    unmoved = table.model_copy(update={"translate": (0.0, 0.0, 0.0)})
    there = [placed(mesh, unmoved) for mesh in meshes]
    points = np.concatenate([placed(mesh, unmoved).vertices for mesh in rest])
    low, high = points.min(0), points.max(0)
    foot = points[points[:, 1] <= low[1] + FOOT * (high[1] - low[1])]
    middle = (foot.min(0) + foot.max(0)) / 2
    moved = np.array([stand[0] - middle[0], -low[1], stand[1] - middle[2]])
    moved += np.array(table.translate)
    return [replace(mesh, vertices=(mesh.vertices + moved).astype(np.float32)) for mesh in there]


def _moved(path: Path, meshes: tuple[Mesh, ...], time: float | None) -> tuple[Mesh, ...]:
    """A file's meshes, where its own motion has them at a time in seconds; as they are without one."""
    motion = read_animation(path) if time is not None else None
    if motion is None or time is None:
        return meshes
    try:
        return posed(meshes, motion, time)
    except ValueError as error:
        raise InvalidShot(f"objects.mesh: {error}") from None


def _overridden(mesh: Mesh, table: Object, folder: Path) -> Mesh:
    """The mesh with the material that the shot gives it; what holds light inside is checked to be a body."""
    try:
        material = table.material.apply(mesh.material, folder)
    except (ValueError, UnreadableFile) as error:
        raise InvalidShot(f"objects.material: {error}") from None
    warn_of_white_glass(table.material, material, "objects.material")
    return facing_outwards(replace(mesh, material=material))


def require_outside(meshes: Sequence[Mesh], camera: Camera) -> None:
    """Raises InvalidShot where the camera is inside an object, which would be all that it sees."""
    for mesh in meshes:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        if np.all(camera.position > low) and np.all(camera.position < high) and inside(mesh, camera.position):
            raise InvalidShot(f"objects: the camera is inside {mesh.name!r}; move one of them, or is its scale wrong?")


def doubts_about(meshes: Sequence[Mesh], camera: Camera, local: Sequence[Shape]) -> tuple[Doubt, ...]:
    """Where the objects stand strangely: under a surface, behind the camera, in it or over it, or of a strange size."""
    found: list[Doubt] = []

    def add(line: str, effect: float) -> None:
        found.append(Doubt(line, effect))

    floor = min((shape.height for shape in local if isinstance(shape, Plane)), default=None)
    lowest = min((float(mesh.vertices[:, 1].min()) for mesh in meshes), default=0.0)
    if floor is not None and meshes and lowest > floor + HOVERING:
        add(f"the objects hover {lowest - floor:.3g} m over the plane; translate them down to stand on it", 0.2)
    for mesh in meshes:
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        if floor is not None and high[1] < floor:
            add(f"object {mesh.name!r} lies under the plane, {floor - high[1]:.3g} m below it; move it up", 0.5)
        elif floor is not None and low[1] < floor - SUNK * (high[1] - low[1]):
            deep = floor - low[1]
            add(f"object {mesh.name!r} reaches {deep:.3g} m into the plane; move it up to stand on it", 0.15)
        ahead = (mesh.vertices - camera.position) @ -camera.rotation[:, 2]
        if ahead.max() <= 0:
            add(f"object {mesh.name!r} is behind the camera; it can only be seen in mirrors and by its shadow", 0.15)
        distance, extent = float(np.linalg.norm((low + high) / 2 - camera.position)), float((high - low).max())
        if not SMALL * distance < extent < LARGE * distance:
            line = (
                f"object {mesh.name!r} is {extent:.3g} m long, {distance:.3g} m from the camera; is its file in "
                "metres? give it a size"
            )
            add(line, 0.2)
    return tuple(found)
