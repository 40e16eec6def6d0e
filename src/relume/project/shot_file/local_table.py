"""The shot file's [[local]] and light.distant: the real surfaces that the objects affect, and what lies beyond."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.composite.surface.gloss import Gloss, glossy
from relume.composite.surface.projection import box_mesh
from relume.composite.surface.recovery import ConstantAlbedo, EstimatedGloss, KnownMaterial, Recovery, TexturedAlbedo
from relume.errors import InvalidShot
from relume.project.mesh_tables import Placement, placed
from relume.project.schema import Positive, Share, Table, Vector
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box, Distant, Dome, Enclosure, Infinite
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh, Plane, Shape, Sphere

GREY = Diffuse((0.5, 0.5, 0.5))
"""What a surface is made of until its reflectance is recovered."""


_LOCAL_NEEDS = {"plane": (), "box": ("low", "high"), "sphere": ("centre", "radius"), "mesh": ("mesh",)}
_LOCAL_MAY = {"plane": ("size", "height"), "box": (), "sphere": (), "mesh": ()}
_SHAPES = {name for names in (*_LOCAL_NEEDS.values(), *_LOCAL_MAY.values()) for name in names}
"""What gives a real surface its shape; each belongs to one."""
_DISTANT_NEEDS = {"infinite": set(), "dome": {"radius"}, "box": {"low", "high"}, "mesh": {"mesh"}}
_DISTANT_MAY = {"dome": {"centre"}}


def _require_box(low: Vector | None, high: Vector | None) -> None:
    if low is not None and high is not None and not np.all(np.less(low, high)):
        raise ValueError(f"the box goes from {list(low)} to {list(high)}; each of low lies below its high")


class GlossTable(Table):
    """A gloss that is known: its reflectance at normal incidence, 0.04 of most things that are not metals."""

    strength: Annotated[float, Field(ge=0, le=1)] = 0.04
    roughness: Annotated[float, Field(gt=0, le=1)]


class LocalTable(Placement):
    """A real surface that the objects affect.

    shape : a horizontal plane of a size at a height, a box from one corner to the other, or a mesh, then placed as
        objects are; or a sphere about its centre
    reflectance : "recover" for every pixel of the plate, "recover even" for one colour, or a colour that is known
    gloss : "recover" to find it from what plate and probe show of the same places; a known one; false where matte
    mirror : it is a mirror of this reflectance
    """

    shape: Literal["plane", "box", "sphere", "mesh"]
    size: tuple[Positive, Positive] | None = None
    height: float = 0.0
    low: Vector | None = None
    high: Vector | None = None
    centre: Vector | None = None
    radius: Positive | None = None
    mesh: str | None = None
    reflectance: Literal["recover", "recover even"] | tuple[Share, Share, Share] = "recover"
    gloss: Literal[False, "recover"] | GlossTable = False
    mirror: bool = False

    @model_validator(mode="after")
    def _what_the_shape_needs(self) -> LocalTable:
        needs = _LOCAL_NEEDS[self.shape]
        if lacking := [name for name in needs if getattr(self, name) is None]:
            raise ValueError(f"a {self.shape} needs {' and '.join(lacking)}")
        if foreign := [
            name for name in _SHAPES & self.model_fields_set if name not in (*needs, *_LOCAL_MAY[self.shape])
        ]:
            raise ValueError(f"{', '.join(sorted(foreign))}: not of a {self.shape}; leave it out")
        _require_box(self.low, self.high)
        if self.shape == "plane" and self.size is None and self._is_placed:
            raise ValueError("a plane that is scaled, rotated or moved needs a size = [x, z]")
        if self.shape == "sphere" and self._is_placed:
            raise ValueError("a sphere is placed by its centre and sized by its radius; leave the rest out")
        if self.mirror and isinstance(self.reflectance, str):
            raise ValueError("a mirror's reflectance is given, not recovered, like [0.9, 0.9, 0.9]")
        if self.mirror and self.gloss:
            raise ValueError("a mirror has no gloss beside; leave gloss out")
        return self

    def shapes(self, folder: Path) -> tuple[Shape, ...]:
        """The surface with its own material, or grey where that is to be recovered; raises UnreadableFile."""
        material = self._material()
        if self.shape == "plane" and not self._is_placed:
            return (Plane(material, self.size, self.height),)
        if self.shape == "plane":
            assert self.size is not None  # _what_the_shape_needs
            return (placed(_rectangle(self.size, self.height, material), self),)
        if self.shape == "box":
            assert self.low is not None and self.high is not None  # _what_the_shape_needs
            return (placed(box_mesh(self.low, self.high, material), self),)
        if self.shape == "sphere":
            assert self.centre is not None and self.radius is not None  # _what_the_shape_needs
            return (Sphere(self.centre, self.radius, material),)
        assert self.mesh is not None
        return tuple(replace(placed(m, self), material=material) for m in read_meshes(folder / self.mesh))

    def wanted(self, seen_by_probe: bool) -> Recovery:
        """What is to be recovered; without a probe that shows the surface its gloss comes from the plate alone."""
        if not isinstance(self.reflectance, str):
            return Recovery(KnownMaterial())
        gloss = Gloss(self.gloss.strength, self.gloss.roughness) if isinstance(self.gloss, GlossTable) else None
        albedo = TexturedAlbedo() if self.reflectance == "recover" else ConstantAlbedo()
        return Recovery(albedo, EstimatedGloss() if self.gloss == "recover" else gloss)

    @property
    def _is_placed(self) -> bool:
        return (self.scale, self.rotate, self.translate) != (1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def files(self) -> tuple[str, ...]:
        """The files that the table names."""
        return () if self.mesh is None else (self.mesh,)

    def _material(self) -> Diffuse | Material:
        if isinstance(self.reflectance, str):
            return GREY
        if self.mirror:
            return Material(self.reflectance, metallic=1.0, roughness=0.0, name="mirror")
        if isinstance(self.gloss, GlossTable):
            return glossy(self.reflectance, Gloss(self.gloss.strength, self.gloss.roughness))
        return Diffuse(self.reflectance)


def _rectangle(size: tuple[float, float], height: float, material: Diffuse | Material) -> Mesh:
    """The plane as two triangles that face up."""
    x, z = size[0] / 2, size[1] / 2
    corners = np.array([[-x, height, z], [x, height, z], [x, height, -z], [-x, height, -z]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), material, name="plane")


class DistantTable(Table):
    """The shape of the distant scene.

    shape : infinite, unless it is a dome of a radius about a centre, a box from one corner to the other, or a mesh
    """

    shape: Literal["infinite", "dome", "box", "mesh"] = "infinite"
    radius: Positive | None = None
    centre: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    mesh: str | None = None

    @model_validator(mode="after")
    def _what_the_shape_needs(self) -> DistantTable:
        given = {name for name in ("radius", "centre", "low", "high", "mesh") if getattr(self, name) is not None}
        if lacking := sorted(_DISTANT_NEEDS[self.shape] - given):
            raise ValueError(f"a distant scene that is a {self.shape} needs {' and '.join(lacking)}")
        if foreign := sorted(given - _DISTANT_NEEDS[self.shape] - _DISTANT_MAY.get(self.shape, set())):
            raise ValueError(f"{', '.join(foreign)}: not of a distant scene that is {self.shape}; leave it out")
        _require_box(self.low, self.high)
        return self


def distant_scene(table: DistantTable, folder: Path) -> Distant:
    """What a table describes; raises UnreadableFile for a mesh that cannot be read."""
    if table.shape == "dome":
        assert table.radius is not None  # _what_the_shape_needs
        return Dome(table.radius, table.centre or (0.0, 0.0, 0.0))
    if table.shape == "box":
        assert table.low is not None and table.high is not None
        return Box(table.low, table.high)
    if table.shape == "mesh":
        assert table.mesh is not None
        parts = read_meshes(folder / table.mesh)
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
        try:
            return Enclosure(vertices, faces.astype(np.int32))
        except ValueError as error:
            raise InvalidShot(f"light.distant.mesh: {table.mesh}: {error}") from None
    return Infinite()
