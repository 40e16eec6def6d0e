"""Grain of a developed layer: how far density strays from its mean, by density and by the size of what is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve

APERTURE = 48.0
"""µm, diameter of the round aperture through which RMS granularity is measured."""
MEASURED_AT = 1.0
"""Density above the minimum at which RMS granularity is specified."""
REACH = 3.0
"""Deviations to which a clump is followed."""


@dataclass(frozen=True)
class DensityGrain:
    """Silver specks or dye clouds, each developed or not.

    granularity : RMS granularity: 1000 × the standard deviation of density through a 48 µm aperture at density 1 above
        the minimum
    clump : µm, standard deviation of the Gaussian that a speck and those it hangs together with cover
    fog : density that is developed without light: the minimum is grainy too

    By Selwyn's law (1935) σ_D √area is the same for all apertures larger than the clumps: the grain is white noise
    below their scale. Of many equal specks a share p is developed, so σ_D² ∝ p (1 − p): most in the middle densities,
    and as the root of density where few are (Nutting 1913).
    """

    granularity: float
    clump: float = 2.0
    fog: float = 0.05

    def __post_init__(self) -> None:
        if not (np.isfinite(self.granularity) and self.granularity > 0):
            raise ValueError(f"granularity is {self.granularity}; expected a positive number, or no grain at all")
        if not (np.isfinite(self.clump) and self.clump > 0):
            raise ValueError(f"clump is {self.clump}; expected micrometres, positive")
        if not (np.isfinite(self.fog) and self.fog >= 0):
            raise ValueError(f"fog is {self.fog}; expected a density, 0 or more")

    def selwyn(self) -> float:
        """G = σ_D √area of large apertures at density 1, µm.

        Clumps smooth what a 48 µm disc sees, radius a, to a share 1 − e⁻ᵗ (I₀(t) + I₁(t)) of G² / area with
        t = a² / 2 clump²: the noise's Gaussian spectrum under the disc's Airy pattern.
        """
        from scipy.special import ive

        t = (APERTURE / 2) ** 2 / (2 * self.clump**2)
        area = np.pi * (APERTURE / 2) ** 2
        return float(self.granularity / 1000 * np.sqrt(area / (1 - ive(0, t) - ive(1, t))))

    def strength(self, curve: CharacteristicCurve) -> float:
        """σ_D √area / √(d (R + fog − d)) of large apertures, µm, for d the density above minimum − fog."""
        at = min(MEASURED_AT, curve.span / 2) + self.fog
        return self.selwyn() / float(np.sqrt(at * (curve.span + self.fog - at)))

    def deviation(self, density: np.ndarray, curve: CharacteristicCurve, area: float) -> np.ndarray:
        """σ_D (…) through apertures of `area` µm², larger than the clumps, at mean densities (…)."""
        above = np.asarray(density, np.float64) - curve.minimum + self.fog
        return self.strength(curve) / np.sqrt(area) * np.sqrt(np.maximum(above * (curve.span + self.fog - above), 0))

    def taps(self, pixel: float) -> np.ndarray:
        """Weights (2 R + 1,) of sum 1, along rows and columns, that make clumps of white noise.

        pixel : its width on the film, µm
        """
        from scipy.special import erf

        sigma = self.clump / pixel
        reach = int(np.ceil(REACH * sigma - 0.5))
        edges = (np.arange(-reach, reach + 2) - 0.5) / (sigma * np.sqrt(2))
        taps = np.diff(erf(edges))
        return taps / taps.sum()
