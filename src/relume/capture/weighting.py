"""How much each photograph's pixel value counts in a merge: frozen values, passed to `merge`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.image.response import Response


class Weighting(Protocol):
    """A weight for every pixel value of every channel."""

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels), not negative; 0 where a value says nothing of the exposure."""
        ...


def hat(levels: int) -> np.ndarray:
    """w(z) of every pixel value: 0 at the ends, rising linearly to the middle (Debevec & Malik 1997, eq. 4)."""
    values = np.arange(levels, dtype=np.float64)
    return np.minimum(values, levels - 1 - values)


@dataclass(frozen=True)
class Hat:
    """The paper's weights (Debevec & Malik 1997, eq. 4): 0 at the ends, rising linearly to the middle."""

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        return np.tile(hat(response.levels), (3, 1))


@dataclass(frozen=True)
class InverseVariance:
    """The weights that leave the least noise: 1 / var(ln exposure), fading to 0 before the ends of the curve.

    guard : values at either end of 256 that never count; in saturated patches JPEG leaves 250 to 254 where 255 was, and
        a value near white is the least noisy of all, so that it would decide. Of 65536 values, which are no JPEG's,
        only the top 0.5 % and what is not five deviations of noise above nothing
    fade : the values over which the weight then rises, so that nothing jumps where a photograph begins to count
    """

    guard: float = 6.0
    fade: float = 16.0

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        deviation = np.gradient(response.log_exposure, axis=1) * response.deviation
        if response.levels == 256:
            counted = np.clip((hat(256) - self.guard) / self.fade, 0.0, 1.0)
        else:
            below_white = 1 - np.arange(response.levels) / (response.levels - 1)
            counted = np.clip((1 / np.maximum(deviation, 1e-6) - 5) / 10, 0, 1) * np.clip(below_white / 0.005 - 1, 0, 1)
        return counted / np.maximum(deviation, 1e-6) ** 2
