"""The response as a polynomial (Mitsunaga & Nayar 1999) or as each value's mean exposure (Robertson et al. 2003)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.capture.response.sampling import Observations
from relume.errors import NotABracket


@dataclass(frozen=True)
class MitsunagaNayar:
    """Fits f⁻¹(m) = Σ cₙ mⁿ, f⁻¹(1) = 1, to f⁻¹(m_q) = R f⁻¹(m_q+1) of neighbouring exposures.

    degree : N of the polynomial; None takes the one from 1 to 10 with the least misfit, as the authors do
    rounds : how often the ratios R are estimated anew from the curve; 0, the default, takes the exposures as stated:
        curve and ratios share an exponent that the photographs cannot settle, and here the stated ones do
    trim : pixel values below the first or above the second, of 255, are left out: the method knows no weights
    """

    degree: int | None = None
    rounds: int = 0
    trim: tuple[float, float] = (5.0, 250.0)

    def __post_init__(self) -> None:
        if self.degree is not None and not 1 <= self.degree <= 10:
            raise ValueError(f"degree is {self.degree}; expected 1 to 10, or None to choose one")

    def curve(self, observed: Sequence[Observations], levels: int) -> tuple[np.ndarray, np.ndarray]:
        """The curve g (levels,), rising, 0 at the middle value; its standard error is not known: NaN (levels,).

        observed : the places that were seen at several exposures, a bracket each, of one channel
        levels : how many pixel values there are, 256 or 65536
        """
        pairs = self._pairs(observed, levels)
        if not pairs:
            raise NotABracket(
                f"no pixel lies between {self.trim[0]:g} and {self.trim[1]:g} of 255 in two neighbouring exposures; "
                "photograph at smaller exposure steps"
            )
        degrees = range(1, 11) if self.degree is None else (self.degree,)
        fits = [self._fitted(pairs, degree) for degree in degrees]
        coefficients = min(fits, key=lambda fit: fit[1])[0]
        exposure = np.polynomial.polynomial.polyval(np.linspace(0, 1, levels), coefficients)
        # A polynomial can fall or turn negative where no value was seen: it goes on from its least positive value.
        least = float(exposure[exposure > 0].min()) if np.any(exposure > 0) else 1e-6
        curve = np.maximum.accumulate(np.log(np.maximum(exposure, least))) + 1e-9 * np.arange(levels)
        return curve - curve[(levels - 1) // 2], np.full(levels, np.nan)

    def _pairs(self, observed: Sequence[Observations], levels: int) -> list[tuple[np.ndarray, np.ndarray, float]]:
        """Values 0…1 of the same pixels in neighbouring exposures, and the ratio of the exposures."""
        low, high = (limit * (levels - 1) / 255 for limit in self.trim)
        pairs = []
        for values, log_exposures in observed:
            order = np.argsort(log_exposures, kind="stable")
            for first, second in pairwise(order):
                both = values[:, [first, second]]
                kept = ((both >= low) & (both <= high)).all(1)
                if kept.sum() >= 20:
                    dark, bright = both[kept].T / (levels - 1)
                    pairs.append((dark, bright, float(np.exp(log_exposures[first] - log_exposures[second]))))
        return pairs

    def _fitted(self, pairs: list[tuple[np.ndarray, np.ndarray, float]], degree: int) -> tuple[np.ndarray, float]:
        """Coefficients c₀ … c_N and the mean square misfit, each pair of photographs counting by its exposure."""
        ratios = [ratio for _, _, ratio in pairs]
        coefficients = np.zeros(degree + 1)
        powers = np.arange(degree + 1)
        bases = [(dark[:, None] ** powers, bright[:, None] ** powers) for dark, bright, _ in pairs]
        for each in range(self.rounds + 1):
            if each:
                means = [((d @ coefficients).mean(), (b @ coefficients).mean()) for d, b in bases]
                ratios = [d / b if b > 0 else ratio for (d, b), ratio in zip(means, ratios, strict=True)]
            rows = np.concatenate([d - r * b for (d, b), r in zip(bases, ratios, strict=True)])
            # c_N = 1 − Σ of the others.
            found = np.linalg.lstsq(rows[:, :-1] - rows[:, -1:], -rows[:, -1], rcond=None)[0]
            coefficients = np.append(found, 1 - found.sum())
        misfit = float(np.mean((rows @ coefficients) ** 2)) * len(rows) / max(len(rows) - degree, 1)
        return coefficients, misfit


@dataclass(frozen=True)
class Robertson:
    """Gauss–Seidel iteration of the maximum likelihood curve I and irradiance x (Robertson, Borman & Stevenson 2003).

    By turns xⱼ = Σ w t I(y) / Σ w t² over the photographs (eq. 7) and I(m) = mean of t x over the places where the
    value is m (eq. 10), from a straight line, I(middle) = 1.

    rounds : most turns of the two
    settled : greatest relative change of the curve at which it is done
    """

    rounds: int = 300
    settled: float = 1e-5

    def curve(self, observed: Sequence[Observations], levels: int) -> tuple[np.ndarray, np.ndarray]:
        """The curve g (levels,), rising, 0 at the middle value; its standard error is not known: NaN (levels,).

        observed : the places that were seen at several exposures, a bracket each, of one channel
        levels : how many pixel values there are, 256 or 65536

        16-bit values share the curve of 256 ranges. Values that never occur are interpolated in ln exposure.
        """
        knots = 256
        place = np.arange(knots, dtype=np.float64)
        middle = (knots - 1) / 2
        # The authors' weights, shifted and scaled so that they are 0 at black and white.
        weight = np.exp(-4 * (place - middle) ** 2 / middle**2)
        weight = (weight - weight[0]) / (1 - weight[0])
        binned = [(np.rint(o.values * ((knots - 1) / (levels - 1))).astype(int), o) for o in observed]
        counts = np.zeros(knots)
        for index, each in binned:
            counts += np.bincount(index[each.values > 0], minlength=knots)
        seen = counts > 0
        inverse = np.maximum(place, 0.5) / place[127]
        for _ in range(self.rounds):
            sums = np.zeros(knots)
            for index, each in binned:
                time = np.exp(each.log_exposures)
                share = np.where(each.values > 0, weight[index], 0.0)
                bottom = (share * time**2).sum(1)
                light = (share * time * inverse[index]).sum(1) / np.maximum(bottom, 1e-300)
                exposure = light[:, None] * time
                counted = (each.values > 0) & (bottom > 0)[:, None]
                sums += np.bincount(index[counted], exposure[counted], knots)
            found = np.interp(place, place[seen], np.log(np.maximum(sums[seen] / counts[seen], 1e-12)))
            updated = np.exp(found - found[127])
            change = float(np.max(np.abs(updated / inverse - 1)[20:236]))
            inverse = updated
            if change < self.settled:
                break
        curve = np.maximum.accumulate(self._extended(np.log(inverse), seen)) + 1e-9 * place
        curve = np.interp(np.arange(levels) * ((knots - 1) / (levels - 1)), place, curve)
        return curve - curve[(levels - 1) // 2], np.full(levels, np.nan)

    @staticmethod
    def _extended(curve: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """The curve with its unseen ends going on as a power law does: straight over ln z."""
        first, last = (int(edge) for edge in np.flatnonzero(seen)[[0, -1]])
        logarithm = np.log(np.maximum(np.arange(len(curve)), 0.5))
        extended = curve.copy()
        for edge, inner in ((first, min(first + 12, last)), (last, max(last - 12, first))):
            if edge != inner:
                # Noise may make the last values fall; what goes on from them rises or is level.
                slope = max(0.0, (curve[inner] - curve[edge]) / (logarithm[inner] - logarithm[edge]))
                beyond = np.arange(len(curve)) < first if edge == first else np.arange(len(curve)) > last
                extended[beyond] = curve[edge] + slope * (logarithm[beyond] - logarithm[edge])
        return extended
