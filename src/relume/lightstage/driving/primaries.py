"""The colours that each lamp of a stage can make: one white, or several LEDs that shine together.

Colours are linear Rec. 709 RGB, as the subject's irradiance; an intensity is a factor on a primary's irradiance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls


@dataclass(frozen=True, eq=False)
class LampPrimaries:
    """What every lamp of a stage is made of.

    names : of the primaries, unique, like ("red", "green", "blue", "white")
    irradiance : (P, 3) float64, linear RGB that a primary of intensity 1 gives a surface at the subject that faces the
        lamp, in the unit of the map that will be shown times sr; a primary outside Rec. 709 has negative numbers
    maximum : the highest intensity; infinite where none is known
    """

    names: tuple[str, ...]
    irradiance: np.ndarray
    maximum: float = np.inf

    def __post_init__(self) -> None:
        count = len(self.names)
        if count == 0 or len(set(self.names)) != count or self.irradiance.shape != (count, 3):
            raise ValueError(
                f"primaries {', '.join(self.names) or 'without names'} with irradiance {self.irradiance.shape}; "
                "expected each its own name and (primaries, 3) numbers"
            )
        if not np.all(np.isfinite(self.irradiance)) or np.any(self.irradiance.sum(axis=1) <= 0):
            raise ValueError(
                f"irradiance of the primaries is {self.irradiance.tolist()}; expected that each gives light"
            )
        if not self.maximum > 0:
            raise ValueError(f"the highest intensity is {self.maximum}; expected a number above 0")

    def __len__(self) -> int:
        return len(self.names)

    @staticmethod
    def white(maximum: float = np.inf) -> LampPrimaries:
        """Lamps that can only be dimmed; intensity 1 is irradiance (1, 1, 1)."""
        return LampPrimaries(("white",), np.ones((1, 3)), maximum)

    @staticmethod
    def rgb(maximum: float = np.inf) -> LampPrimaries:
        """Lamps of any colour; intensities are the irradiance's own R, G and B."""
        return LampPrimaries(("red", "green", "blue"), np.eye(3), maximum)

    def nearest(self, colours: ArrayLike) -> np.ndarray:
        """Intensities (…, P), at least 0 and without a maximum, whose colour is nearest to linear RGB (…, 3).

        Nearest in the sum of squares, by non-negative least squares (Lawson & Hanson 1974, chapter 23).
        """
        wanted = np.asarray(colours, np.float64)
        flat = wanted.reshape(-1, 3)
        found = np.array([nnls(self.irradiance.T, colour)[0] for colour in flat]).reshape(len(flat), len(self))
        return found.reshape(*wanted.shape[:-1], len(self))

    def beyond_gamut(self, colours: ArrayLike, weights: ArrayLike) -> float:
        """The share of colours (…, 3) that no mix of the primaries makes, 0 where all can be made.

        The distance to the nearest mix over the length of the colour, both summed with weights (…).
        """
        wanted, weight = np.asarray(colours, np.float64), np.asarray(weights, np.float64)
        total = float((weight * np.linalg.norm(wanted, axis=-1)).sum())
        missed = np.linalg.norm(wanted - self.nearest(wanted) @ self.irradiance, axis=-1)
        return float((weight * missed).sum()) / total if total > 0 else 0.0
