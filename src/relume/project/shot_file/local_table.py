"""The shot file's [[local]]: the real surfaces that the objects affect, and what is to be recovered of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from relume.project.place_tables import SurfaceShape
from relume.project.schema import ShareColour, Table
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.shapes.shapes import Shape

if TYPE_CHECKING:
    from relume.composite.surface.recovery import Recovery

GREY = Diffuse((0.5, 0.5, 0.5))
"""What a surface is made of until its reflectance is recovered."""

Light = Annotated[float, Field(ge=0)]


class GlossTable(Table):
    """A gloss that is known: its reflectance at normal incidence, 0.04 of most things that are not metals."""

    strength: Annotated[float, Field(ge=0, le=1)] = 0.04
    roughness: Annotated[float, Field(gt=0, le=1)]


class LocalTable(SurfaceShape):
    """A real surface that the objects affect.

    reflectance : "recover" for every pixel of the plate, "recover even" for one colour, or a colour that is known
    gloss : "recover" to find it from what plate and probe show of the same places; a known one; false where matte
    mirror : it is a mirror of this reflectance
    emission : the radiance that it sends out itself, in the plate's unit, evenly in all directions
    """

    reflectance: Literal["recover", "recover even"] | ShareColour = "recover"
    gloss: Literal[False, "recover"] | GlossTable = False
    mirror: bool = False
    emission: tuple[Light, Light, Light] | None = None

    @model_validator(mode="after")
    def _what_the_mirror_needs(self) -> LocalTable:
        if self.mirror and isinstance(self.reflectance, str):
            raise ValueError("a mirror's reflectance is given, not recovered, like [0.9, 0.9, 0.9]")
        if self.mirror and self.gloss:
            raise ValueError("a mirror has no gloss beside; leave gloss out")
        if self.emission is not None and isinstance(self.reflectance, str):
            raise ValueError(
                "of a surface that shines the reflectance is given, not recovered, like [0, 0, 0] of a lamp"
            )
        if self.emission is not None and (self.mirror or self.gloss):
            raise ValueError("a surface that shines is matte here; leave mirror and gloss out, or the emission")
        return self

    def shapes(self, folder: Path) -> tuple[Shape, ...]:
        """The surface with its own material, or grey where that is to be recovered; raises UnreadableFile."""
        return self.shaped(self._material(), folder)

    def wanted(self, seen_by_probe: bool) -> Recovery:
        """What is to be recovered; without a probe that shows the surface its gloss comes from the plate alone."""
        # Here and below: a page that reads the file needs no compiled loops and no renderer.
        from relume.composite.surface.gloss import Gloss
        from relume.composite.surface.recovery import (
            ConstantAlbedo,
            EstimatedGloss,
            KnownMaterial,
            Recovery,
            TexturedAlbedo,
        )

        if not isinstance(self.reflectance, str):
            return Recovery(KnownMaterial())
        gloss = Gloss(self.gloss.strength, self.gloss.roughness) if isinstance(self.gloss, GlossTable) else None
        albedo = TexturedAlbedo() if self.reflectance == "recover" else ConstantAlbedo()
        return Recovery(albedo, EstimatedGloss() if self.gloss == "recover" else gloss)

    def _material(self) -> Diffuse | Material:
        if isinstance(self.reflectance, str):
            return GREY
        if self.emission is not None:
            return Material(self.reflectance, roughness=1.0, specular=0.0, emission=self.emission, name="light")
        if self.mirror:
            return Material(self.reflectance, metallic=1.0, roughness=0.0, name="mirror")
        if isinstance(self.gloss, GlossTable):
            from relume.composite.surface.gloss import Gloss, glossy

            return glossy(self.reflectance, Gloss(self.gloss.strength, self.gloss.roughness))
        return Diffuse(self.reflectance)
