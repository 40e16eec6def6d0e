"""What is to be recovered of a real surface, and what was found about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.composite.surface.gloss import FittedGloss, Gloss
from relume.scene.materials.materials import Colour
from relume.scene.shapes.shapes import Shape


@dataclass(frozen=True)
class ConstantAlbedo:
    """One diffuse reflectance for the whole surface: the median of what its pixels say."""


@dataclass(frozen=True)
class TexturedAlbedo:
    """A diffuse reflectance for every pixel of the photograph, so that the model looks as the photograph does."""


@dataclass(frozen=True)
class KnownMaterial:
    """The surface's own material, as it is."""


@dataclass(frozen=True)
class EstimatedGloss:
    """The gloss is to be found from what the probe and the photograph show of the same places."""


@dataclass(frozen=True)
class Recovery:
    """What is to be recovered of a surface.

    albedo : TexturedAlbedo unless said otherwise: it is right for patterned and for even surfaces
    gloss : None for a matte surface; a known Gloss; or EstimatedGloss
    """

    albedo: ConstantAlbedo | TexturedAlbedo | KnownMaterial = TexturedAlbedo()
    gloss: Gloss | EstimatedGloss | None = None


@dataclass(frozen=True, eq=False)
class RecoveredSurface:
    """A real surface and what was found about it.

    reflectance : diffuse, per channel: the median over its pixels, within 0 to 1; None where it was given
    measured : the same before it was held within 0 to 1; above 1 says that the light is too weak for the plate
    spread : per channel, half the distance between the 16th and 84th percentile over the pixels
    pixels : how many of the plate's pixels were used
    gloss : its gloss, None for a matte or a given surface
    fitted : how the gloss was found, with its errors; None where it was given
    shapes : the surface for the scene: what the plate shows of it with the plate's albedo, and the rest with the median
    """

    reflectance: Colour | None
    measured: Colour | None
    spread: Colour | None
    pixels: int
    gloss: Gloss | None
    fitted: FittedGloss | None
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, eq=False)
class RecoveredLocal:
    """The local scene, un-lit.

    surfaces : one for each real surface, in the order given
    albedo : (H, W, 3) float32 diffuse reflectance in the plate's pixels, 0 to 1
    without : (H, W, 3) float32, the model's picture without objects, nearly free of noise, in the plate's unit
    textured : (H, W) bool, where the model shows the plate's own pixels as its texture: surfaces of TexturedAlbedo
    irradiance : (H, W, 3) float32, π times the diffuse radiance of an albedo of 1; of a matte surface, what arrives
    iterations : how often the light was rendered
    change : by how much it changed at last, as a share
    notes : a line each
    """

    surfaces: tuple[RecoveredSurface, ...]
    albedo: np.ndarray
    without: np.ndarray
    textured: np.ndarray
    irradiance: np.ndarray
    iterations: int
    change: float
    notes: tuple[str, ...]

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """All surfaces, for `Scene.local`."""
        return tuple(shape for surface in self.surfaces for shape in surface.shapes)


def called(local: Sequence[Shape], index: int) -> str:
    """What messages call a local surface."""
    return f"local surface {index + 1} ({getattr(local[index], 'name', 'plane')!r})"
