"""K-means on the sphere: regions of any form whose light is least spread about the middle of each (Lloyd 1982)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import kernel
from relume.light.constellations.cells import Cells
from relume.light.constellations.rectangles import MedianCut

MOST_ROWS = 256
"""Cells from pole to pole that centres are found for, at most; finer ones change the irradiance by nothing."""
GROUP = 8
"""Cells each side of a group; those whose nearest centre is the same for all are not asked one by one."""


class Regions(Protocol):
    """A way to divide the light among lights."""

    def regions(self, cells: Cells, count: int) -> np.ndarray:
        """The number of each cell's region, (R, C) int32, −1 where there is no light."""
        ...


@dataclass(frozen=True)
class KMeans:
    """Each cell goes to the nearest centre, each centre to the mean direction of its light, until little changes.

    start : the regions it begins with; variance minimisation is near the goal already, and nothing is left to chance
    iterations : at most; 50 are seldom needed
    gain : the share of Σ Y |ω − centre|² that an iteration has to save, to be followed by another; after smaller
        savings irradiance is no better
    """

    iterations: int = 50
    start: Regions = field(default_factory=MedianCut)
    gain: float = 3e-3

    def __post_init__(self) -> None:
        if self.iterations < 1:
            raise ValueError(f"k-means of {self.iterations} iterations; expected 1 or more, like 50")

    def regions(self, cells: Cells, count: int) -> np.ndarray:
        """The number of each cell's region, (R, C) int32; those of black cells are of no matter.

        cells : the light of the map in each cell of a grid
        count : of regions
        """
        labels = self.start.regions(cells, count)
        number = int(labels.max()) + 1
        if number == 0:
            return labels
        chosen, flat = np.flatnonzero(labels >= 0), labels.ravel()
        fine = (cells.luminance, *np.moveaxis(cells.moment, -1, 0))
        sums = np.stack([np.bincount(flat[chosen], part.ravel()[chosen], number) for part in fine], axis=-1)
        lit, directions, step = _coarse(cells)
        labels = np.empty(lit.shape[:2], np.int32)
        centres = _centres(sums, np.tile([0.0, 0.0, -1.0], (number, 1)))
        middles, reaches = _groups(directions)
        spread = np.inf
        for _ in range(self.iterations):
            sums = _assigned(lit, directions, middles, reaches, centres, labels)
            empty = np.flatnonzero(sums[:, 0] <= 0)
            if len(empty):
                # A centre that has lost its light goes where light is farthest from its own, but not to a cell that
                # is all of another's light: that one would lose it in turn.
                far = lit[..., 0] * (1 - np.sum(directions * centres[labels], axis=-1))
                far[lit[..., 0] > 0.9 * sums[labels, 0]] = 0
                centres, farthest = _centres(sums, centres), np.argsort(-far, axis=None, kind="stable")[: len(empty)]
                centres[empty] = directions.reshape(-1, 3)[farthest]
                continue
            before, spread = spread, 2 * float(np.sum(sums[:, 0] - np.sum(sums[:, 1:] * centres, axis=-1)))
            if not spread < (1 - self.gain) * before:
                break
            centres = _centres(sums, centres)
        rows, columns = cells.areas.shape
        return np.repeat(np.repeat(labels, step, axis=0)[:rows], step, axis=1)[:, :columns]


def follow(cells: Cells, centres: np.ndarray, iterations: int = 2) -> np.ndarray:
    """The number of the nearest centre to each cell, (R, C) int32, the centres moved to the light that is theirs.

    centres : (N, 3), unit, those of a moment before; none jumps: one that has lost its light waits where it was
    iterations : so that centres come to where light has gone; they are near it already
    """
    lit, directions, step = _coarse(cells)
    labels = np.empty(lit.shape[:2], np.int32)
    middles, reaches = _groups(directions)
    for _ in range(iterations):
        centres = _centres(_assigned(lit, directions, middles, reaches, centres, labels), centres)
    _assigned(lit, directions, middles, reaches, centres, labels)
    rows, columns = cells.areas.shape
    return np.repeat(np.repeat(labels, step, axis=0)[:rows], step, axis=1)[:, :columns]


