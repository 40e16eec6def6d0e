"""The characteristic curve of a photographic layer: density over log exposure (Hurter & Driffield 1890)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class CharacteristicCurve:
    """Toe, straight line and shoulder in closed form: it rises everywhere, and all its derivatives are smooth.

    With softplus(z) = ln(1 + eᶻ), x = log₁₀ H and R = maximum − minimum:
    v = γ toe softplus((x − inertia) / toe), the straight line with its toe, and
    D = minimum + R (1 − softplus((R − v) / shoulder) / softplus(R / shoulder)), bent to the maximum.

    gamma : slope of the straight line, density per decade (Hurter & Driffield's development factor γ)
    minimum : density without light, fog and base
    maximum : density that no exposure exceeds
    toe : decades of exposure over which it bends up into the straight line
    shoulder : density over which it bends away from it
    inertia : log₁₀ of the exposure at which the straight line, drawn on, meets the minimum; lx·s for a film
    """

    gamma: float
    minimum: float
    maximum: float
    toe: float = 0.2
    shoulder: float = 0.3
    inertia: float = 0.0

    def __post_init__(self) -> None:
        for name in ("gamma", "toe", "shoulder"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} is {getattr(self, name)}; expected a positive number")
        if not (0 <= self.minimum < self.maximum and np.isfinite(self.maximum)):
            raise ValueError(f"densities from {self.minimum} to {self.maximum}; expected 0 ≤ minimum < maximum")
        if not np.isfinite(self.inertia):
            raise ValueError(f"inertia is {self.inertia}; expected the logarithm of an exposure")

    @property
    def span(self) -> float:
        """The density between minimum and maximum, R."""
        return self.maximum - self.minimum

    def density(self, log_exposure: np.ndarray | float) -> np.ndarray:
        """Density (…) at log₁₀ exposures (…); −∞ gives the minimum."""
        x = np.asarray(log_exposure, np.float64)
        line = self.gamma * self.toe * _softplus((x - self.inertia) / self.toe)
        return self.maximum - self._scale * _softplus((self.span - line) / self.shoulder)

    def log_exposure(self, density: np.ndarray | float) -> np.ndarray:
        """log₁₀ exposure (…) that gives densities (…); raises ValueError outside minimum < D < maximum."""
        density = np.asarray(density, np.float64)
        if not np.all((density > self.minimum) & (density < self.maximum)):
            raise ValueError(
                f"density {density.min():g} to {density.max():g}; this curve has those between {self.minimum:g} and "
                f"{self.maximum:g}"
            )
        line = self.span - self.shoulder * _softplus_inverse((self.maximum - density) / self._scale)
        return self.inertia + self.toe * _softplus_inverse(line / (self.gamma * self.toe))

    def through(self, log_exposure: float, density: float) -> CharacteristicCurve:
        """The same curve for a faster or slower layer: moved along the exposures to give `density` at one of them."""
        return replace(self, inertia=self.inertia + log_exposure - float(self.log_exposure(density)))

    @property
    def _scale(self) -> float:
        return self.span / float(_softplus(np.array(self.span / self.shoulder)))


def _softplus(z: np.ndarray) -> np.ndarray:
    return np.logaddexp(0.0, z)


def _softplus_inverse(y: np.ndarray) -> np.ndarray:
    # ln(eʸ − 1), written so that neither large nor small y loses digits.
    return y + np.log(-np.expm1(-y))
