"""Convolution functions f(x) of the cosine x between a table's direction and the light's (Miller & Hoffman 1984, §6).

A lobe is a frozen value that is called with cosines. `k` is the paper's kd or ks; `mirror` is the share that is
reflected unblurred; `integral` is ∫ f over the sphere, without the mirror's share; `width` is about the peak's half
width in radians, for whoever chooses sampling.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np


def check_alpha(name: str, alpha: float) -> None:
    """Refuse a width of microfacets that is not above 0 and at most 1."""
    if not 0 < alpha <= 1:
        raise ValueError(f"alpha of {name} is {alpha}; expected above 0 and at most 1")


def check_glossiness(name: str, n: float) -> None:
    """Refuse an exponent of a cosine that is not a number from 0 on."""
    if not 0 <= n < np.inf:
        raise ValueError(f"n of {name} is {n}; expected a glossiness of 0 or more")


class _Lobe:
    """What all lobes have."""

    name: ClassVar[str]
    k: float

    def __post_init__(self) -> None:
        if not 0 <= self.k < np.inf:
            raise ValueError(f"k of {self.name} is {self.k}; expected a reflectance of 0 or more")


@dataclass(frozen=True)
class Lambert(_Lobe):
    """Diffuse reflection, f_d(x) = k·max(0, x) (§6.1, example 1)."""

    k: float = 1.0
    name: ClassVar[str] = "lambert"
    mirror: ClassVar[float] = 0.0
    width: ClassVar[float] = 1.0

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return self.k * np.maximum(cosine, 0)

    @property
    def integral(self) -> float:
        return np.pi * self.k


@dataclass(frozen=True)
class SelfLuminous(_Lobe):
    """A material that glows with the scene's mean light, f_d(x) = k for all x (§6.1, example 2)."""

    k: float = 1.0
    name: ClassVar[str] = "self-luminous"
    mirror: ClassVar[float] = 0.0
    width: ClassVar[float] = 3.0

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return np.full(np.shape(cosine), float(self.k))

    @property
    def integral(self) -> float:
        return 4 * np.pi * self.k


@dataclass(frozen=True)
class Mirror(_Lobe):
    """The perfect mirror, f_s(x) = 1 at x = 1 alone: the table is the illumination map (§6.2, example 1)."""

    k: float = 1.0
    name: ClassVar[str] = "mirror"
    width: ClassVar[float] = 0.0
    integral: ClassVar[float] = 0.0

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return np.zeros(np.shape(cosine))

    @property
    def mirror(self) -> float:
        return self.k


@dataclass(frozen=True)
class Phong(_Lobe):
    """Conventional Phong highlights, f_s(x) = k·xⁿ for x > 0 (§6.2, example 2).

    n : the glossiness; 0 is a lit hemisphere, 50 satin, 1000 nearly a mirror
    varnish : share of a clear coat's unblurred reflection, ".5 for x = 1" in example 3
    """

    n: float = 50.0
    k: float = 1.0
    varnish: float = 0.0
    name: ClassVar[str] = "phong"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_glossiness(self.name, self.n)
        if not 0 <= self.varnish < np.inf:
            raise ValueError(f"varnish of {self.name} is {self.varnish}; expected a share of 0 or more")

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return np.where(cosine > 0, self.k * np.maximum(cosine, 0) ** self.n, 0)

    @property
    def mirror(self) -> float:
        return self.varnish

    @property
    def width(self) -> float:
        return 1 / np.sqrt(self.n + 1)

    @property
    def integral(self) -> float:
        return 2 * np.pi * self.k / (self.n + 1)


VARNISH = 0.5
"""The clear coat of §6.2, example 3: `Phong(n, varnish=VARNISH)`."""


@dataclass(frozen=True)
class _OfFacets(_Lobe, ABC):
    """A lobe about R whose form is a BRDF's seen along the normal, scaled to the integral k."""

    alpha: float
    k: float = 1.0
    mirror: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_alpha(self.name, self.alpha)

    @abstractmethod
    def _shape(self, cosine: np.ndarray) -> np.ndarray:
        """The form, of any size."""

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return self._scale * self._shape(cosine)

    @cached_property
    def _scale(self) -> float:
        return self.k / _integral(self._shape, self.width)

    @property
    def width(self) -> float:
        return self.alpha

    @property
    def integral(self) -> float:
        return self.k


