"""Surfaces in the terms of Whitted (1980): the coefficients of eq. 2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.scene.materials.bumps import Bumps
from relume.scene.materials.materials import Colour


@dataclass(frozen=True)
class Checks:
    """Cubes of two colours through space; a plane at y = 0 cuts the middle of a layer and shows squares.

    first, second : reflectance per channel; a cube of the first begins at x = z = 0
    size : of a cube's edge, metres
    """

    first: Colour = (1.0, 1.0, 1.0)
    second: Colour = (0.0, 0.0, 0.0)
    size: float = 1.0

    def __post_init__(self) -> None:
        _check_coefficient("first colour of checks", self.first)
        _check_coefficient("second colour of checks", self.second)
        if not 0 < self.size < np.inf:
            raise ValueError(f"size of checks is {self.size}; expected a positive length in metres")


Paint = Colour | Checks | np.ndarray


@dataclass(frozen=True, eq=False)
class WhittedMaterial:
    """I = ambient + k_d Σ (N·L) + k_s S + k_t T (Whitted 1980, eq. 2), with Phong's highlight of a light (eq. 1).

    Lights enter as their irradiance divided by π, so that `diffuse` is a Lambert surface's reflectance.

    diffuse : k_d, a colour, checks, or an image (H, W, 3) over the texture coordinates
    specular : k_s
    transmission : k_t
    ambient : times the ambient light's radiance; as `diffuse` unless given
    highlight : k_s of eq. 1; as `specular` unless given
    exponent : n of eq. 1, the glossiness; 50 is polished plastic
    ior : k_n, index of refraction of the inside to the outside
    fresnel : multiply k_s by Fresnel's reflectance and k_t by what it leaves ("for the best accuracy", §2)
    coated : what is diffuse and what goes through lie below the specular surface and get what it leaves, as in varnish
        and plastic
    roughness : standard deviation of the random perturbation of the normal, in both directions, of unit normals;
        glossy for reflection, frosted for transmission (§2)
    bumps : how normals are wrinkled (Blinn 1978), or None
    name : for messages

    Warns where a channel sends out more light than it receives.
    """

    diffuse: Paint = (0.0, 0.0, 0.0)
    specular: Colour = (0.0, 0.0, 0.0)
    transmission: Colour = (0.0, 0.0, 0.0)
    ambient: Colour | None = None
    highlight: Colour | None = None
    exponent: float = 50.0
    ior: float = 1.5
    fresnel: bool = False
    coated: bool = False
    roughness: float = 0.0
    bumps: Bumps | None = None
    name: str = ""

    def __post_init__(self) -> None:
        who = f" of material {self.name!r}"
        for field in ("diffuse", "specular", "transmission", "ambient", "highlight"):
            value = getattr(self, field)
            if value is not None and not isinstance(value, Checks):
                _check_coefficient(field + who, value, image=field == "diffuse")
        if not 0 < self.ior < np.inf:
            raise ValueError(f"ior{who} is {self.ior}; expected above 0, like 1.5 for glass")
        if not 0 < self.exponent < np.inf:
            raise ValueError(f"exponent{who} is {self.exponent}; expected above 0, like 50")
        if not 0 <= self.roughness < np.inf:
            raise ValueError(f"roughness{who} is {self.roughness}; expected 0 or more")
        most = self.most()
        if most > 1 + 1e-6:
            warn(
                f"material {self.name!r} creates energy: its coefficients add up to {most:.3g}; keep them at 1 or less"
            )

    def most(self) -> float:
        """The largest sum of what a channel reflects and lets through; Fresnel's law and coats share the light out."""
        diffuse = self.diffuse
        if isinstance(diffuse, Checks):
            diffuse = np.maximum(diffuse.first, diffuse.second)
        through, back = np.asarray(self.transmission), np.asarray(self.specular)
        if self.coated:
            return float(np.max(np.maximum(back, np.asarray(diffuse) + through)))
        return float(np.max(np.asarray(diffuse) + (np.maximum(through, back) if self.fresnel else through + back)))


def _check_coefficient(what: str, value: Colour | np.ndarray, *, image: bool = False) -> None:
    array = np.asarray(value)
    if array.shape[-1:] != (3,) or array.ndim not in ((1, 3) if image else (1,)) or not array.size:
        or_image = ", or an image of them (H, W, 3)" if image else ""
        raise ValueError(f"{what} has shape {array.shape}; expected three numbers{or_image}")
    if not np.all(np.isfinite(array)) or array.min() < 0:
        got = f"is {array.tolist()}" if array.size <= 3 else f"goes from {array.min():g} to {array.max():g}"
        raise ValueError(f"{what} {got}; expected finite numbers of 0 or more")
