"""Sums of a render's passes and of their squares: what its means and their variance are made from."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

_SQUARES = "squares of "


@dataclass(frozen=True, eq=False)
class Sums:
    """Passes added up in their order.

    totals : float64 by name
    squares : float64 by name, of the passes' squares; only of planes whose variance is asked for
    passes : how many were added
    """

    totals: Mapping[str, np.ndarray] = field(default_factory=dict)
    squares: Mapping[str, np.ndarray] = field(default_factory=dict)
    passes: int = 0

    def plus(self, planes: Mapping[str, np.ndarray], scattered: Collection[str] | None = None) -> Sums:
        """One pass more; new arrays, so that another thread may write the old ones to disk meanwhile.

        planes : by name
        scattered : those whose squares are added too; all unless given
        Raises ValueError for other names than before.
        """
        if self.passes and planes.keys() != self.totals.keys():
            raise ValueError(f"a pass of {sorted(planes)} after passes of {sorted(self.totals)}; expected the same")
        wide = {name: np.asarray(plane, np.float64) for name, plane in planes.items()}
        varied = [name for name in wide if scattered is None or name in scattered]
        if not self.passes:
            return Sums({n: p.copy() for n, p in wide.items()}, {n: wide[n] ** 2 for n in varied}, 1)
        return Sums(
            {name: self.totals[name] + plane for name, plane in wide.items()},
            {name: self.squares[name] + wide[name] ** 2 for name in varied},
            self.passes + 1,
        )

    def mean(self, name: str) -> np.ndarray:
        """The mean of a plane over the passes, float64."""
        return self.totals[name] / self.passes

    def variance(self, name: str) -> np.ndarray:
        """The variance of that mean, float64, from the scatter of the passes; 0 after a single one."""
        scatter = np.maximum(self.squares[name] / self.passes - self.mean(name) ** 2, 0)
        return scatter / max(self.passes - 1, 1)

    def planes(self) -> dict[str, np.ndarray]:
        """All of it by name, for a file."""
        return {**self.totals, **{_SQUARES + name: plane for name, plane in self.squares.items()}}

    @staticmethod
    def from_planes(planes: Mapping[str, np.ndarray], passes: int) -> Sums:
        """What `planes` gave."""
        squares = {n.removeprefix(_SQUARES): p for n, p in planes.items() if n.startswith(_SQUARES)}
        return Sums({n: p for n, p in planes.items() if not n.startswith(_SQUARES)}, squares, passes)
