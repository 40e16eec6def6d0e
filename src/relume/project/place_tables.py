"""What shot and scene files say of a place: its real surfaces, the distant scene beyond them, and what fills it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.errors import UnreadableFile
from relume.project.mesh_tables import Placement, placed
from relume.project.schema import GreyOrColour, Positive, Table, Vector
from relume.scene.lights import RectangleLight
from relume.scene.materials.media import Medium
from relume.scene.places.reading import read_shapes
from relume.scene.scene import Box, Distant, Dome, Enclosure, Infinite
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Plane, Shape, Sphere

_LOCAL_NEEDS = {"plane": (), "box": ("low", "high"), "sphere": ("centre", "radius"), "mesh": ("mesh",)}
_LOCAL_MAY = {"plane": ("size", "height"), "box": (), "sphere": (), "mesh": ()}
_SHAPES = {name for names in (*_LOCAL_NEEDS.values(), *_LOCAL_MAY.values()) for name in names}
"""What gives a real surface its shape; each belongs to one."""
_DISTANT_NEEDS = {"infinite": set(), "dome": {"radius"}, "box": {"low", "high"}, "mesh": {"mesh"}}
_DISTANT_MAY = {"dome": {"centre"}}


def _require_box(low: Vector | None, high: Vector | None) -> None:
    if low is not None and high is not None and not np.all(np.less(low, high)):
        raise ValueError(f"the box goes from {list(low)} to {list(high)}; each of low lies below its high")


class SurfaceShape(Placement):
    """The shape of a real surface.

    shape : a horizontal plane of a size at a height, a box from one corner to the other, or a mesh or a place
        file, then placed as objects are; or a sphere about its centre
    """

    shape: Literal["plane", "box", "sphere", "mesh"]
    size: tuple[Positive, Positive] | None = None
    height: float = 0.0
    low: Vector | None = None
    high: Vector | None = None
    centre: Vector | None = None
    radius: Positive | None = None
    mesh: str | None = None

    @model_validator(mode="after")
    def _what_the_shape_needs(self) -> SurfaceShape:
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
        return self

    def shaped(self, material: AnyMaterial | None, folder: Path) -> tuple[Shape, ...]:
        """The surface of a material; meshes keep their own where that is None. Raises UnreadableFile."""
        if self.shape == "mesh":
            assert self.mesh is not None  # _what_the_shape_needs
            meshes = (placed(mesh, self) for mesh in read_shapes(folder / self.mesh))
            return tuple(mesh if material is None else replace(mesh, material=material) for mesh in meshes)
        assert material is not None  # all but meshes have none of their own
        if self.shape == "plane" and not self._is_placed:
            return (Plane(material, self.size, self.height),)
        if self.shape == "plane":
            assert self.size is not None  # _what_the_shape_needs
            return (placed(_rectangle(self.size, self.height, material), self),)
        if self.shape == "box":
            from relume.composite.surface.projection import box_mesh  # compiled loops: most tables need none

            assert self.low is not None and self.high is not None  # _what_the_shape_needs
            return (placed(box_mesh(self.low, self.high, material), self),)
        assert self.centre is not None and self.radius is not None  # _what_the_shape_needs
        return (Sphere(self.centre, self.radius, material),)

    @property
    def _is_placed(self) -> bool:
        return (self.scale, self.rotate, self.translate) != (1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def files(self) -> tuple[str, ...]:
        """The files that the table names."""
        return () if self.mesh is None else (self.mesh,)


def _rectangle(size: tuple[float, float], height: float, material: AnyMaterial) -> Mesh:
    """The plane as two triangles that face up."""
    x, z = size[0] / 2, size[1] / 2
    corners = np.array([[-x, height, z], [x, height, z], [x, height, -z], [-x, height, -z]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), material, name="plane")


class MediumTable(Table):
    """What fills all space outside of bodies, as fog does.

    absorption, scattering : per metre, a number or one for each channel
    anisotropy : mean cosine of the scattering, −1 to 1 exclusive; 0 even
    """

    absorption: GreyOrColour = (0.0, 0.0, 0.0)
    scattering: GreyOrColour = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0

    @model_validator(mode="after")
    def _of_a_medium(self) -> MediumTable:
        self.medium()
        return self

    def medium(self) -> Medium:
        """The medium."""
        return Medium(self.absorption, self.scattering, self.anisotropy)


class DistantTable(Table):
    """The shape of the distant scene.

    shape : infinite, unless it is a dome of a radius about a centre, a box from one corner to the other, or a mesh
    radiance : of a mesh: "map", what a probe saw is projected onto it; "own", it shines by its own emissive textures
    lamps : of a mesh of its own radiance: so many of its brightest spots at most become lamps, which renderers find
    receives : names of meshes of its own radiance that take light instead: objects throw shadows on them
    """

    shape: Literal["infinite", "dome", "box", "mesh"] = "infinite"
    radius: Positive | None = None
    centre: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    mesh: str | None = None
    radiance: Literal["map", "own"] = "map"
    lamps: Annotated[int, Field(ge=0, le=256)] = 0
    receives: tuple[str, ...] = ()

    @property
    def is_projected(self) -> bool:
        """Whether a map that was taken at a place is projected onto it."""
        return self.shape != "infinite" and self.radiance == "map"

    @model_validator(mode="after")
    def _own_radiance(self) -> DistantTable:
        if self.radiance == "own" and self.shape != "mesh":
            raise ValueError(
                f'radiance = "own" is of a mesh with emissive textures; {self.shape} has none: leave it out'
            )
        if self.radiance == "map" and (self.lamps or self.receives):
            raise ValueError('lamps and receives are of a mesh with radiance = "own"; add that, or leave them out')
        return self

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
    """What a table describes; raises UnreadableFile for a mesh that cannot be read, or is none of finite places.

    A mesh of its own radiance is a part of the scene (`shining_place`): what lies beyond it is infinitely far.
    """
    if table.radiance == "own":
        return Infinite()
    if table.shape == "dome":
        assert table.radius is not None  # _what_the_shape_needs
        return Dome(table.radius, table.centre or (0.0, 0.0, 0.0))
    if table.shape == "box":
        assert table.low is not None and table.high is not None
        return Box(table.low, table.high)
    if table.shape == "mesh":
        assert table.mesh is not None
        parts = read_shapes(folder / table.mesh)
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
        try:
            return Enclosure(vertices, faces.astype(np.int32))
        except ValueError as error:
            raise UnreadableFile(f"light.distant.mesh: {table.mesh}: {error}") from None
    return Infinite()


def shining_place(
    table: DistantTable, folder: Path, scale: np.ndarray | float = 1.0
) -> tuple[tuple[Mesh, ...], tuple[RectangleLight, ...]]:
    """The meshes that shine by their own radiance, or take light, and the lamps among them; none of other tables.

    scale : by which their radiance is multiplied, a number or one for each channel

    Raises UnreadableFile, and ValueError for meshes without emissive textures and names that none has.
    """
    if table.radiance != "own":
        return (), ()
    from relume.renderers.projective.place_light import place_lights, receiving
    from relume.renderers.projective.shining_meshes import place_of

    assert table.mesh is not None  # _what_the_shape_needs
    place = place_of(read_shapes(folder / table.mesh))
    if np.any(np.not_equal(scale, 1)):
        place = replace(place, parts=tuple(p.shining((p.radiance * scale).astype(np.float32)) for p in place.parts))
    meshes = receiving(place, table.receives)
    if not table.lamps:
        return meshes, ()
    # What a receiving mesh sends out comes from what lights it: a sunlit patch of it as a lamp would count twice.
    found = place_lights(place, table.lamps, leave_out=table.receives)
    dimmed = {part.mesh.name: part.mesh for part in found.residual.parts}
    return tuple(mesh if mesh.name in table.receives else dimmed[mesh.name] for mesh in meshes), found.lights
