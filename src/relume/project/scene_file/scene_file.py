"""The scene file: one TOML that says which camera, light, materials and objects make a picture, for every renderer.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from relume.errors import InvalidScene, UnreadableFile
from relume.project.scene_file.images import naming
from relume.project.scene_file.lights import (
    AnyLightTable,
    AttenuationTable,
    LightTable,
    attenuation,
    distant_light,
    light_of,
    read_light,
)
from relume.project.scene_file.materials import SurfaceTable, made
from relume.project.scene_file.shapes import LocalTable, ObjectTable, plane_of, solids_of
from relume.project.schema import Table, Vector, checked, read_toml
from relume.renderers.whitted.antialiasing import Antialiasing
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.motion.moving_objects import ObjectOrbit
from relume.scene.scene import Scene
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import AnyMaterial


class WhittedSettings(Table):
    """How trees are traced and pixels subdivided; what is left out is as in `Whitted`."""

    depth: int | None = None
    contribution: float | None = None
    attenuation: AttenuationTable | None = None
    subdivisions: int | None = None
    tolerance: float | None = None
    antialiasing: bool = True
    constellation: int | None = None
    rays: int | None = None
    clear_shadows: bool | None = None

    @model_validator(mode="after")
    def _of_use(self) -> WhittedSettings:
        for name in ("subdivisions", "tolerance"):
            if not self.antialiasing and getattr(self, name) is not None:
                raise ValueError(f"has {name}, but antialiasing is false; remove one of them")
        return self


def whitted_of(table: WhittedSettings | None, path: Path) -> Whitted:
    """The renderer that the table describes; raises InvalidScene naming the key."""
    if table is None:
        return Whitted()
    place = f"{path}: whitted"
    given: dict[str, Any] = table.model_dump(
        exclude_none=True, exclude={"attenuation", "antialiasing", "subdivisions", "tolerance"}
    )
    with naming(place):
        finer = table.model_dump(exclude_none=True, include={"subdivisions", "tolerance"})
        given["antialiasing"] = replace(Antialiasing(), **finer) if table.antialiasing else None
        if table.attenuation is not None:
            given["attenuation"] = attenuation(table.attenuation, f"{place}.attenuation")
        return Whitted(**given)


SUFFIXES = (".toml", ".glb", ".gltf", ".obj", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
LARGEST = 65536
"""Pixels along a side of a picture."""
SIZE = (640, 480)
"""Pixels of a picture unless given."""
FIELD_OF_VIEW = 40.0
"""Degrees across, unless given."""
MARGIN = 1.1
"""A framed object's bounding sphere fits the picture this much enlarged."""
ELEVATION = np.radians(15)
"""How far from above a framed object is seen."""


@dataclass(frozen=True, eq=False)
class SceneFile:
    """What a scene file says: all that a renderer needs.

    whitted : the renderer of the table [whitted]
    orbits : how each of the scene's objects goes round while a movie runs, or None; as many as there are, or none
    asks_whitted : whether there is a table [whitted]
    """

    scene: Scene
    camera: Camera
    whitted: Whitted = Whitted()
    orbits: tuple[ObjectOrbit | None, ...] = ()
    asks_whitted: bool = False

    @property
    def moves(self) -> bool:
        """Whether any object goes round."""
        return any(orbit is not None for orbit in self.orbits)

    def at(self, share: float) -> Scene:
        """The scene after this share of a movie, 0 to 1; the same one where nothing goes round."""
        if not self.moves:
            return self.scene
        pairs = zip(self.scene.objects, self.orbits, strict=True)
        moved = tuple(solid if orbit is None else orbit.at(solid, share) for solid, orbit in pairs)
        return replace(self.scene, objects=moved)


Pixels = Annotated[int, Field(ge=1, le=LARGEST)]


class CameraTable(Table):
    """Where the picture is taken from, horizon level; the field of view is across."""

    position: Vector
    target: Vector
    field_of_view: Annotated[float, Field(gt=0, lt=180)] = FIELD_OF_VIEW
    size: tuple[Pixels, Pixels] = SIZE

    @model_validator(mode="after")
    def _looks_somewhere(self) -> CameraTable:
        if self.position == self.target:
            raise ValueError(f"target {list(self.target)} is where the camera stands; give another point to look at")
        return self


class SceneTable(Table):
    """A whole scene file."""

    camera: CameraTable
    light: LightTable | None = None
    lights: list[AnyLightTable] = Field(default_factory=list)
    materials: dict[str, SurfaceTable] = Field(default_factory=dict)
    objects: list[ObjectTable] = Field(default_factory=list)
    local: list[LocalTable] = Field(default_factory=list)
    whitted: WhittedSettings | None = None

    @model_validator(mode="after")
    def _shows_something(self) -> SceneTable:
        if not self.objects and not self.local:
            raise ValueError("objects: none, so only the light would be seen; add [[objects]] with a sphere or a mesh")
        return self

    @model_validator(mode="after")
    def _is_lit(self) -> SceneTable:
        if self.light is None and not self.lights:
            raise ValueError("light: missing, and there are no [[lights]], so all would be black; give one of the two")
        return self


