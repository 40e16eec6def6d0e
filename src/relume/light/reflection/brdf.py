"""Isotropic reflection functions of view and light, times the cosine to the light, for three-dimensional maps (§9).

A BRDF is a frozen value that is called with the view's angle from the normal and with unit directions of light in
the frame N = +Z, E = (sin, 0, cos). `width` is about its lobe's half width in radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from relume.light.reflection.lobes import check_alpha, check_glossiness
from relume.light.reflection.weights import Even, Weight


@dataclass(frozen=True)
class GGX:
    """Microfacets of the GGX distribution with Smith's masking, one bounce between them (Walter et al. 2007, eq. 20).

    Masking and shadowing are separable, G₁(E)·G₁(L), as in Mitsuba, so that the two renderers agree. Light that would
    bounce between facets is lost: white GGX of α = 1 reflects 0.307 along the normal.

    alpha : the facets' width, the square of the perceptual roughness
    fresnel : reflectance of a facet by the cosine E·H; 1 unless given, so that W_s may hold it
    """

    alpha: float
    fresnel: Weight = Even(1.0)
    name: ClassVar[str] = "ggx"

    def __post_init__(self) -> None:
        check_alpha(self.name, self.alpha)

    @property
    def width(self) -> float:
        return self.alpha

    def __call__(self, view_angle: float, directions: np.ndarray) -> np.ndarray:
        a2, (half_normal, half_view) = self.alpha**2, _half(view_angle, directions)
        light, view = np.maximum(directions[..., 2], 0), np.cos(view_angle)
        distribution = a2 / (np.pi * (half_normal**2 * (a2 - 1) + 1) ** 2)

        def masking_over_cosine(cosine: np.ndarray | float) -> np.ndarray:
            return 2 / np.maximum(cosine + np.sqrt(a2 + (1 - a2) * np.square(cosine)), 1e-30)

        masking = masking_over_cosine(light) * masking_over_cosine(view)
        return np.asarray(self.fresnel(half_view)) * distribution * masking * light / 4


@dataclass(frozen=True)
class Ward:
    """Ward's isotropic gaussian, exp(−tan²δ/α²) / (4πα²√(cos θi cos θr)) (Ward 1992, eq. 4).

    alpha : standard deviation of the surface slope
    """

    alpha: float
    name: ClassVar[str] = "ward"

    def __post_init__(self) -> None:
        check_alpha(self.name, self.alpha)

    @property
    def width(self) -> float:
        return self.alpha

    def __call__(self, view_angle: float, directions: np.ndarray) -> np.ndarray:
        half_normal, _ = _half(view_angle, directions)
        light, view = np.maximum(directions[..., 2], 0), np.cos(view_angle)
        tangent2 = (1 - half_normal**2) / np.maximum(half_normal**2, 1e-30)
        gaussian = np.exp(-tangent2 / self.alpha**2) / (4 * np.pi * self.alpha**2)
        return gaussian * np.sqrt(light / np.maximum(view, 1e-6))


@dataclass(frozen=True)
class PhongReflectance:
    """Phong's lobe as a BRDF that reflects no more than it gets, (n + 2)/2π · (R·L)ⁿ (Lewis 1994).

    n : the glossiness
    """

    n: float = 50.0
    name: ClassVar[str] = "phong"

    def __post_init__(self) -> None:
        check_glossiness(self.name, self.n)

    @property
    def width(self) -> float:
        return float(1 / np.sqrt(self.n + 1))

    def __call__(self, view_angle: float, directions: np.ndarray) -> np.ndarray:
        reflected = np.array([-np.sin(view_angle), 0.0, np.cos(view_angle)])
        cosine, light = np.maximum(directions @ reflected, 0), np.maximum(directions[..., 2], 0)
        return (self.n + 2) / (2 * np.pi) * cosine**self.n * light


Reflectance = GGX | Ward | PhongReflectance
"""f_r(E, L)·max(0, N·L)."""


def _half(view_angle: float, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """N·H and E·H for H half-way between E and L."""
    view = np.array([np.sin(view_angle), 0.0, np.cos(view_angle)])
    half = directions + view
    x, y, z = half[..., 0], half[..., 1], half[..., 2]
    length = np.maximum(np.sqrt(x * x + y * y + z * z), 1e-12)  # thrice as fast as `norm` along a short axis
    return z / length, np.clip(half @ view / length, 0, 1)
