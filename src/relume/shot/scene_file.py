"""The scene file: one TOML that says which camera, light, materials and objects make a picture, for every renderer.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from relume.errors import InvalidScene
from relume.image import files
from relume.scene.camera import Camera
from relume.scene.materials import Diffuse
from relume.scene.meshes import read_meshes
from relume.scene.scene import Scene
from relume.scene.shapes import Mesh, Plane, Solid, Sphere
from relume.shot.objects import placed
from relume.shot.project import Placement, Surface
from relume.shot.scene_materials import AnyMaterial, SurfaceTable, has_images, made, naming
from relume.shot.schema import Positive, Share, Table, Vector, checked, read_toml
from relume.sphere.directions import UP, rotation_about
from relume.sphere.illumination import IlluminationMap, as_illumination
from relume.sphere.mappings import LatLong

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
    """What a scene file says: all that a renderer needs."""

    scene: Scene
    camera: Camera


Pixels = Annotated[int, Field(ge=1, le=65536)]


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


class LightTable(Table):
    """The light of the distant scene: a map, turned about +Y counter-clockwise as seen from above, and scaled."""

    map: str
    turn: float = 0.0
    scale: Positive = 1.0


class SphereTable(Table):
    """An exact sphere."""

    centre: Vector
    radius: float


class ObjectTable(Placement):
    """A sphere, or a mesh that is placed as in the shot file; `material` names one of the file's."""

    sphere: SphereTable | None = None
    mesh: str | None = None
    material: str | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> ObjectTable:
        if (self.sphere is None) == (self.mesh is None):
            raise ValueError(f"has {'neither' if self.mesh is None else 'both'}; give one of sphere and mesh")
        moved = sorted(Placement.model_fields.keys() & self.model_fields_set)
        if self.sphere is not None and moved:
            raise ValueError(f"has {moved[0]}, but a sphere is placed by its centre and radius; remove {moved[0]}")
        return self


class LocalTable(Surface):
    """A real surface, of a reflectance that is known."""

    reflectance: tuple[Share, Share, Share]


class SceneTable(Table):
    """A whole scene file."""

    camera: CameraTable
    light: LightTable
    materials: dict[str, SurfaceTable] = Field(default_factory=dict)
    objects: list[ObjectTable] = Field(default_factory=list)
    local: list[LocalTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _shows_something(self) -> SceneTable:
        if not self.objects and not self.local:
            raise ValueError("objects: none, so only the light would be seen; add [[objects]] with a sphere or a mesh")
        return self


def read_scene(path: str | Path) -> SceneFile:
    """Read a scene file with its light, meshes and images; raises InvalidScene naming the key and what it should be."""
    path = Path(path)
    table = checked(SceneTable, read_toml(path, "scene file", InvalidScene), path, "scene file", InvalidScene)
    with naming(f"{path}: camera"):
        camera = _camera(table.camera)
    with naming(f"{path}: light.map"):
        light = _read_light(path.parent / table.light.map)
    with naming(f"{path}: light.scale"):
        light = _adjusted(light, table.light)
    materials = {
        name: made(material, name, path.parent, f"{path}: materials.{name}")
        for name, material in table.materials.items()
    }
    planes = tuple(Plane(Diffuse(surface.reflectance), surface.size, surface.height) for surface in table.local)
    solids = (
        solid
        for index, item in enumerate(table.objects)
        for solid in _solids(item, f"objects.{index}", materials, path)
    )
    return SceneFile(Scene(light, planes, tuple(solids)), camera)


def scene_of_mesh(path: str | Path, light: str | Path, size: tuple[int, int] = SIZE) -> SceneFile:
    """A mesh of its own materials under the light of a map file, framed by a camera that looks along −Z from above.

    Raises UnreadableFile for a file that is missing or damaged, InvalidScene for a map of unknown mapping.
    """
    meshes = read_meshes(path)
    try:
        found = _read_light(Path(light))
    except ValueError as error:
        raise InvalidScene(str(error)) from None
    return SceneFile(Scene(found, objects=meshes), framing(meshes, size))


def framing(meshes: Iterable[Mesh], size: tuple[int, int] = SIZE) -> Camera:
    """A camera that sees the meshes' bounding sphere whole, a tenth enlarged, along −Z and a little from above."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float64)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = np.linalg.norm(vertices - centre, axis=1).max()
    focal_length = _focal_length(size[0], FIELD_OF_VIEW)
    half = np.arctan(min(size) / 2 / focal_length)
    back = np.array([0, np.sin(ELEVATION), np.cos(ELEVATION)])
    position = centre + MARGIN * radius / np.sin(half) * back
    return Camera.looking_at(position, centre, width=size[0], height=size[1], focal_length=focal_length)


def _focal_length(width: int, field_of_view: float) -> float:
    """In pixels, of a field of view across in degrees."""
    return float(width / 2 / np.tan(np.radians(field_of_view) / 2))


def _camera(table: CameraTable) -> Camera:
    width, height = table.size
    focal_length = _focal_length(width, table.field_of_view)
    return Camera.looking_at(
        np.array(table.position), np.array(table.target), width=width, height=height, focal_length=focal_length
    )


def _read_light(path: Path) -> IlluminationMap:
    picture = files.read_radiance(path)
    try:
        return as_illumination(picture)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _adjusted(light: IlluminationMap, table: LightTable) -> IlluminationMap:
    with np.errstate(over="ignore"):
        scaled = replace(light, radiance=(light.radiance * table.scale).astype(np.float32))
    angle = np.radians(table.turn % 360)
    if not angle:
        return scaled
    if not isinstance(light.mapping, LatLong):
        return scaled.rotated(rotation_about(UP, angle))
    # A turn about +Y only moves the columns, to smaller ones; what falls between two is shared, so no light is lost.
    columns = light.radiance.shape[1]
    whole, part = divmod(columns * (1 - angle / (2 * np.pi)), 1)
    near, far = (np.roll(scaled.radiance, int(whole) + step, axis=1) for step in (0, 1))
    return replace(scaled, radiance=(near * (1 - part) + far * part).astype(np.float32))


def _solids(table: ObjectTable, key: str, materials: dict[str, AnyMaterial], path: Path) -> tuple[Solid, ...]:
    place = f"{path}: {key}"
    name = table.material
    if name is not None and name not in materials:
        remedy = f"the file has {', '.join(materials)}" if materials else f"define [materials.{name}]"
        raise InvalidScene(f"{place}.material: no material {name!r}; {remedy}")
    if table.sphere is not None:
        if name is None:
            raise InvalidScene(f"{place}.material: missing; a sphere needs one, by its name in [materials]")
        with naming(f"{place}.sphere"):
            return (Sphere(table.sphere.centre, table.sphere.radius, materials[name], key),)
    with naming(f"{place}.mesh"):
        meshes = tuple(placed(mesh, table) for mesh in read_meshes(path.parent / (table.mesh or "")))
    if name is None:
        return meshes
    for mesh in meshes:
        if mesh.uv is None and has_images(materials[name]):
            raise InvalidScene(
                f"{place}.material: {name!r} has an image, and mesh {mesh.name!r} of {table.mesh} no texture "
                "coordinates; use a material of plain colours, or unwrap the mesh"
            )
    return tuple(replace(mesh, material=materials[name]) for mesh in meshes)
