"""Halation: light that passes the emulsion, is reflected at the back of the film and exposes it again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

REACH, FADE = 16.0, 0.6
"""Thicknesses of the base to which the halo is followed, and the share of that from which it is led down to nothing: an
edge would show about a lamp. 7 % of the light would land further out than it begins to fade; that is shared out."""
FINE = 6.0
"""Pixels to one thickness of the base at which the halo is computed: it has no finer detail than its ring."""


@dataclass(frozen=True)
class Halation:
    """A halo about every light, brightest in a ring where reflection becomes total.

    share : of each layer's exposure, the light that takes this way; in the layers' order (red, green, blue: red lies
        next to the base, and what gets through to it is red)
    thickness : of the base, µm; 125 is that of 35 mm film
    index : of refraction of the base, cellulose triacetate's

    Light that the emulsion scatters evenly into the base at angle θ to its normal is reflected at the back by Fresnel's
    R(θ) and arrives at r = 2 t tan θ. Lambert's law makes its exposure there
    h(r) = R(θ) · 4 t² / (π (r² + 4 t²)²), as Cornu found in 1890: nearly nothing until total reflection at
    r = 2 t / √(n² − 1), 0.23 mm here, and a tail outside it.
    """

    share: tuple[float, ...] = (0.01, 0.002, 0.0)
    thickness: float = 125.0
    index: float = 1.48

    def __post_init__(self) -> None:
        if not all(0 <= s < 1 for s in self.share):
            raise ValueError(f"share is {self.share}; expected numbers from 0 to below 1")
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise ValueError(f"thickness is {self.thickness}; expected micrometres, positive")
        if not (np.isfinite(self.index) and self.index > 1):
            raise ValueError(f"index is {self.index}; expected more than 1, that of air")

    def profile(self, radius: np.ndarray) -> np.ndarray:
        """Exposure h (…) per area, µm⁻², at radii (…) in µm; not normalised."""
        square = (np.asarray(radius, np.float64) / (2 * self.thickness)) ** 2
        return _reflectance(square / (1 + square), self.index) / (4 * np.pi * self.thickness**2 * (1 + square) ** 2)

    def step(self, pixel: float) -> int:
        """How many pixels of that width, µm, may be taken together without losing detail of the halo."""
        return max(1, int(self.thickness / (FINE * pixel)))

    def kernel(self, pixel: float) -> np.ndarray:
        """(2 R + 1, 2 R + 1) float64 of sum 1: where light goes that falls on a pixel of that width, µm."""
        reach = max(1, int(np.ceil(REACH * self.thickness / pixel)))
        parts = max(1, int(np.ceil(8 * pixel / self.thickness)), 4)
        inside = (np.arange(parts) + 0.5) / parts - 0.5
        at = ((np.arange(-reach, reach + 1)[:, None] + inside).ravel() * pixel) ** 2
        radius = np.sqrt(at[:, None] + at)
        left = np.clip((1 - radius / ((reach + 0.5) * pixel)) / (1 - FADE), 0, 1)
        fine = self.profile(radius) * left**2 * (3 - 2 * left)
        side = 2 * reach + 1
        kernel = fine.reshape(side, parts, side, parts).sum((1, 3))
        return kernel / kernel.sum()


def _reflectance(sine_squared: np.ndarray, index: float) -> np.ndarray:
    """Fresnel's reflectance (…) of unpolarised light inside a medium of that index, by sin² of its angle."""
    refracted = np.sqrt(np.maximum(1 - index**2 * sine_squared, 0))
    own = np.sqrt(1 - sine_squared)
    across = ((index * own - refracted) / (index * own + refracted)) ** 2
    along = ((index * refracted - own) / (index * refracted + own)) ** 2
    return np.where(index**2 * sine_squared >= 1, 1.0, (across + along) / 2)
