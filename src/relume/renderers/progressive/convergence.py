"""When a render has few enough errors left: its noise estimated from the scatter of its own passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import gamma, pi, sqrt

import numpy as np

from relume.renderers.progressive.accumulators import Sums

LEAST = 4
"""Passes before an estimate is believed; from fewer it is off by more than half."""
HELD = 0.99
"""The share of a change that its error is asked of. The rest is spread so thinly, over a whole floor often, that its
pixels would only dilute the error."""


@dataclass(frozen=True)
class Target:
    """A render is done once `error` of it is below `noise`.

    noise : the relative error asked for, above 0
    error : estimates it from the sums
    confirmations : how many estimates in a row have to be below it. Stopping at the first that is prefers estimates
        that are too small, by chance or because a rare bright path was not met yet; 2 unless given
    """

    noise: float
    error: Callable[[Sums], float]
    confirmations: int = 2

    def __post_init__(self) -> None:
        if not self.noise > 0 or self.confirmations < 1:
            raise ValueError(f"noise {self.noise}, confirmations {self.confirmations}; expected above 0, and 1 or more")

    def due(self, passes: int) -> bool:
        """Whether to estimate after so many passes: each from the fourth, later every sixteenth part more."""
        return passes >= LEAST and passes % max(passes // 16, 1) == 0

    def reached(self, sums: Sums) -> bool:
        """Whether the estimate is below what is asked for."""
        return self.error(sums) < self.noise


@dataclass(frozen=True)
class StandardError:
    """The mean over a plane of the standard error of its pixels, as a share of the plane's mean.

    plane : its name in the sums
    """

    plane: str = "radiance"

    def __call__(self, sums: Sums) -> float:
        error = np.sqrt(sums.variance(self.plane)).mean()
        return float(error / max(sums.mean(self.plane).mean(), 1e-30))


@dataclass(frozen=True, eq=False)
class ChangeError:
    """The mean absolute error to be expected of a composite, as a share of its radiance, where objects change it.

    backdrop : (H, W, 3), what is seen without the objects: the plate, in the render's unit
    names : the planes of objects (premultiplied), signed difference (premultiplied by the rest) and matte in the sums

    It is asked of the fewest pixels that together hold 99 % of the change, so that neither a larger picture nor a floor
    that hardly changes makes it smaller. 0 where nothing changes at all.
    """

    backdrop: np.ndarray
    names: tuple[str, str, str] = ("objects", "difference", "matte")

    def __call__(self, sums: Sums) -> float:
        objects, difference, matte = (sums.mean(name) for name in self.names)
        change = np.abs(objects).sum(axis=-1) + np.abs(difference).sum(axis=-1)
        held = _fewest(change, HELD)
        if not held.any():
            return 0.0
        variance = sums.variance(self.names[0]) + sums.variance(self.names[1])
        # A normal error is √(2/π) of its standard deviation on average.
        error = sqrt(2 / pi) * np.sqrt(variance[held]).mean() / _shortfall(sums.passes)
        radiance = objects + difference + (1 - matte[..., None]) * self.backdrop
        return float(error / max(radiance[held].mean(), 1e-30))


def _shortfall(count: int) -> float:
    """How much too small a standard deviation estimated from `count` normal values is on average (c₄)."""
    if count > 100:
        return 1 - 1 / (4 * count)  # what the quotient of gammas tends to
    return sqrt(2 / (count - 1)) * gamma(count / 2) / gamma((count - 1) / 2)


def _fewest(change: np.ndarray, share: float) -> np.ndarray:
    """The pixels that together hold this share of it, largest first."""
    if not change.any():
        return np.zeros(change.shape, bool)
    ordered = np.sort(change, axis=None)[::-1]
    enough = int(np.searchsorted(np.cumsum(ordered), share * ordered.sum()))
    return change >= ordered[min(enough, ordered.size - 1)]
