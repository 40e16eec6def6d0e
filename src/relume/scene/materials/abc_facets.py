"""The ABC microfacet model of Löw, Kronander, Ynnerman and Unger, and its published fits to measured surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from relume.scene.materials.checks import Colour, check_range, check_shape
from relume.scene.materials.merl_fits import FITS

__all__ = ["MERL_FITS", "ABCFacets"]


@dataclass(frozen=True, eq=False)
class ABCFacets:
    """An isotropic surface by the ABC model, which fits measured highlights with their long tails.

    π·f = diffuse + F(θd)·G·D(θh)/(cos θ₁ cos θ₂) with D = strength/(1 + b·(1 − cos θh))^c, Fresnel's F of a dielectric
    of `ior`, and the masking G of V-shaped grooves ("BRDF models for accurate and efficient rendering of glossy
    surfaces", ACM Transactions on Graphics 31(1), 2012, eq. 15). The factor 1/π before D is that of the published fits.

    diffuse : albedo of the diffuse part per channel
    strength : A per channel, 0 or more; D is not normalised
    b, c : width and fall-off of the highlight, above 0
    ior : index of refraction, 1 or more
    name : for messages
    """

    diffuse: Colour
    strength: Colour
    b: float
    c: float
    ior: float
    name: str = ""

    def __post_init__(self) -> None:
        for field, highest in (("diffuse", 1.0), ("strength", np.inf)):
            check_shape(field, getattr(self, field), self.name, 3)
            check_range(field, getattr(self, field), self.name, 0.0, highest)
        for field in ("b", "c"):
            if not 0 < getattr(self, field) < np.inf:
                raise ValueError(f"{field} of material {self.name!r} is {getattr(self, field)}; expected above 0")
        if not 1 <= self.ior < np.inf:
            raise ValueError(f"ior of material {self.name!r} is {self.ior}; expected 1 or more")

    def evaluate(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The BRDF f (…, 3) in 1/sr for light from one direction to the other; 0 below the surface.

        one, other : (…, 3) unit, in the surface's frame, whose z is its normal
        """
        one, other = np.broadcast_arrays(np.asarray(one, float), np.asarray(other, float))
        above = (one[..., 2] > 0) & (other[..., 2] > 0)
        half = one + other
        length = np.linalg.norm(half, axis=-1)
        half = half / np.where(length > 0, length, 1)[..., None]
        up, facing = np.clip(half[..., 2], 0, 1), np.clip((one * half).sum(-1), 1e-9, 1)
        versine = 0.5 * (np.square(half[..., 0]) + np.square(half[..., 1]) + np.square(1 - up))
        facets = (1 + self.b * versine) ** -self.c
        low = np.minimum(one[..., 2], other[..., 2])
        masked = np.minimum(1, 2 * up * low / facing)
        product = np.where(above, one[..., 2] * other[..., 2], 1)
        shape = fresnel_reflectance(facing, self.ior) * masked * facets / product
        value = (np.array(self.diffuse) + shape[..., None] * np.array(self.strength)) / np.pi
        return np.where(above[..., None], value, 0.0)


def fresnel_reflectance(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Fresnel's reflectance of unpolarised light that enters a dielectric of `ior` ≥ 1."""
    inner = np.sqrt(1 - (1 - np.square(cosine)) / ior**2)
    parallel = (ior * cosine - inner) / (ior * cosine + inner)
    across = (cosine - ior * inner) / (cosine + ior * inner)
    return 0.5 * (parallel**2 + across**2)


@lru_cache(maxsize=1)
def _fits() -> Mapping[str, ABCFacets]:
    return MappingProxyType(
        {f"merl/{name}": ABCFacets(row[:3], row[3:6], *row[6:], name=f"merl/{name}") for name, row in FITS.items()}
    )


MERL_FITS: Mapping[str, ABCFacets] = _fits()
"""Presets by the names of the MERL database, each after "merl/"."""
