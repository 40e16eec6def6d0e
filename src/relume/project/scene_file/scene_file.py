"""The scene file: one TOML that says which camera, light, materials and objects make a picture, for every renderer.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import Field, model_validator

from relume.errors import InvalidScene, UnreadableFile, warn
from relume.project.keyed_values import BETWEEN
from relume.project.place_tables import MediumTable
from relume.project.scene_file.camera import FIELD_OF_VIEW, LARGEST, SIZE, CameraTable, camera_of, focal_length_of
from relume.project.scene_file.images import naming
from relume.project.scene_file.lamps import AnyLampTable, lamps_of
from relume.project.scene_file.lights import (
    LightTable,
    adjusted_light,
    distant_light,
    distant_of,
    hanging_in,
    joined_of,
    maps_of,
    read_light,
    shining_of,
)
from relume.project.scene_file.materials import SurfaceTable, made
from relume.project.scene_file.metering import shines
from relume.project.scene_file.sequence import SceneSequence, orbited
from relume.project.scene_file.shapes import LocalTable, ObjectTable, object_of, surfaces_of
from relume.project.scene_file.whitted_table import WhittedSettings, whitted_of
from relume.project.schema import Table, checked, read_toml
from relume.project.shot_file.sequence_table import SequenceTable
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.motion.moving_objects import ObjectOrbit
from relume.scene.scene import Scene
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import AnyMaterial
from relume.scene.shapes.suffixes import SUFFIXES as MESHES
from relume.sphere.environment_map import EnvironmentMap

SUFFIXES = (".toml", *MESHES)
MARGIN = 1.1
"""A framed object's bounding sphere fits the picture this much enlarged."""
ELEVATION = np.radians(15)
"""How far from above a framed object is seen."""


@dataclass(frozen=True, eq=False)
class SceneFile:
    """What a scene file says: all that a renderer needs.

    scene, camera : of one picture; of a file with a sequence those of its first frame
    whitted : the renderer of the table [whitted]
    orbits : how each of the scene's objects goes round while a movie runs, or None; as many as there are, or none
    asks_whitted : whether there is a table [whitted]
    sequence : which frames it asks for, and what moves in them; None of a single picture
    """

    scene: Scene
    camera: Camera
    whitted: Whitted = Whitted()
    orbits: tuple[ObjectOrbit | None, ...] = ()
    asks_whitted: bool = False
    sequence: SceneSequence | None = None

    @property
    def moves(self) -> bool:
        """Whether any object goes round."""
        return any(orbit is not None for orbit in self.orbits)

    def at(self, share: float) -> Scene:
        """The scene after this share of a movie, 0 to 1; the same one where nothing goes round."""
        return self.scene if not self.moves else orbited(self.scene, self.orbits, share)

    def at_frame(self, frame: float) -> tuple[Scene, Camera]:
        """The scene and its camera at a frame of the sequence, or between two; raises InvalidScene naming the key."""
        if self.sequence is None:
            raise InvalidScene('sequence: missing; give the frames to make, as [sequence] frames = "1-120"')
        return self.sequence.at(frame, self.scene, self.camera)

    def resized(self, width: int, height: int) -> SceneFile:
        """The same scene file in a picture of `width` × `height` pixels, at the same field of view across."""
        return replace(self, camera=self.camera.resized(width, height))

    def under(self, light: EnvironmentMap) -> SceneFile:
        """The same scene file under another light, which the keys of the sequence alone turn and brighten."""
        sequence = None if self.sequence is None else self.sequence.under(light)
        moved = replace(self, scene=replace(self.scene, light=light), sequence=sequence)
        if sequence is None:
            return moved
        scene, _ = moved.at_frame(sequence.table.frames[0])
        return replace(moved, scene=scene)