def _coarse(cells: Cells) -> tuple[np.ndarray, np.ndarray, int]:
    """∫ Y dω and ∫ Y ω dω (R, C, 4) in cells of 0.7° or more, their middles, and how many cells each side they hold."""
    rows, columns = cells.areas.shape
    step = -(-rows // MOST_ROWS)
    lit = np.concatenate([cells.luminance[..., None], cells.moment], axis=-1)
    if step > 1:
        lit = np.add.reduceat(
            np.add.reduceat(lit, np.arange(0, rows, step), axis=0), np.arange(0, columns, step), axis=1
        )
    coarse = replace(cells, polar=_every(cells.polar, step), longitude=_every(cells.longitude, step))
    return lit, coarse.directions(), step


def _every(edges: np.ndarray, step: int) -> np.ndarray:
    return np.append(edges[:-1:step], edges[-1])


def _centres(sums: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Mean directions from ∫ Y dω and ∫ Y ω dω (N, 4); as before where there is none."""
    lengths = np.linalg.norm(sums[:, 1:], axis=-1, keepdims=True)
    return np.where(lengths > 1e-12 * sums[:, :1], sums[:, 1:] / np.maximum(lengths, 1e-300), before)


def _groups(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A direction in the midst of each group of cells, and the longest chord from it to one of them."""
    rows, columns = directions.shape[:2]
    i, j = np.arange(0, rows, GROUP), np.arange(0, columns, GROUP)
    middles = np.ascontiguousarray(
        directions[np.minimum(i + GROUP // 2, rows - 1)][:, np.minimum(j + GROUP // 2, columns - 1)]
    )
    own = np.repeat(np.repeat(middles, GROUP, axis=0)[:rows], GROUP, axis=1)[:, :columns]
    chords = np.sum((directions - own) ** 2, axis=-1)
    return middles, np.sqrt(np.maximum.reduceat(np.maximum.reduceat(chords, i, axis=0), j, axis=1))


def _assigned(
    lit: np.ndarray, directions: np.ndarray, middles: np.ndarray, reaches: np.ndarray, centres: np.ndarray,
    labels: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Write the number of the nearest centre to every cell's label; the sums over each centre's cells, (N, 4)."""
    parts = in_threads(
        lambda begin, end: _assign(lit, directions, middles, reaches, centres, labels, GROUP, begin, end),
        len(middles),
        chunk=4,
    )
    return np.sum(parts, axis=0)


@kernel
def _assign(lit, directions, middles, reaches, centres, labels, group, begin, end):
    rows, columns, count = lit.shape[0], lit.shape[1], centres.shape[0]
    sums, chords, near = np.zeros((count, 4)), np.empty(count), np.empty(count, np.int64)
    for i in range(begin, end):
        for j in range(middles.shape[1]):
            x, y, z = middles[i, j, 0], middles[i, j, 1], middles[i, j, 2]
            least = 3.0
            for k in range(count):
                cosine = x * centres[k, 0] + y * centres[k, 1] + z * centres[k, 2]
                chords[k] = np.sqrt(max(2 - 2 * cosine, 0.0))
                least = min(least, chords[k])
            # No centre farther than this can be the nearest of any cell of the group (triangle inequality).
            bound, candidates = least + 2 * reaches[i, j] + 1e-7, 0
            for k in range(count):
                if chords[k] <= bound:
                    near[candidates] = k
                    candidates += 1
            for row in range(i * group, min((i + 1) * group, rows)):
                for column in range(j * group, min((j + 1) * group, columns)):
                    best, label = -2.0, near[0]
                    if candidates > 1:
                        x, y, z = directions[row, column, 0], directions[row, column, 1], directions[row, column, 2]
                        for candidate in range(candidates):
                            k = near[candidate]
                            cosine = x * centres[k, 0] + y * centres[k, 1] + z * centres[k, 2]
                            if cosine > best:
                                best, label = cosine, k
                    labels[row, column] = label
                    for part in range(4):
                        sums[label, part] += lit[row, column, part]
    return sums
