"""The shapes of a scene file: its objects, how they move, and its real surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import model_validator

from relume.errors import InvalidScene
from relume.project.keyed_values import motion_of, placement_at, table_at
from relume.project.mesh_tables import EdgeAngle, Placement, placed, turn_of
from relume.project.place_tables import SurfaceShape
from relume.project.scene_file.images import naming
from relume.project.scene_file.materials import has_images
from relume.project.schema import ShareColour, Table, Vector
from relume.project.shot_file.sequence_table import ObjectKey, require_rising
from relume.scene.materials.materials import Diffuse
from relume.scene.motion.animation import Animation, posed
from relume.scene.motion.keyframes import Interpolation
from relume.scene.motion.moving_objects import ObjectOrbit, turned
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Patches, Polygon, Shape, Solid, Sphere, read_patches
from relume.scene.shapes.smoothing import smoothed
from relume.scene.shapes.watertight import facing_outwards

PLACED_BY = {"sphere": "its centre and radius", "polygon": "its vertices"}
"""Objects that are not scaled, rotated and translated, and why."""


class SphereTable(Table):
    """An exact sphere."""

    centre: Vector
    radius: float


class OrbitTable(Table):
    """How an object goes round a vertical axis while a movie runs."""

    centre: Vector = (0.0, 0.0, 0.0)
    turns: float = 1.0


class ObjectTable(Placement):
    """A sphere, a polygon, or a mesh or patches placed as in the shot file; `material` names one of the file's.

    smooth : of a mesh, as in the shot file
    keyframes : of a sequence, as in the shot file; a sphere and a polygon are moved from where they stand
    """

    sphere: SphereTable | None = None
    mesh: str | None = None
    polygon: list[Vector] | None = None
    patches: str | None = None
    smooth: EdgeAngle | None = None
    material: str | None = None
    orbit: OrbitTable | None = None
    keyframes: tuple[ObjectKey, ...] = ()

    @property
    def shapes(self) -> list[str]:
        """Which shapes are given; one, of a table that is right."""
        return [name for name in ("sphere", "mesh", "polygon", "patches") if getattr(self, name) is not None]

    @model_validator(mode="after")
    def _one_shape(self) -> ObjectTable:
        require_rising(self.keyframes)
        if len(self.shapes) != 1:
            raise ValueError(
                f"has {' and '.join(self.shapes) or 'no shape'}; give one of sphere, mesh, polygon and patches"
            )
        (shape,) = self.shapes
        moved = sorted(Placement.model_fields.keys() & self.model_fields_set)
        if shape in PLACED_BY and moved:
            raise ValueError(f"has {moved[0]}, but a {shape} is placed by {PLACED_BY[shape]}; remove {moved[0]}")
        if self.smooth is not None and self.mesh is None:
            raise ValueError("has smooth, which is of a mesh; remove smooth")
        return self


class LocalTable(SurfaceShape):
    """A real surface, of a reflectance that is known or of one of the file's materials; meshes may keep their own."""

    reflectance: ShareColour | None = None
    material: str | None = None

    @model_validator(mode="after")
    def _one_surface(self) -> LocalTable:
        given = [name for name in ("reflectance", "material") if getattr(self, name) is not None]
        if len(given) != 1 and (given or self.shape != "mesh"):
            raise ValueError(f"has {'both' if given else 'neither'}; give one of reflectance and material")
        return self


def surfaces_of(table: LocalTable, key: str, materials: Mapping[str, AnyMaterial], path: Path) -> tuple[Shape, ...]:
    """The real surfaces that a table stands for; a mesh file may hold several. Raises InvalidScene naming the key."""
    material: AnyMaterial | None = None
    if table.reflectance is not None:
        material = Diffuse(table.reflectance)
    elif table.material is not None:
        material = _material(table.material, f"{path}: {key}", materials)
    with naming(f"{path}: {key}"):
        shapes = table.shaped(material, path.parent)
    if material is not None and has_images(material) and table.shape in ("box", "mesh"):
        _require_coordinates(shapes, f"{path}: {key}", table.material, table.mesh or "the box")
    return tuple(facing_outwards(shape) if isinstance(shape, Mesh) else shape for shape in shapes)