class SceneTable(Table):
    """A whole scene file."""

    camera: CameraTable
    light: LightTable | None = None
    lights: list[AnyLampTable] = Field(default_factory=list)
    materials: dict[str, SurfaceTable] = Field(default_factory=dict)
    objects: list[ObjectTable] = Field(default_factory=list)
    local: list[LocalTable] = Field(default_factory=list)
    whitted: WhittedSettings | None = None
    sequence: SequenceTable | None = None
    medium: MediumTable | None = None

    @model_validator(mode="after")
    def _shows_something(self) -> SceneTable:
        shines = self.light is not None and self.light.distant.radiance == "own"
        if not self.objects and not self.local and not shines:
            raise ValueError("objects: none, so only the light would be seen; add [[objects]] with a sphere or a mesh")
        return self

    @model_validator(mode="after")
    def _moves_in_a_sequence(self) -> SceneTable:
        if self.sequence is not None and self.sequence.plates is not None:
            raise ValueError("sequence.plates: a scene file has no plate; remove it")
        if self.sequence is None:
            tables = {f"objects.{index}": each.keyframes for index, each in enumerate(self.objects)}
            tables |= {f"lights.{index}": each.keyframes for index, each in enumerate(self.lights)}
            tables |= {"camera": self.camera.keyframes, "light": () if self.light is None else self.light.keyframes}
            for place, keys in tables.items():
                if keys:
                    raise ValueError(f'{place}.keyframes: of which frames? give [sequence] frames = "1-120"')
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
        read = read.under(read_light(Path(light)))
    return read if size is None else read.resized(*size)


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
    # Camera and light first: they are at the head of a file.
    first = None if table.sequence is None else table.sequence.frames[0]
    between = BETWEEN["linear" if table.sequence is None else table.sequence.interpolation]
    camera = camera_of(table.camera if first is None else table.camera.at(first, between, path), path,
                       None if first is None else 0.0)  # fmt: skip
    joined = joined_of(table.light, path)
    read = distant_light(table.light, path, joined)
    light = adjusted_light(read, table.light, path)
    distant, probe = distant_of(table.light, path, joined)
    shining, lamps = shining_of(table.light, path)
    light, hanging = hanging_in(light, joined, table.light)
    lights = (*lamps_of(table.lights, path), *hanging)
    for doubt in () if joined is None else joined.notes:
        warn(doubt.line, doubt.effect)
    # What they show.
    materials = {
        name: made(material, name, path.parent, f"{path}: materials.{name}")
        for name, material in table.materials.items()
    }
    local = [
        shape
        for index, item in enumerate(table.local)
        for shape in surfaces_of(item, f"local.{index}", materials, path)
    ]
    objects = tuple(object_of(item, f"objects.{index}", materials, path) for index, item in enumerate(table.objects))
    solids = tuple(solid for each in objects for solid in each.at_rest())
    with naming(f"{path}: medium"):
        medium = table.medium and table.medium.medium()
    scene = Scene(light, (*shining, *local), solids, (*lights, *lamps), distant, probe, medium)
    orbits = tuple(each.orbit for each in objects for _ in each.solids)
    # And how it moves.
    sequence = None
    if table.sequence is not None:
        maps = maps_of(table.light, path.absolute(), table.sequence.rate)
        sequence = SceneSequence(
            table.sequence, path.absolute(), table.camera, table.light, read, objects, maps, tuple(table.lights)
        )
        scene = sequence.scene_at(table.sequence.frames[0], scene)
    _require_light(table, scene, path)
    return SceneFile(scene, camera, whitted_of(table.whitted, path), orbits, table.whitted is not None, sequence)


def _require_light(table: SceneTable, scene: Scene, path: Path) -> None:
    """Raises InvalidScene where nothing shines."""
    if table.light is None and not scene.lights and not any(map(shines, (*scene.local, *scene.objects))):
        raise InvalidScene(
            f"{path}: light: missing, and there are neither [[lights]] nor a pbr material with emission, so all would "
            "be black; give one of the three"
        )


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
    focal_length = focal_length_of(size[0], FIELD_OF_VIEW)
    half = np.arctan(min(size) / 2 / focal_length)
    back = np.array([0, np.sin(ELEVATION), np.cos(ELEVATION)])
    position = centre + MARGIN * radius / np.sin(half) * back
    camera = Camera.looking_at(position, centre, width=size[0], height=size[1], focal_length=focal_length)
    return SceneFile(Scene(found, objects=meshes), camera)