def read_scene(path: str | Path, light: str | Path | None = None, size: tuple[int, int] | None = None) -> SceneFile:
    """Read a scene file, or a mesh as one, with its light, meshes and images.

    path : .toml; or a mesh of its own materials, which a camera frames that looks along −Z from above
    light : the file of an environment map instead of the scene file's; a mesh needs one
    size : width and height in pixels instead of the scene file's, at the same field of view across
    Raises InvalidScene naming the key and what it should be, UnreadableFile, ValueError.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".bpt":
        raise UnreadableFile(f'{path}: patches have no material; write patches = "{path.name}" in a scene file')
    if suffix not in SUFFIXES:
        raise UnreadableFile(f"{path}: neither a scene file nor a mesh; give {', '.join(SUFFIXES)}")
    if size is not None and not (1 <= min(size) and max(size) <= LARGEST):
        raise ValueError(f"the size is {size[0]}×{size[1]} pixels; give 1 to {LARGEST} along each side")
    if suffix != ".toml" and light is None:
        raise ValueError(f"{path}: a mesh has no light; give an environment map, or a scene file")
    # A mesh is framed in its size; a scene file's camera is resized, and its light replaced.
    if suffix != ".toml" and light is not None:
        return scene_of_mesh(path, light, size or SIZE)
    read = _read_table(path)
    if light is not None:
        read = replace(read, scene=replace(read.scene, light=read_light(Path(light))))
    return read if size is None else replace(read, camera=read.camera.resized(*size))


def scene_materials(path: str | os.PathLike[str]) -> dict[str, AnyMaterial]:
    """The materials of a scene file by their names, used or not; raises InvalidScene naming the key."""
    path = Path(path)
    table = checked(SceneTable, read_toml(path, "scene file", InvalidScene), path, "scene file", InvalidScene)
    return {
        name: made(material, name, path.parent, f"{path}: materials.{name}")
        for name, material in table.materials.items()
    }


def _read_table(path: Path) -> SceneFile:
    """A scene file's own words."""
    table = checked(SceneTable, read_toml(path, "scene file", InvalidScene), path, "scene file", InvalidScene)
    with naming(f"{path}: camera"):
        camera = _camera(table.camera)
    light = distant_light(table.light, path)
    lights = tuple(light_of(item, f"{path}: lights.{index}") for index, item in enumerate(table.lights))
    materials = {
        name: made(material, name, path.parent, f"{path}: materials.{name}")
        for name, material in table.materials.items()
    }
    planes = tuple(plane_of(item, f"local.{index}", materials, path) for index, item in enumerate(table.local))
    solids = [
        pair
        for index, item in enumerate(table.objects)
        for pair in solids_of(item, f"objects.{index}", materials, path)
    ]
    scene = Scene(light, planes, tuple(solid for solid, _ in solids), lights)
    orbits = tuple(orbit for _, orbit in solids)
    return SceneFile(scene, camera, whitted_of(table.whitted, path), orbits, table.whitted is not None)


def scene_of_mesh(path: str | Path, light: str | Path, size: tuple[int, int] = SIZE) -> SceneFile:
    """A mesh of its own materials under the light of a map file, framed by a camera that looks along −Z from above.

    Raises UnreadableFile for a file that is missing or damaged, InvalidScene for a map of unknown mapping.
    """
    meshes = read_meshes(path)
    try:
        found = read_light(Path(light))
    except ValueError as error:
        raise InvalidScene(str(error)) from None
    # The camera sees the meshes' bounding sphere whole, a tenth enlarged.
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float64)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = np.linalg.norm(vertices - centre, axis=1).max()
    focal_length = _focal_length(size[0], FIELD_OF_VIEW)
    half = np.arctan(min(size) / 2 / focal_length)
    back = np.array([0, np.sin(ELEVATION), np.cos(ELEVATION)])
    position = centre + MARGIN * radius / np.sin(half) * back
    camera = Camera.looking_at(position, centre, width=size[0], height=size[1], focal_length=focal_length)
    return SceneFile(Scene(found, objects=meshes), camera)


def _focal_length(width: int, field_of_view: float) -> float:
    """In pixels, of a field of view across in degrees."""
    return float(width / 2 / np.tan(np.radians(field_of_view) / 2))


def _camera(table: CameraTable) -> Camera:
    width, height = table.size
    focal_length = _focal_length(width, table.field_of_view)
    return Camera.looking_at(
        np.array(table.position), np.array(table.target), width=width, height=height, focal_length=focal_length
    )
