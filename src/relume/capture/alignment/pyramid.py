"""A frame reduced for alignment: the same picture at halving sizes, with what is clipped marked, and its features."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.capture.alignment.kernel import _features
from relume.capture.alignment.reducing_kernel import _halve, _reduce
from relume.image.bands import in_threads
from relume.image.photograph import Photograph

LONGEST = 1400
"""Pixels of the longer side of the finest level: a twelfth of a pixel there is a quarter of one in 12 megapixels."""
SHORTEST = 200
"""Halving stops when the longer side is not longer than this: street signs still differ from windows."""
LOW, HIGH = 2 / 255, 250 / 255
"""Shares of white below and above which a value counts as clipped; JPEG noise and ringing are within."""
MOST_FEATURES = 30_000
"""Cells in a level; more move the estimate by less than a hundredth of a pixel."""
FAINTEST = 1.5
"""Least gradient of a feature, values of 255 per pixel; below it is noise."""


@dataclass(frozen=True, eq=False)
class Features:
    """The steepest pixels of a level, one in every cell: the edges that survive a change of exposure.

    positions : (N, 2), from the photograph's centre, in its pixels
    values : (N,)
    gradients : (N, 2) per pixel of the level, across and down
    """

    positions: np.ndarray
    values: np.ndarray
    gradients: np.ndarray


@dataclass(frozen=True, eq=False)
class Level:
    """One size of a frame.

    values : (H, W) float32, encoded green, 0 to 255
    valid : (H, W) uint8, 1 where nothing is clipped or outside
    inside : (H, W) uint8, 1 where the frame shows anything, clipped or not
    scale : pixels of the photograph per pixel
    size : the photograph's (width, height)
    """

    values: np.ndarray
    valid: np.ndarray
    inside: np.ndarray
    scale: int
    size: tuple[int, int]

    @cached_property
    def features(self) -> Features:
        """The steepest pixel of every cell, where it and its neighbours are valid; found when first asked for."""
        rows, columns = self.values.shape
        cell = max(2, int(np.ceil(np.sqrt(rows * columns / MOST_FEATURES))))
        most = -(-rows // cell) * -(-columns // cell)
        places, found = np.empty((most, 2), np.int32), np.empty((most, 3), np.float32)
        count = _features(self.values, self.valid, cell, FAINTEST, places, found)
        positions = self.centred(places[:count, 0], places[:count, 1])
        return Features(positions, found[:count, 0].astype(float), found[:count, 1:].astype(float))

    @cached_property
    def ranks(self) -> tuple[np.ndarray, float, float]:
        """The rank 0…1 of every pixel among those inside, and the ranks where black ends and white begins; found when
        first asked for."""
        ordered = np.sort(self.values[self.inside == 1])
        ranks = np.searchsorted(ordered, self.values) / max(len(ordered), 1)
        low, high = np.searchsorted(ordered, [LOW * 255, HIGH * 255]) / max(len(ordered), 1)
        return ranks.astype(np.float32), float(low), float(high)

    def centred(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """(N, 2) positions from the photograph's centre, in its pixels, of pixels here."""
        x = (columns + 0.5) * self.scale - self.size[0] / 2
        return np.stack([x, (rows + 0.5) * self.scale - self.size[1] / 2], axis=-1)

    def indices(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows here, with fractions, of positions (N, 2) from the photograph's centre."""
        x = (positions[..., 0] + self.size[0] / 2) / self.scale - 0.5
        return x, (positions[..., 1] + self.size[1] / 2) / self.scale - 0.5


def pyramid(photograph: Photograph) -> tuple[Level, ...]:
    """Levels of a photograph from the finest to the coarsest."""
    from scipy.ndimage import correlate1d

    pixels = np.ascontiguousarray(photograph.pixels).reshape(-1)
    (width, height), most = photograph.size, int(np.iinfo(pixels.dtype).max)
    factor = max(1, -(-max(width, height) // LONGEST))
    shape = (height // factor, width // factor)
    values, valid = np.empty(shape, np.float32), np.empty(shape, np.uint8)
    sums = np.empty(0, np.uint16 if factor * most <= np.iinfo(np.uint16).max else np.uint32)
    scale = LOW * most, HIGH * most, 255 / most

    def work(begin: int, end: int) -> None:
        _reduce(pixels, width, factor, *scale, begin, end, sums, values, valid)

    in_threads(work, shape[0], chunk=64)
    inside = np.ones(shape, np.uint8)
    if photograph.outside is not None:
        cropped = photograph.outside[: shape[0] * factor, : shape[1] * factor]
        inside -= cropped.reshape(shape[0], factor, shape[1], factor).any((1, 3)).astype(np.uint8)
        valid *= inside
    if factor == 1:
        # Binomial 3×3: unreduced pixels are noisy, and interpolated noise is least half-way between pixels.
        values = correlate1d(correlate1d(values, [0.25, 0.5, 0.25], 0), [0.25, 0.5, 0.25], 1)
    levels = [Level(values, valid, inside, factor, photograph.size)]
    while max(levels[-1].values.shape) > SHORTEST and min(levels[-1].values.shape) >= 32:
        levels.append(_halved(levels[-1]))
    return tuple(levels)


def _halved(level: Level) -> Level:
    """Means of 2×2 pixels; valid where three of the four are."""
    shape = (level.values.shape[0] // 2, level.values.shape[1] // 2)
    values, valid, inside = np.empty(shape, np.float32), np.empty(shape, np.uint8), np.empty(shape, np.uint8)
    _halve(level.values, level.valid, level.inside, values, valid, inside)
    return Level(values, valid, inside, 2 * level.scale, level.size)