@dataclass(frozen=True)
class GGXLobe(_OfFacets):
    """The GGX distribution as a lobe about R, seen along the normal (N = V = R), scaled to the integral k.

    The usual two-dimensional approximation of game engines; `relume.light.reflection.glossy` has the whole BRDF.

    alpha : the microfacets' width, the square of the perceptual roughness (Walter et al. 2007)
    """

    name: ClassVar[str] = "ggx"

    def _shape(self, cosine: np.ndarray) -> np.ndarray:
        x, a2 = np.maximum(cosine, 0), self.alpha**2
        half = (1 + x) / 2  # (N·H)², with H half-way between N = V and L
        masking = 2 * x / np.maximum(x + np.sqrt(a2 + (1 - a2) * x**2), 1e-30)
        return a2 / (np.pi * (half * (a2 - 1) + 1) ** 2) * masking / 4


@dataclass(frozen=True)
class WardLobe(_OfFacets):
    """Ward's isotropic gaussian (Ward 1992, eq. 4) as a lobe about R, seen along the normal, scaled to the integral k.

    alpha : standard deviation of the surface slope
    """

    name: ClassVar[str] = "ward"

    def _shape(self, cosine: np.ndarray) -> np.ndarray:
        x = np.maximum(cosine, 0)
        tangent2 = (1 - x) / (1 + x)  # tan² of half the angle between N = V and L
        return np.sqrt(x) * np.exp(-tangent2 / self.alpha**2)


@dataclass(frozen=True)
class Flattened:
    """GGX's lobe in a table that is coarser than it: within `finest` of its peak it is flat; the rest is a mirror's.

    The tail keeps the halo about a lamp; the core falls into one entry of the table, whatever its form.

    finest : radians between the table's entries
    """

    lobe: GGXLobe
    finest: float
    name: ClassVar[str] = "flattened"

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return self.lobe(np.minimum(cosine, np.cos(self.finest)))

    @cached_property
    def integral(self) -> float:
        return _integral(self, self.finest)

    @property
    def k(self) -> float:
        return self.integral

    @property
    def mirror(self) -> float:
        return max(self.lobe.k - self.integral, 0.0)

    @property
    def width(self) -> float:
        return self.finest


@dataclass(frozen=True)
class Cosine(_Lobe):
    """Any function of the cosine: called with an array from −1 to 1, it returns an array of the same shape.

    function : f(x), finite and not below 0
    width : about the half width of its narrowest feature, radians; features much narrower are not seen
    """

    function: Callable[[np.ndarray], np.ndarray]
    k: float = 1.0
    width: float = 0.05
    name: str = "cosine"
    mirror: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        values = np.asarray(self.function(np.linspace(-1, 1, 2001)))
        if values.shape != (2001,) or not np.all(np.isfinite(values)) or values.min() < 0:
            found = (
                f"values from {values.min()} to {values.max()}" if values.shape == (2001,) else f"shape {values.shape}"
            )
            raise ValueError(
                f"the function of {self.name} returned {found} for 2001 cosines; "
                "it must return an array of that shape, of finite values of 0 or more"
            )

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return self.k * np.asarray(self.function(cosine), np.float64)

    @property
    def integral(self) -> float:
        return _integral(self, self.width)


Lobe = Lambert | SelfLuminous | Mirror | Phong | GGXLobe | WardLobe | Flattened | Cosine
"""What a table is convolved with."""


def quadrature(width: float, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles and weights (sin θ dθ) on [0, π], dense about a peak of that width, fit for harmonics up to `degree`.

    Gauss–Legendre on panels that double in length away from the peak and meet at the equator.
    """
    width = min(max(width, 1e-5), 1.0)
    inner = width * 2.0 ** np.arange(-1, 40)
    edges = np.concatenate([[0.0], inner[inner < np.pi / 2 * 0.9], [np.pi / 2, 3 * np.pi / 4, np.pi]])
    angles, weights = [], []
    for low, high in pairwise(edges):
        # Rules of hundreds of nodes would take longer to make than all that they are used for.
        pieces = 1 + int(degree * (high - low) / 64)
        half = (high - low) / (2 * pieces)
        nodes, shares = _rule(24 + int(degree * half))
        middles = low + half * (2 * np.arange(pieces) + 1)
        angles.append((middles[:, None] + half * nodes).ravel())
        weights.append(np.tile(half * shares, pieces))
    theta = np.concatenate(angles)
    return theta, np.concatenate(weights) * np.sin(theta)


@lru_cache(maxsize=64)
def _rule(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss–Legendre's nodes and weights on [−1, 1]; 24 to 56 of them are asked for, again and again."""
    return np.polynomial.legendre.leggauss(count)


def _integral(function: Callable[[np.ndarray], np.ndarray], width: float) -> float:
    theta, weights = quadrature(width, 512)
    return float(2 * np.pi * (function(np.cos(theta)) @ weights))
