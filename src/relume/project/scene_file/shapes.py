"""The shapes of a scene file: its objects, how they move, and its real surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import model_validator

from relume.errors import InvalidScene
from relume.project.mesh_tables import Placement, placed
from relume.project.scene_file.images import naming
from relume.project.scene_file.materials import has_images
from relume.project.schema import Positive, Share, Table, Vector
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.motion.moving_objects import ObjectOrbit
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import AnyMaterial, Patches, Plane, Polygon, Solid, Sphere, read_patches

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
    """A sphere, a polygon, or a mesh or patches placed as in the shot file; `material` names one of the file's."""

    sphere: SphereTable | None = None
    mesh: str | None = None
    polygon: list[Vector] | None = None
    patches: str | None = None
    material: str | None = None
    orbit: OrbitTable | None = None

    @property
    def shapes(self) -> list[str]:
        """Which shapes are given; one, of a table that is right."""
        return [name for name in ("sphere", "mesh", "polygon", "patches") if getattr(self, name) is not None]

    @model_validator(mode="after")
    def _one_shape(self) -> ObjectTable:
        if len(self.shapes) != 1:
            raise ValueError(
                f"has {' and '.join(self.shapes) or 'no shape'}; give one of sphere, mesh, polygon and patches"
            )
        (shape,) = self.shapes
        moved = sorted(Placement.model_fields.keys() & self.model_fields_set)
        if shape in PLACED_BY and moved:
            raise ValueError(f"has {moved[0]}, but a {shape} is placed by {PLACED_BY[shape]}; remove {moved[0]}")
        return self


class LocalTable(Table):
    """A real surface, of a reflectance that is known or of one of the file's materials."""

    shape: Literal["plane"]
    size: tuple[Positive, Positive] | None = None
    height: float = 0.0
    reflectance: tuple[Share, Share, Share] | None = None
    material: str | None = None

    @model_validator(mode="after")
    def _one_surface(self) -> LocalTable:
        if (self.reflectance is None) == (self.material is None):
            raise ValueError(
                f"has {'neither' if self.material is None else 'both'}; give one of reflectance and material"
            )
        return self


def plane_of(table: LocalTable, key: str, materials: Mapping[str, AnyMaterial], path: Path) -> Plane:
    """The real surface that a table stands for; raises InvalidScene naming the key."""
    if table.reflectance is not None:
        return Plane(Diffuse(table.reflectance), table.size, table.height)
    name = table.material or ""
    material = _material(name, f"{path}: {key}", materials)
    if not isinstance(material, Diffuse | WhittedMaterial):
        raise InvalidScene(f"{path}: {key}.material: {name!r} is neither diffuse nor whitted; a plane takes these two")
    return Plane(material, table.size, table.height)


def solids_of(
    table: ObjectTable, key: str, materials: Mapping[str, AnyMaterial], path: Path
) -> tuple[tuple[Solid, ObjectOrbit | None], ...]:
    """The solids that a table stands for, a mesh file may hold several, each with its orbit.

    Raises InvalidScene naming the key, or the file that it names.
    """
    orbit = None if table.orbit is None else ObjectOrbit(table.orbit.centre, table.orbit.turns)
    return tuple((solid, orbit) for solid in _solids(table, key, materials, path))


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
        control = read_patches(path.parent / (table.patches or ""))
        return (placed(Patches(control, material, key), table),)


def _meshes(table: ObjectTable, place: str, material: AnyMaterial | None, file: Path) -> tuple[Solid, ...]:
    with naming(f"{place}.mesh"):
        meshes = tuple(placed(mesh, table) for mesh in read_meshes(file))
    if material is None:
        return meshes
    for mesh in meshes:
        if mesh.uv is None and has_images(material):
            raise InvalidScene(
                f"{place}.material: {table.material!r} has an image, and mesh {mesh.name!r} of {table.mesh} no texture "
                "coordinates; use a material of plain colours, or unwrap the mesh"
            )
    return tuple(replace(mesh, material=material) for mesh in meshes)


def _material(name: str, place: str, materials: Mapping[str, AnyMaterial]) -> AnyMaterial:
    if name in materials:
        return materials[name]
    remedy = f"the file has {', '.join(materials)}" if materials else f"define [materials.{name}]"
    raise InvalidScene(f"{place}.material: no material {name!r}; {remedy}")
