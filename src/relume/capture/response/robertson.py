"""The response as the mean exposure of every pixel value, found by turns with the light (Robertson et al. 2003)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.response.sampling import Observations


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
        """g (levels,), rising, 0 at the middle value; its standard error is not known: NaN (levels,).

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
