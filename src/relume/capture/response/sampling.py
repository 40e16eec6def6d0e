"""Which pixels of a bracket speak for the response: spread over values and the image, where the picture is smooth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume.capture.exposure.bracket import Bracket

TILES = 24
"""Tiles across the longer side; each gives at most one pixel for every frame and range of values."""
RANGES = 32
"""Ranges of pixel values, so that every part of the curve is met."""
EVEN = 3.0
"""Greatest standard deviation of a 3×3 neighbourhood, in 256ths of the range, for its middle to be believed."""
NEAR_WHITE = 9
"""Side of the neighbourhood that must hold no saturated pixel: JPEG rings over its 8×8 blocks."""
LOOKED_AT = 40_000
"""About how many pixels of a photograph are looked at: every one of a small picture, an even grid of a large one."""
STILL = 12_000
"""About how many pixels of a photograph noise is measured by."""
MOST = 6_000
"""Most pixels that are used; twice as many move a curve by less than its error."""


class Observations(NamedTuple):
    """What the same places of one bracket show in each photograph, in one channel.

    values : (N, P) int, pixel values; 0, which has no weight, where a value cannot be believed
    log_exposures : (P,) ln of the photographs' exposures
    """

    values: np.ndarray
    log_exposures: np.ndarray


class _Grid:
    """Every `step`-th row and column, with the eight neighbours of the pixels there; mirrored at the border."""

    def __init__(self, width: int, height: int, wanted: int) -> None:
        step = max(1, int(np.sqrt(width * height / wanted)))
        # An odd step meets all places of JPEG's 8×8 blocks alike.
        self.step = step if step % 2 else step - 1
        self.width, self.height = width, height
        self.rows = np.arange(self.step // 2, height, self.step)
        self.columns = np.arange(self.step // 2, width, self.step)

    def __len__(self) -> int:
        return len(self.rows) * len(self.columns)

    def shifted(self, image: np.ndarray, down: int, right: int) -> np.ndarray:
        """The pixels of `image` (H, W) that lie so far from the grid's, flat."""
        rows = _mirrored(self.rows + down, self.height)
        columns = _mirrored(self.columns + right, self.width)
        return image[rows][:, columns].ravel() if self.step > 1 else image[np.ix_(rows, columns)].ravel()

    def unevenness(self, image: np.ndarray) -> np.ndarray:
        """Nine times the variance of every pixel's 3×3 neighbourhood, times nine."""
        total, squares = np.zeros(len(self), np.float32), np.zeros(len(self), np.float32)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                value = self.shifted(image, down, right).astype(np.float32)
                total += value
                squares += value * value
        return 9 * squares - total * total

    def flat(self) -> np.ndarray:
        """Flat indices of the grid's pixels in the whole image."""
        return (self.rows[:, None] * self.width + self.columns).ravel()


def observations(bracket: Bracket, channel: int) -> Observations:
    """The pixels of `channel` that enter the response's recovery, as every photograph shows them.

    A value that cannot be believed, at an edge, beside a saturated pixel or outside the picture, is given as 0.
    """
    chosen = _choose_pixels(bracket, channel)
    if len(chosen) > MOST:
        chosen = chosen[np.linspace(0, len(chosen) - 1, MOST).astype(int)]
    believed = [_believed(bracket, index, channel, chosen) for index in range(len(bracket.photographs))]
    values = np.stack(believed, axis=1)
    # A pixel that only one photograph saw well says nothing of the curve's shape.
    useful = (values > 0).sum(1) >= 2
    return Observations(values[useful], np.log(bracket.exposures))


