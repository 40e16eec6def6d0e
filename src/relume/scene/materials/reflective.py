"""Surfaces in the terms of Miller & Hoffman (1984): what they add up from reflection maps."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from relume.light.reflection.brdf import Reflectance
from relume.light.reflection.lobes import Lambert, Lobe, Mirror, Phong
from relume.light.reflection.weights import Complement, Even, Fresnel, Schlick, Weight
from relume.scene.materials.bumps import Bumps
from relume.scene.materials.materials import Colour


class Towards(Enum):
    """The direction by which a reflection map is looked up.

    NORMAL : N, for diffuse reflection (§3)
    REFLECTED : R = 2(E·N)N − E, for specular reflection (§3)
    VIEWER : E, for surfaces that send light back where it came from: lunar dust, road signs, cat's eyes (§9)
    REFRACTED : the view bent at a single surface (§9)
    """

    NORMAL = "normal"
    REFLECTED = "reflected"
    VIEWER = "viewer"
    REFRACTED = "refracted"


@dataclass(frozen=True, eq=False)
class Layer:
    """One term of line 9 (§3): (weight(E·N) · colour + grazing(E·N)) · table[direction].

    lobe : what the environment map is convolved with; a BRDF takes the three-dimensional map,
        which is looked up by N and E whatever `towards` says
    towards : which direction the table is looked up by
    weight : W_d or W_s
    colour : multiplies it; a triple, or an image (H, W, 3) float32 over the texture coordinates
    grazing : a second weight that the colour does not touch, as metals lose their colour at grazing angles
    ior : index of refraction, for Towards.REFRACTED
    """

    lobe: Lobe | Reflectance
    towards: Towards = Towards.REFLECTED
    weight: Weight = Even(1.0)
    colour: Colour | np.ndarray = (1.0, 1.0, 1.0)
    grazing: Weight = Even(0.0)
    ior: float = 1.5

    def __post_init__(self) -> None:
        colour = np.asarray(self.colour)
        if colour.shape[-1:] != (3,) or colour.ndim not in (1, 3) or not np.all((colour >= 0) & (colour < np.inf)):
            raise ValueError(
                f"colour of a layer has shape {colour.shape}; expected three numbers of 0 or more, or an image of them"
            )
        if not isinstance(self.lobe, Lobe | Reflectance):
            raise ValueError(
                f"lobe of a layer is {self.lobe!r}; expected one of relume.light.reflection.lobes or .brdf"
            )
        if not 0 < self.ior < np.inf:
            raise ValueError(f"ior of a layer is {self.ior}; expected above 0, like 1.5 for glass")


@dataclass(frozen=True, eq=False)
class Reflective:
    """A surface that reflects, or refracts once, the light of an environment map and nothing else.

    layers : the terms that are added up, diffuse and specular in the paper
    bumps : how its normals are wrinkled, or None
    name : for messages
    """

    layers: tuple[Layer, ...]
    bumps: Bumps | None = None
    name: str = ""


def glossy(
    diffuse: Colour | np.ndarray = (0.5, 0.5, 0.5),
    specular: Lobe | Reflectance = Phong(),
    *,
    specular_weight: Weight = Schlick(0.04),
    bumps: Bumps | None = None,
    name: str = "",
) -> Reflective:
    """Line 9 (§3): Lambert below a specular lobe; the diffuse part gets what the specular one leaves.

    diffuse : kd, a colour or an image
    specular : the lobe of S, Phong with n = 50 unless given
    specular_weight : W_s; Schlick's for glass of index 1.5 unless given; W_d is 1 − W_s
    """
    below = Layer(Lambert(), Towards.NORMAL, Complement(specular_weight), diffuse)
    return Reflective((below, Layer(specular, Towards.REFLECTED, specular_weight)), bumps, name)


def mirror(colour: Colour = (1.0, 1.0, 1.0), *, bumps: Bumps | None = None, name: str = "") -> Reflective:
    """A perfect mirror: its map is the environment map (§6.2)."""
    return Reflective((Layer(Mirror(), colour=colour),), bumps, name)


def retroreflector(
    colour: Colour = (1.0, 1.0, 1.0), lobe: Lobe = Phong(50), *, bumps: Bumps | None = None, name: str = ""
) -> Reflective:
    """A surface that sends light back towards where it came from (§9)."""
    return Reflective((Layer(lobe, Towards.VIEWER, colour=colour),), bumps, name)


def glass(
    ior: float = 1.5, colour: Colour = (1.0, 1.0, 1.0), *, bumps: Bumps | None = None, name: str = ""
) -> Reflective:
    """Light refracted at a single surface, as in §9, below its exact Fresnel reflection."""
    through = Layer(Mirror(), Towards.REFRACTED, Complement(Fresnel(ior)), colour, ior=ior)
    return Reflective((Layer(Mirror(), Towards.REFLECTED, Fresnel(ior)), through), bumps, name)
