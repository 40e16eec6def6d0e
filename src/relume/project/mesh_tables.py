"""What a mesh of a shot or a scene file is made of, and where it stands: its own material and place, with changes."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator

from relume.errors import warn
from relume.project.schema import ForGrey, Positive, Share, ShareColour, Table, Vector
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.checks import triple
from relume.scene.materials.glasses import Cauchy, Sellmeier, glass_named
from relume.scene.materials.materials import Material, Ward
from relume.scene.materials.measured import MeasuredBRDF, read_merl
from relume.scene.materials.metals import metal_named
from relume.scene.materials.presets import material_preset
from relume.scene.shapes.shapes import Mesh, Patches
from relume.sphere.directions import rotation_about

MeshOrPatches = TypeVar("MeshOrPatches", Mesh, Patches)
NotNegative = Annotated[float, Field(ge=0)]
Light = Annotated[tuple[NotNegative, NotNegative, NotNegative], ForGrey]
EdgeAngle = Annotated[float, Field(gt=0, le=180)]
"""Degrees between the normals of two faces."""

BY_WAVELENGTH = ("glass", "sellmeier", "cauchy", "metal")


class SellmeierTable(Table):
    """The coefficients of Sellmeier's formula; C in µm²."""

    B: Annotated[tuple[float, ...], Field(min_length=1, max_length=8)]
    C: Annotated[tuple[float, ...], Field(min_length=1, max_length=8)]

    def made(self) -> Sellmeier:
        """The glass; raises ValueError where there is none of them."""
        return Sellmeier(self.B, self.C)


class CauchyTable(Table):
    """The coefficients of Cauchy's formula; B in µm², C in µm⁴."""

    A: float
    B: float
    C: float = 0.0

    def made(self) -> Cauchy:
        """The glass; raises ValueError where there is none of them."""
        return Cauchy(self.A, self.B, self.C)


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
    scattering_distance: Annotated[tuple[Positive, Positive, Positive], ForGrey] | None = None
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
    # By wavelength: instead of ior and dispersion, and of base_color and metallic.
    glass: str | None = None
    sellmeier: SellmeierTable | None = None
    cauchy: CauchyTable | None = None
    metal: str | None = None

    @field_validator("glass")
    @classmethod
    def _known_glass(cls, value: str | None) -> str | None:
        if value is not None:
            glass_named(value)
        return value

    @field_validator("metal")
    @classmethod
    def _known_metal(cls, value: str | None) -> str | None:
        if value is not None:
            metal_named(value)
        return value

    @model_validator(mode="after")
    def _one_index(self) -> Self:
        rivals = (("glass", "sellmeier", "cauchy", "ior"), ("glass", "sellmeier", "cauchy", "dispersion"))
        for names in (*rivals, ("metal", "base_color"), ("metal", "metallic"), ("metal", "glass")):
            if len(given := [name for name in names if getattr(self, name) is not None]) > 1:
                raise ValueError(f"has {' and '.join(given)}, which say the same; give one of them")
        for table in (self.sellmeier, self.cauchy):
            if table is not None:
                table.made()
        return self

    def _by_wavelength(self, own: Any) -> dict[str, Any]:
        """What the keys above change; a changed ior or colour takes the place of the material's own by wavelength."""
        glass = self.sellmeier.made() if self.sellmeier else self.cauchy.made() if self.cauchy else None
        glass = glass_named(self.glass) if self.glass is not None else glass
        changes: dict[str, Any] = {}
        if glass is not None:
            changes |= {"glass": glass, "ior": glass.n_d, "dispersion": glass.dispersion}
        elif getattr(own, "glass", None) is not None and (self.ior, self.dispersion) != (None, None):
            changes["glass"] = None
        if self.metal is not None:
            metal = metal_named(self.metal)
            changes |= {"metal": metal, "base_color": metal.base_color, "metallic": 1.0}
        elif getattr(own, "metal", None) is not None and (self.base_color, self.metallic) != (None, None):
            changes["metal"] = None
        return changes

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
        changes: dict[str, Any] = self.model_dump(
            exclude_none=True, exclude={"preset", "file", "scale", *BY_WAVELENGTH}
        )
        if self.file is not None:
            by_wavelength = {key for key in BY_WAVELENGTH if getattr(self, key) is not None}
            if others := sorted({*changes, *by_wavelength, *(("preset",) if self.preset is not None else ())}):
                raise ValueError(f"{', '.join(others)}: a measured surface has none; leave them out, or leave file out")
            return scaled(read_merl(folder / self.file), self.scale)
        own = material_preset(self.preset) if self.preset is not None else material
        if self.scale is not None:
            own = scaled(own, self.scale)
        changes |= self._by_wavelength(own)
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


def warn_of_white_glass(table: MaterialTable, material: Any, place: str) -> None:
    """A note where a material is given the index of a glass, and yet lets no light through."""
    glassy = any(each is not None for each in (table.glass, table.sellmeier, table.cauchy))
    if glassy and isinstance(material, Material) and not np.any(material.transmission):
        key = next(name for name in BY_WAVELENGTH if getattr(table, name) is not None)
        warn(f"{place}: has {key} but no transmission, so that it looks like white plastic; give transmission = 1")


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
