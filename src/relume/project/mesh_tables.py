"""What a mesh of a shot or a scene file is made of, and where it stands: its own material and place, with changes."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import Field, field_validator

from relume.project.schema import Positive, Share, Table, Vector
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Material, Ward
from relume.scene.materials.measured import MeasuredBRDF, read_merl
from relume.scene.materials.presets import material_preset
from relume.scene.shapes.shapes import Mesh, Patches
from relume.sphere.directions import rotation_about

MeshOrPatches = TypeVar("MeshOrPatches", Mesh, Patches)
NotNegative = Annotated[float, Field(ge=0)]
Light = tuple[NotNegative, NotNegative, NotNegative]
ShareColour = tuple[Share, Share, Share]


class MaterialTable(Table):
    """What to change of a mesh's own material, or of the `preset` that takes its place."""

    preset: str | None = None
    base_color: ShareColour | None = None
    metallic: Share | None = None
    roughness: Share | None = None
    transmission: Share | None = None
    ior: Annotated[float, Field(ge=1)] | None = None
    emission: Light | None = None
    alpha: Share | None = None
    clearcoat: Share | None = None
    clearcoat_roughness: Share | None = None
    sheen_color: ShareColour | None = None
    sheen_roughness: Share | None = None
    anisotropy: Share | None = None
    anisotropy_rotation: float | None = None
    specular: Share | None = None
    specular_color: Light | None = None
    thin: bool | None = None
    attenuation_color: ShareColour | None = None
    attenuation_distance: Positive | None = None
    dispersion: NotNegative | None = None
    scattering_distance: tuple[Positive, Positive, Positive] | None = None
    scattering_albedo: ShareColour | None = None
    scattering_anisotropy: Annotated[float, Field(gt=-1, lt=1)] | None = None
    reflectance: ShareColour | None = None
    alpha_x: Annotated[float, Field(ge=1e-3, le=1)] | None = None
    alpha_y: Annotated[float, Field(ge=1e-3, le=1)] | None = None
    diffuse: ShareColour | None = None
    # Of Ward's with scratches: degrees.
    rotation: float | None = None
    crossed: Share | None = None
    crossing: float | None = None
    # Of measured surfaces: a MERL .binary file, and what multiplies its values or those of a preset merl/NAME.
    file: str | None = None
    scale: Positive | None = None

    @field_validator("preset")
    @classmethod
    def _known(cls, value: str | None) -> str | None:
        if value is not None:
            material_preset(value)
        return value

    def apply(self, material: Any, folder: Path = Path()) -> Any:
        """The material that a mesh gets: its own, the preset or the measured one, with the changes.

        material : the mesh's own; of other kinds than `Material`, `Ward` and `ABCFacets` it stays as it is, unless a
            preset or a file is given
        folder : that the file's path is relative to
        Raises ValueError for changes that the material has no field for, or that contradict one another;
        UnreadableFile.
        """
        changes: dict[str, Any] = self.model_dump(exclude_none=True, exclude={"preset", "file", "scale"})
        if self.file is not None:
            if others := sorted({*changes, *(("preset",) if self.preset is not None else ())}):
                raise ValueError(f"{', '.join(others)}: a measured surface has none; leave them out, or leave file out")
            return scaled(read_merl(folder / self.file), self.scale)
        own = material_preset(self.preset) if self.preset is not None else material
        if self.scale is not None:
            own = scaled(own, self.scale)
        if not isinstance(own, Material | Ward | ABCFacets):
            return own
        known = {field.name for field in fields(own)}
        if foreign := sorted(set(changes) - known):
            kinds = {Ward: "a Ward surface", ABCFacets: "a fit to a measured surface"}
            kind = kinds.get(type(own), "a glTF material")
            raise ValueError(f"{', '.join(foreign)}: {kind} has none; it has {', '.join(sorted(known - {'name'}))}")
        for angle in ("rotation", "crossing"):
            if angle in changes:
                changes[angle] = float(np.radians(changes[angle]))
        return replace(own, **changes)


def scaled(material: Any, scale: float | None) -> Any:
    """A measured surface, or a fit to one, that returns `scale` times the light; raises ValueError for another."""
    if scale is None:
        return material
    if isinstance(material, MeasuredBRDF):
        return replace(material, values=(scale * material.values).astype(np.float32))
    if isinstance(material, ABCFacets):
        diffuse, strength = (triple(scale * np.asarray(each)) for each in (material.diffuse, material.strength))
        return replace(material, diffuse=diffuse, strength=strength)
    raise ValueError("scale: is of measured surfaces; give it with a file or a preset merl/NAME")


class Placement(Table):
    """How a mesh is scaled, then turned about x, y and z, then moved, after its own transform."""

    scale: Positive = 1.0
    rotate: Vector = (0.0, 0.0, 0.0)
    translate: Vector = (0.0, 0.0, 0.0)


def placed(solid: MeshOrPatches, placement: Placement) -> MeshOrPatches:
    """The mesh or the patches scaled, then turned about x, then y, then z, then moved."""
    turn, points = turn_of(placement), solid.vertices if isinstance(solid, Mesh) else solid.control
    moved = placement.scale * (points @ turn.T) + np.array(placement.translate)
    if not isinstance(solid, Mesh):
        return replace(solid, control=moved)
    normals = None if solid.normals is None else (solid.normals @ turn.T).astype(np.float32)
    return replace(solid, vertices=moved.astype(np.float32), normals=normals)


def turn_of(placement: Placement) -> np.ndarray:
    """The rotation of a placement."""
    x, y, z = np.radians(placement.rotate)
    return rotation_about([0, 0, 1], z) @ rotation_about([0, 1, 0], y) @ rotation_about([1, 0, 0], x)
