"""Where the maps of several probes show different light at one place of the walls."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from relume.image.colour import luminance

ROWS = 24
"""Of the lat-long grid of cells that are compared: 7.5°, larger than what maps are registered to."""
SURELY = 3.0
"""Standard deviations from which on two means differ by more than chance."""
ALIKE = 0.05
"""Share by which two good maps of one place differ: exposures and the ball's reflectance are known no better."""
PIXELS = 2.0
"""Pixels of a map by which an edge in it may be off: half of one by registration of each, and the look-up's blur."""
WORTH = 0.001
"""Of all light, from which on a cell's difference counts."""
NEAR = np.radians(25.0)
"""Angle within which cells are named as one place."""


@dataclass(frozen=True)
class Disagreement:
    """A place where two maps differ by more than their errors.

    probes : their numbers, from 0
    direction : unit vector from where the light is wanted
    place : on the walls there, metres; None of a distant scene at infinity
    ratio : radiance by the brighter map over that by the darker
    share : of the light that is wanted, by which they differ there
    """

    probes: tuple[int, int]
    direction: tuple[float, float, float]
    place: tuple[float, float, float] | None
    ratio: float
    share: float

    @property
    def times(self) -> str:
        """The ratio in words."""
        return f"{self.ratio:.1f} times" if self.ratio < 100 else "more than 100 times"

    def line(self, names: Sequence[str]) -> str:
        """It in a sentence, by the names of all probes."""
        first, second = (names[number] for number in self.probes)
        where = self.direction if self.place is None else self.place
        spot = ("towards" if self.place is None else "about the wall at") + f" {[round(v, 2) for v in where]}"
        return (
            f"{first} and {second} differ {self.times} {spot}, by {self.share:.1%} of the light: "
            "something hangs or stands there before the distant scene, one of them was hidden from it, or a place or "
            "a turn of a map is wrong"
        )


@dataclass(eq=False)
class CellSums:
    """What each map shows in cells of directions, added up piece by piece.

    count : maps
    pixel : radians of the coarsest map's pixel
    """

    count: int
    pixel: float
    areas: np.ndarray = field(init=False)
    sums: np.ndarray = field(init=False)
    variances: np.ndarray = field(init=False)
    low: np.ndarray = field(init=False)
    high: np.ndarray = field(init=False)
    places: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        cells = ROWS * 2 * ROWS
        self.areas, self.sums, self.variances = (np.zeros((self.count, cells)) for _ in range(3))
        self.low, self.high = np.full((self.count, cells), np.inf), np.full((self.count, cells), -np.inf)
        self.places = np.zeros((cells, 4))

    def add(
        self, index: int, cells: np.ndarray, areas: np.ndarray, radiance: np.ndarray, variance: np.ndarray | None,
        seen: np.ndarray,
    ) -> None:  # fmt: skip
        """What map number `index` shows of N directions: radiance (N, 3), where it was measured `seen` (N,)."""
        value, area = luminance(radiance), areas * seen
        size = self.areas.shape[1]
        self.areas[index] += np.bincount(cells, area, size)
        self.sums[index] += np.bincount(cells, area * value, size)
        if variance is not None:
            self.variances[index] += np.bincount(cells, area**2 * variance.mean(-1), size)
        np.minimum.at(self.low[index], cells[seen], value[seen])
        np.maximum.at(self.high[index], cells[seen], value[seen])

    def add_places(self, cells: np.ndarray, areas: np.ndarray, directions: np.ndarray) -> None:
        """Whither the cells lie."""
        for axis in range(3):
            self.places[:, axis] += np.bincount(cells, areas * directions[:, axis], len(self.places))
        self.places[:, 3] += np.bincount(cells, areas, len(self.places))

    def means(self) -> np.ndarray:
        """(maps, cells), NaN where less than half of a cell was seen."""
        known = self.areas > 0.5 * self.places[:, 3]
        return np.where(known, self.sums / np.maximum(self.areas, 1e-30), np.nan)

    def differing(self, total: float) -> list[Disagreement]:
        """Where two maps differ by more than their errors, the greatest first, neighbouring cells as one; no places.

        total : luminance of all light, ∫ L dω
        """
        found, means = [], self.means()
        variances = self.variances / np.maximum(self.areas, 1e-30) ** 2
        # An edge that is off by a pixel or two carries that share of the contrast about a cell into it.
        contrast = _about(self.high, np.max) - _about(self.low, np.min)
        moved = min(PIXELS * self.pixel / (np.pi / ROWS), 1.0) * np.where(np.isfinite(contrast), contrast, 0.0)
        for i, j in combinations(range(self.count), 2):
            off = np.abs(means[i] - means[j])
            chance = np.sqrt(variances[i] + variances[j] + (ALIKE * (means[i] + means[j]) / 2) ** 2)
            share = off * self.places[:, 3] / max(total, 1e-30)
            with np.errstate(invalid="ignore"):
                beyond = (off > SURELY * chance + np.maximum(moved[i], moved[j])) & (share > WORTH)
            for cell in np.flatnonzero(beyond):
                way = self.places[cell, :3] / np.linalg.norm(self.places[cell, :3])
                ratio = max(means[i, cell], means[j, cell]) / max(min(means[i, cell], means[j, cell]), 1e-30)
                x, y, z = (float(v) for v in way)
                found.append(Disagreement((i, j), (x, y, z), None, float(ratio), float(share[cell])))
        return _together(sorted(found, key=lambda each: -each.share))

    def gains(self) -> np.ndarray:
        """(maps,) how many times as bright as the first each map is, by the median of the cells both show."""
        means = self.means()
        with np.errstate(invalid="ignore", divide="ignore"):
            ratios = np.where((means > 0) & (means[0] > 0), means / means[0], np.nan)
        return np.array([np.nanmedian(each) if np.any(np.isfinite(each)) else 1.0 for each in ratios])


def _together(cells: list[Disagreement]) -> list[Disagreement]:
    """Cells near a greater one as one with it, about their middle."""
    groups: list[list[Disagreement]] = []
    for cell in cells:
        near = [
            group for group in groups
            if group[0].probes == cell.probes and np.dot(group[0].direction, cell.direction) > np.cos(NEAR)
        ]  # fmt: skip
        if near:
            near[0].append(cell)
        else:
            groups.append([cell])
    found = []
    for group in groups:
        way = np.sum([each.share * np.array(each.direction) for each in group], axis=0)
        x, y, z = (float(v) for v in way / np.linalg.norm(way))
        share = sum(each.share for each in group)
        ratio = sum(each.share * each.ratio for each in group) / share
        found.append(Disagreement(group[0].probes, (x, y, z), None, ratio, share))
    return sorted(found, key=lambda each: -each.share)


def _about(values: np.ndarray, extreme: Callable[..., np.ndarray]) -> np.ndarray:
    """The greatest or least of a cell and its eight neighbours, (maps, cells)."""
    grid = values.reshape(len(values), ROWS, 2 * ROWS)
    tall = np.pad(np.pad(grid, ((0, 0), (1, 1), (0, 0)), mode="edge"), ((0, 0), (0, 0), (1, 1)), mode="wrap")
    pieces = [tall[:, y : y + ROWS, x : x + 2 * ROWS] for y in range(3) for x in range(3)]
    stacked = np.stack(pieces)
    return extreme(stacked, axis=0).reshape(values.shape)