@dataclass(frozen=True, eq=False)
class MovingObject:
    """What a table of objects stands for, and how it moves.

    solids : of their materials, where their file has them; a mesh file may hold several
    placement : how they are scaled, turned and moved
    keys : what changes of that by the frame; of a sphere how far it is moved and how much larger it is
    motion : of its file; None where nothing moves in that
    orbit : how it goes round while a movie runs, or None
    key : of the table, for messages
    """

    solids: tuple[Solid, ...]
    placement: Placement
    keys: tuple[ObjectKey, ...] = ()
    motion: Animation | None = None
    orbit: ObjectOrbit | None = None
    key: str = ""

    @property
    def moves(self) -> bool:
        """Whether it is elsewhere, larger or turned in another frame; orbits left out."""
        return bool(self.keys) or self.motion is not None

    def at_rest(self) -> tuple[Solid, ...]:
        """The solids where the file's own words put them."""
        return tuple(_placed(solid, self.placement) for solid in self.solids)

    def at(self, frame: float, seconds: float, between: Interpolation, path: Path) -> tuple[Solid, ...]:
        """The solids at a frame, orbits left out; raises InvalidScene naming the key.

        seconds : since the file's own motion began
        """
        if not self.moves:
            return self.at_rest()
        place = f"{path}: {self.key}"
        with naming(place):
            meshes = tuple(solid for solid in self.solids if isinstance(solid, Mesh))
            solids = self.solids if self.motion is None else posed(meshes, self.motion, seconds)
        table = table_at(
            KeyedPlacement(**self.placement.model_dump()), placement_at(self.keys, frame, between), place, frame,
            InvalidScene,
        )  # fmt: skip
        with naming(place):
            return tuple(_placed(solid, table) for solid in solids)


class KeyedPlacement(Placement):
    """A placement with keys, which it loses as it is taken at a frame."""

    keyframes: tuple[ObjectKey, ...] = ()


def _placed(solid: Solid, placement: Placement) -> Solid:
    """The solid scaled, turned and moved; a sphere and a polygon about their middle, from where they stand."""
    if isinstance(solid, Mesh):
        return placed(solid, placement)
    if isinstance(solid, Patches):
        return placed(solid, placement)
    if placement.model_dump(include=set(Placement.model_fields)) == Placement().model_dump():
        return solid
    turn, away = turn_of(placement), np.array(placement.translate)
    if isinstance(solid, Polygon):
        middle = solid.vertices.mean(axis=0)
        return replace(solid, vertices=middle + placement.scale * ((solid.vertices - middle) @ turn.T) + away)
    moved = solid if np.array_equal(turn, np.eye(3)) else turned(solid, turn, solid.centre)
    assert isinstance(moved, Sphere)
    x, y, z = np.array(solid.centre) + away
    return replace(moved, centre=(float(x), float(y), float(z)), radius=solid.radius * placement.scale)


def object_of(table: ObjectTable, key: str, materials: Mapping[str, AnyMaterial], path: Path) -> MovingObject:
    """The object that a table stands for; raises InvalidScene naming the key, or the file that it names."""
    orbit = None if table.orbit is None else ObjectOrbit(table.orbit.centre, table.orbit.turns)
    motion = None if table.mesh is None else motion_of(path.parent / table.mesh)
    placement = Placement(scale=table.scale, rotate=table.rotate, translate=table.translate)
    return MovingObject(_solids(table, key, materials, path), placement, table.keyframes, motion, orbit, key)


def _solids(table: ObjectTable, key: str, materials: Mapping[str, AnyMaterial], path: Path) -> tuple[Solid, ...]:
    place = f"{path}: {key}"
    material = None if table.material is None else _material(table.material, place, materials)
    if table.mesh is not None:
        return _meshes(table, place, material, path.parent / table.mesh)
    (shape,) = table.shapes
    if material is None:
        who = "patches need" if shape == "patches" else f"a {shape} needs"
        raise InvalidScene(f"{place}.material: missing; {who} one, by its name in [materials]")
    with naming(f"{place}.{shape}"):
        if table.sphere is not None:
            return (Sphere(table.sphere.centre, table.sphere.radius, material, key),)
        if table.polygon is not None:
            return (Polygon(np.array(table.polygon, np.float64), material, key),)
        return (Patches(read_patches(path.parent / (table.patches or "")), material, key),)


def _meshes(table: ObjectTable, place: str, material: AnyMaterial | None, file: Path) -> tuple[Solid, ...]:
    with naming(f"{place}.mesh"):
        meshes = read_meshes(file)
    if table.smooth is not None:
        meshes = smoothed(meshes, table.smooth)
    if material is not None:
        if has_images(material):
            _require_coordinates(meshes, place, table.material, table.mesh)
        meshes = tuple(replace(mesh, material=material) for mesh in meshes)
    return tuple(facing_outwards(mesh) for mesh in meshes)


def _require_coordinates(shapes: Iterable[Shape], place: str, material: str | None, file: str | None) -> None:
    """Raises InvalidScene for a mesh without texture coordinates, of a material that has images."""
    for shape in shapes:
        if isinstance(shape, Mesh) and shape.uv is None:
            raise InvalidScene(
                f"{place}.material: {material!r} has an image, and mesh {shape.name!r} of {file} no texture "
                "coordinates; use a material of plain colours, or unwrap the mesh"
            )


def _material(name: str, place: str, materials: Mapping[str, AnyMaterial]) -> AnyMaterial:
    if name in materials:
        return materials[name]
    remedy = f"the file has {', '.join(materials)}" if materials else f"define [materials.{name}]"
    raise InvalidScene(f"{place}.material: no material {name!r}; {remedy}")
