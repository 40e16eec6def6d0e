"""Film stock and printing paper: what light does to the layers of a film, and what a print shows of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.capture.scale.absolute import Q
from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve
from relume.virtual_camera.film.density_grain import DensityGrain
from relume.virtual_camera.film.halation import Halation

METER = 12.5
"""K of ISO 2720: a reflected-light meter gives N² / t = L S / K, L in cd/m²."""
APART = 0.02
"""Density difference that the eye still sees, held against a light."""


@dataclass(frozen=True, eq=False)
class FilmStock:
    """One layer of silver, or three of dye that were sensitive to red, green and blue.

    speed : ISO number; it belongs to the curves, which are in lx·s
    sensitivity : (layers, 3) exposure of each layer by linear Rec. 709 red, green and blue; each row of sum 1
    curves : of each layer
    crosstalk : (layers, layers) from the layers' densities above their minima to the densities that the paper, or an
        eye, sees. Each row has the sum 1, so that grey stays grey: above 1 in the middle where development in one
        layer holds back the others (interimage effect, colours gain), below where dyes absorb beside their own third
        of the spectrum (colours lose)
    grain : None for none
    halation : None for a film whose backing swallows all light
    reversal : a slide: densities fall as light rises. The curve is then that of the first developer, turned round
    """

    speed: float
    sensitivity: np.ndarray
    curves: tuple[CharacteristicCurve, ...]
    crosstalk: np.ndarray
    grain: DensityGrain | None = None
    halation: Halation | None = None
    reversal: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.speed) and self.speed > 0):
            raise ValueError(f"speed is {self.speed}; expected an ISO number, positive")
        layers = len(self.curves)
        if layers not in (1, 3) or self.sensitivity.shape != (layers, 3) or self.crosstalk.shape != (layers, layers):
            raise ValueError(
                f"{layers} curves, sensitivity {self.sensitivity.shape} and crosstalk {self.crosstalk.shape}; expected "
                "one layer with (1, 3) and (1, 1), or three with (3, 3) both"
            )
        for name in ("sensitivity", "crosstalk"):
            sums = getattr(self, name).sum(1)
            if not np.allclose(sums, 1, atol=1e-6):
                raise ValueError(f"the rows of {name} have the sums {sums}; expected 1 each, so that grey stays grey")
        if np.any(self.sensitivity < 0):
            raise ValueError("sensitivity is negative somewhere; light never takes exposure away")
        if self.halation is not None and len(self.halation.share) != layers:
            raise ValueError(f"halation has {len(self.halation.share)} shares and the film {layers} layers; one each")

    @property
    def grey_exposure(self) -> float:
        """lx·s that a light meter gives to what it looks at: q K / S, as H = q L t / N² (ISO 12232) has it."""
        return Q * METER / self.speed

    def reach(self) -> tuple[np.ndarray, np.ndarray]:
        """(layers,) least and most exposure, lx·s, that make a density APART from the curve's end."""
        ends = [10 ** c.log_exposure(np.array([c.minimum + APART, c.maximum - APART])) for c in self.curves]
        least, most = np.array(ends).T
        return least, most

    def density(self, exposure: np.ndarray, layer: int) -> np.ndarray:
        """Density (…) of one layer at exposures (…) in lx·s, without grain."""
        curve = self.curves[layer]
        with np.errstate(divide="ignore"):
            rising = curve.density(np.log10(np.asarray(exposure, np.float64)))
        return curve.minimum + curve.maximum - rising if self.reversal else rising

    def exposures(self, radiance: np.ndarray, factor: float) -> np.ndarray:
        """Exposure (…, layers) in lx·s by radiance (…, 3), of which a unit gives `factor` lx·s."""
        return np.maximum(radiance, 0) @ (factor * self.sensitivity.T)


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
