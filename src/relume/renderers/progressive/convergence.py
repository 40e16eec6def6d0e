"""Sums of a render's passes and of their squares, and when they have few enough errors left, by the passes' scatter."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from math import gamma, pi, sqrt

import numpy as np

LEAST = 4
"""Passes before an estimate is believed; from fewer it is off by more than half."""
HELD = 0.99
"""The share of a change that its error is asked of. The rest is spread so thinly, over a whole floor often, that its
pixels would only dilute the error."""
VALUES_AT_ONCE = 2**14
"""Values of a plane that are added at once."""
LIGHT = "light of "
"""Begins the name of a plane that every pass has for all pixels, whichever it traced: what was followed from the light.
It belongs to the plane whose name comes after."""
_SQUARES = "squares of "
_PLANNED = "passes of each pixel in all"


@dataclass(frozen=True, eq=False)
class Sums:
    """Passes added up in their order.

    totals : float64 by name
    squares : float64 by name, of the passes' squares; only of planes whose variance is asked for
    passes : how many were added
    planned : (H, W) int32, how many passes each pixel is to have in all: the first so many; None where each traces all
    """

    totals: Mapping[str, np.ndarray] = field(default_factory=dict)
    squares: Mapping[str, np.ndarray] = field(default_factory=dict)
    passes: int = 0
    planned: np.ndarray | None = None

    @property
    def counts(self) -> np.ndarray | None:
        """(H, W): how many passes traced each pixel; None where each traced all."""
        return None if self.planned is None else np.minimum(self.planned, self.passes)

    def plus(
        self,
        planes: Mapping[str, np.ndarray],
        scattered: Collection[str] | None = None,
        planned: np.ndarray | None = None,
    ) -> Sums:
        """One pass more; new arrays, so that another thread may write the old ones to disk meanwhile.

        planes : by name
        scattered : those whose squares are added too; all unless given
        planned : (H, W), how many passes each pixel is to have in all, as long as that is known; those that have had as
            many are 0 in `planes`, but for those of the light. The first pass has all
        Raises ValueError for other names than before.
        """
        if self.passes and planes.keys() != self.totals.keys():
            raise ValueError(f"a pass of {sorted(planes)} after passes of {sorted(self.totals)}; expected the same")
        varied = [name for name in planes if scattered is None or name.removeprefix(LIGHT) in scattered]
        if not self.passes:
            totals = {name: np.array(plane, np.float64) for name, plane in planes.items()}
            return Sums(totals, {name: np.square(totals[name]) for name in varied}, 1)
        return Sums(
            {name: _with(self.totals[name], plane) for name, plane in planes.items()},
            {name: _with(self.squares[name], planes[name], squared=True) for name in varied},
            self.passes + 1,
            planned,
        )

    def mean(self, name: str) -> np.ndarray:
        """The mean of a plane over the passes, float64."""
        light = LIGHT + name
        return self._mean(name) + self._mean(light) if light in self.totals else self._mean(name)

    def variance(self, name: str) -> np.ndarray:
        """The variance of that mean, float64, from the scatter of the passes; 0 after a single one."""
        light = LIGHT + name
        own = self.own_variance(name)
        return own + self.own_variance(light) if light in self.squares else own

    def _mean(self, name: str) -> np.ndarray:
        return self.totals[name] / self._count(name)

    def own_variance(self, name: str) -> np.ndarray:
        """The variance without that of the light, which is followed whichever pixels are traced."""
        count = self._count(name)
        scatter = np.maximum(self.squares[name] / count - self._mean(name) ** 2, 0)
        return scatter / np.maximum(count - 1, 1)

    def _count(self, name: str) -> np.ndarray | int:
        """How many passes a plane holds, one for each pixel where they differ."""
        if (counts := self.counts) is None or name.startswith(LIGHT):
            return self.passes
        return counts if self.totals[name].ndim == counts.ndim else counts[..., None]

    def planes(self) -> dict[str, np.ndarray]:
        """All of it by name, for a file."""
        planned = {} if self.planned is None else {_PLANNED: self.planned}
        return {**self.totals, **{_SQUARES + name: plane for name, plane in self.squares.items()}, **planned}

    @staticmethod
    def from_planes(planes: Mapping[str, np.ndarray], passes: int) -> Sums:
        """What `planes` gave."""
        squares = {n.removeprefix(_SQUARES): p for n, p in planes.items() if n.startswith(_SQUARES)}
        totals = {n: p for n, p in planes.items() if not n.startswith(_SQUARES) and n != _PLANNED}
        return Sums(totals, squares, passes, planes.get(_PLANNED))


def _with(sum_so_far: np.ndarray, plane: np.ndarray, squared: bool = False) -> np.ndarray:
    """A new sum, float64, with a plane or its square; some rows at a time, so that no plane is held in float64."""
    result = np.empty_like(sum_so_far)
    step = max(1, VALUES_AT_ONCE * len(plane) // max(plane.size, 1))
    for first in range(0, len(plane), step):
        rows = slice(first, first + step)
        wide = plane[rows].astype(np.float64, copy=False)
        np.add(sum_so_far[rows], np.square(wide) if squared else wide, out=result[rows])
    return result


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


def standard_error(sums: Sums) -> float:
    """The mean standard error of the radiance of pixels, as a share of the mean radiance."""
    return float(np.sqrt(sums.variance("radiance")).mean() / max(sums.mean("radiance").mean(), 1e-30))


@dataclass(frozen=True, eq=False)
class ChangeError:
    """The mean absolute error to be expected of a composite, as a share of its radiance, where objects change it.

    backdrop : (H, W, 3), what is seen without the objects: the plate, in the render's unit. The sums hold the planes
        objects (premultiplied), difference (signed, premultiplied by the rest) and matte

    It is asked of the fewest pixels that together hold 99 % of the change, so that neither a larger picture nor a floor
    that hardly changes makes it smaller. 0 where nothing changes at all.
    """

    backdrop: np.ndarray

    def __call__(self, sums: Sums) -> float:
        objects, difference, matte = (sums.mean(name) for name in ("objects", "difference", "matte"))
        change = np.abs(objects).sum(axis=-1) + np.abs(difference).sum(axis=-1)
        held = _fewest(change, HELD)
        if not held.any():
            return 0.0
        variance = sums.variance("objects") + sums.variance("difference")
        # Each pixel by how often it was traced itself: those that hardly change are traced least, and are not asked.
        counts = np.full(held.sum(), sums.passes) if (every := sums.counts) is None else every[held]
        passes, place = np.unique(counts, return_inverse=True)
        shortfall = np.array([_shortfall(int(count)) for count in passes])[place]
        # A normal error is √(2/π) of its standard deviation on average.
        error = sqrt(2 / pi) * (np.sqrt(variance[held]) / shortfall[:, None]).mean()
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
