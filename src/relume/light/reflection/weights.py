"""W_d and W_s: how much a surface reflects as a function of the cosine between it and the viewer (§3, line 9; §7).

A weight is a frozen value that is called with cosines (…) and returns (…) or, for a coloured one, (…, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Weight(Protocol):
    """A reflectance that may depend on the angle of view."""

    def __call__(self, cosine: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Even:
    """The same at every angle.

    value : a number, or one for each channel
    """

    value: float | tuple[float, float, float] = 1.0

    def __post_init__(self) -> None:
        if not (np.all(np.asarray(self.value) >= 0) and np.all(np.isfinite(self.value))):
            raise ValueError(f"a weight of {self.value}; expected a reflectance of 0 or more")

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.asarray(self.value, np.float64), (*np.shape(cosine), *np.shape(self.value)))


@dataclass(frozen=True)
class Schlick:
    """F0 + (1 − F0)(1 − cos θ)⁵ (Schlick 1994, eq. 15).

    normal : reflectance F0 along the normal, a number or one for each channel; 0.04 as of glass of index 1.5
    """

    normal: float | tuple[float, float, float] = 0.04

    def __post_init__(self) -> None:
        if not (np.all(np.asarray(self.normal) >= 0) and np.all(np.asarray(self.normal) <= 1)):
            raise ValueError(f"reflectance along the normal is {self.normal}; expected 0 to 1")

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        grazing = (1 - np.clip(cosine, 0, 1)) ** 5
        f0 = np.asarray(self.normal, np.float64)
        return f0 + (1 - f0) * (grazing[..., None] if f0.ndim else grazing)


@dataclass(frozen=True)
class Fresnel:
    """The exact reflectance of an unpolarised smooth dielectric (Fresnel 1823).

    ior : index of refraction relative to the viewer's side; below 1 beyond the critical angle all is reflected
    """

    ior: float = 1.5

    def __post_init__(self) -> None:
        if not 0 < self.ior < np.inf:
            raise ValueError(f"index of refraction is {self.ior}; expected above 0, like 1.5 for glass")

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        c = np.clip(np.asarray(cosine, np.float64), 0, 1)
        g2 = self.ior**2 - 1 + c * c
        g = np.sqrt(np.maximum(g2, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            reflectance = 0.5 * ((g - c) / (g + c)) ** 2 * (1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2)
        return np.where((g2 <= 0) | (c == 0), 1.0, np.minimum(reflectance, 1.0))


@dataclass(frozen=True)
class ByAngle:
    """Values at angles of view evenly spaced from 0 to π/2, interpolated."""

    values: tuple[float, ...]

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        angles = np.arccos(np.clip(cosine, 0, 1))
        return np.interp(angles, np.linspace(0, np.pi / 2, len(self.values)), self.values)


@dataclass(frozen=True)
class Complement:
    """What a weight leaves for the layer below: 1 − weight."""

    weight: Weight

    def __call__(self, cosine: np.ndarray) -> np.ndarray:
        return np.maximum(1 - self.weight(cosine), 0)


ENTRIES = 1025


def tabulated(weight: Weight) -> np.ndarray:
    """A weight at cosines from 0 to 1, evenly spaced, for linear look-up: (ENTRIES, 3) float32."""
    values = np.asarray(weight(np.linspace(0, 1, ENTRIES)), np.float64)
    values = values[:, None] if values.ndim == 1 else values
    if values.shape not in ((ENTRIES, 1), (ENTRIES, 3)) or not np.all(np.isfinite(values)) or values.min() < 0:
        raise ValueError(f"a weight gave {values.shape}; it must return one or three finite reflectances for a cosine")
    return np.ascontiguousarray(np.broadcast_to(values, (ENTRIES, 3)), np.float32)
