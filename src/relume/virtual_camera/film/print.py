"""Printing paper: a characteristic curve that negatives are printed through, and its contrast grades."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve

GREY = 0.18
"""Reflectance, beside that of the paper's white, of what the light meter looked at."""
LIGHTEST, DARKEST = 0.04, 0.9
"""Density above the minimum, and share of the maximum, between which a paper's exposure range lies (ISO 6846)."""


@dataclass(frozen=True)
class Paper:
    """Paper that is exposed through a negative; all its layers have one curve.

    curve : reflection density over log₁₀ exposure
    """

    curve: CharacteristicCurve

    def range(self) -> float:
        """Log exposure range: decades between the first tone and nearly full black; ISO R is 100 × that (ISO 6846)."""
        ends = np.array([self.curve.minimum + LIGHTEST, DARKEST * self.curve.maximum])
        first, last = self.curve.log_exposure(ends)
        return float(last - first)

    def of_range(self, decades: float) -> Paper:
        """The same paper in another contrast grade: its curve drawn out along the exposures to that range."""
        if not (np.isfinite(decades) and decades > 0):
            raise ValueError(f"a range of {decades} decades; expected a positive number, 0.5 (hard) to 1.7 (soft)")
        wider = decades / self.range()
        curve = self.curve
        return Paper(replace(curve, gamma=curve.gamma / wider, toe=curve.toe * wider, inertia=curve.inertia * wider))

    def reflectance(self, log_exposure: np.ndarray) -> np.ndarray:
        """Reflectance (…) beside that of white paper at log₁₀ exposures (…)."""
        return 10 ** (self.curve.minimum - self.curve.density(log_exposure))

    def grey_exposure(self) -> float:
        """log₁₀ of the exposure that prints as GREY."""
        return float(self.curve.log_exposure(self.curve.minimum - np.log10(GREY)))