def _choose_pixels(bracket: Bracket, channel: int) -> np.ndarray:
    """Flat indices of the pixels of `channel` that are worth looking at (Debevec & Malik 1997, §2.1).

    In each tile of the image, for each photograph and each of 32 ranges of values that occurs there, the pixel
    whose 3×3 neighbourhood varies least is taken: values evenly covered, pixels spread, edges avoided.
    """
    width, height = bracket.photographs[0].size
    levels = levels_of(bracket)
    grid = _Grid(width, height, LOOKED_AT)
    tile = max(1, -(-max(width, height) // TILES))
    tiles = ((grid.rows // tile)[:, None] * TILES + grid.columns // tile).ravel()
    chosen = np.zeros(len(grid), bool)
    for photograph in bracket.photographs:
        image = photograph.pixels[..., channel]
        values = grid.shifted(image, 0, 0)
        usable = (values > 0) & (values < levels - 1)
        if photograph.outside is not None:
            usable &= ~grid.shifted(photograph.outside, 0, 0)
        places = np.flatnonzero(usable)
        groups = tiles[places] * RANGES + values[places].astype(int) * RANGES // levels
        # The least of each group in order of unevenness; of equals the first.
        key = np.minimum(grid.unevenness(image)[places], 2.0**30).astype(np.int64) << 32 | places
        least = np.full(TILES * TILES * RANGES, np.iinfo(np.int64).max)
        np.minimum.at(least, groups, key)
        chosen[(least & 0xFFFFFFFF)[least != np.iinfo(np.int64).max]] = True
    return grid.flat()[chosen]


def _believed(bracket: Bracket, index: int, channel: int, chosen: np.ndarray) -> np.ndarray:
    """The values of one photograph at `chosen`, 0 where they are not believed."""
    photograph, levels = bracket.photographs[index], levels_of(bracket)
    (width, height), image = photograph.size, photograph.pixels[..., channel]
    rows, columns = np.divmod(chosen, width)
    values = image[rows, columns].astype(int)
    good = (values > 0) & (values < levels - 1)
    if photograph.outside is not None:
        good &= ~photograph.outside[rows, columns]
    total, squares = np.zeros(len(chosen)), np.zeros(len(chosen))
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            value = image[_mirrored(rows + down, height), _mirrored(columns + right, width)].astype(np.float64)
            total += value
            squares += value * value
    good &= 9 * squares - total * total <= 81 * (EVEN * levels / 256) ** 2
    good &= ~_near_white(image, rows, columns, good, levels)
    return np.where(good, values, 0)


def _near_white(image: np.ndarray, rows: np.ndarray, columns: np.ndarray, asked: np.ndarray, levels: int) -> np.ndarray:
    """Whether a saturated pixel is near each of the places for which it is asked."""
    from scipy.ndimage import maximum_filter

    height, width = image.shape
    near = np.zeros(len(rows), bool)
    white = levels - levels / 512
    if height * width <= 4 * LOOKED_AT:
        return maximum_filter(image, NEAR_WHITE)[rows, columns] > white - 1
    # A dark pixel far from white everywhere is recognised by a few of its neighbours: most photographs hold no white
    # there.
    reach = NEAR_WHITE // 2
    places = np.flatnonzero(asked)
    r, c = rows[places], columns[places]
    found = np.zeros(len(places), bool)
    for down in range(-reach, reach + 1):
        line = np.clip(r + down, 0, height - 1)
        for right in range(-reach, reach + 1):
            found |= image[line, np.clip(c + right, 0, width - 1)] > white - 1
    near[places] = found
    return near


def still_values(bracket: Bracket, channel: int) -> Observations:
    """Pixel values of an even grid of places, chosen without regard to their own noise, to measure noise by.

    A place counts in a photograph where its eight neighbours vary no more than those of half the places of like value:
    they mark an edge, and say nothing of the noise of the pixel between them.
    """
    width, height = bracket.photographs[0].size
    levels = levels_of(bracket)
    grid = _Grid(width, height, STILL)
    kept = []
    for photograph in bracket.photographs:
        image = photograph.pixels[..., channel]
        values = grid.shifted(image, 0, 0).astype(np.int64)
        total, squares, greatest = np.zeros(len(grid)), np.zeros(len(grid)), np.zeros(len(grid))
        for down, right in ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)):
            value = grid.shifted(image, down, right).astype(np.float64)
            total += value
            squares += value * value
            np.maximum(greatest, value, out=greatest)
        good = (values > 0) & (values < levels - 1) & (greatest < levels - 1)
        if photograph.outside is not None:
            good &= ~grid.shifted(photograph.outside, 0, 0)
        uneven = squares - total * total / 8
        # Like value is judged by the neighbours, again so that the pixel's own noise decides nothing.
        ranges = np.minimum((total / 8 * 16 / levels).astype(int), 15)
        for each in range(16):
            here = good & (ranges == each)
            if here.any():
                good &= ~here | (uneven <= np.median(uneven[here]))
        kept.append(np.where(good, values, 0))
    values = np.stack(kept, axis=1)
    return Observations(values[(values > 0).sum(1) >= 2], np.log(bracket.exposures))


def levels_of(bracket: Bracket) -> int:
    """The number of pixel values of the bracket's photographs, 256 or 65536."""
    return int(np.iinfo(bracket.photographs[0].pixels.dtype).max) + 1


def _mirrored(index: np.ndarray, count: int) -> np.ndarray:
    """Indices one beyond either end folded back on the border pixel."""
    return np.clip(index, 0, count - 1)
