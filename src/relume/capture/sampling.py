"""Which pixels of a bracket speak for the response: spread over values and the image, where the picture is smooth."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter, uniform_filter

from relume.capture.bracket import Bracket

LEVELS = 256
TILES = 24
"""Tiles across the longer side; each gives at most one pixel for every frame and range of values."""
RANGES = 32
"""Ranges of pixel values, so that every part of the curve is met."""
EVEN = 3.0
"""Greatest standard deviation of a 3×3 neighbourhood, in pixel values, for its middle to be believed."""
NEAR_WHITE = 9
"""Side of the neighbourhood that must hold no saturated pixel: JPEG rings over its 8×8 blocks."""


def _choose_pixels(bracket: Bracket, channel: int) -> np.ndarray:
    """Flat indices of the pixels of `channel` that enter the response's recovery (Debevec & Malik 1997, §2.1).

    In each tile of the image, for each photograph and each of 32 ranges of values that occurs there, the pixel
    whose 3×3 neighbourhood varies least is taken: values evenly covered, pixels spread, edges avoided.
    """
    width, height = bracket.photographs[0].size
    tile = max(1, -(-max(width, height) // TILES))
    rows, columns = np.divmod(np.arange(height * width), width)
    tiles = (rows // tile) * TILES + columns // tile
    chosen = []
    for photograph in bracket.photographs:
        values = photograph.pixels[..., channel].astype(np.float32)
        unevenness = _unevenness(values).ravel()
        values = values.ravel()
        usable = np.flatnonzero((values > 0) & (values < LEVELS - 1))
        groups = tiles[usable] * RANGES + (values[usable] * RANGES / LEVELS).astype(int)
        # The first of each group in order of unevenness.
        order = np.lexsort((unevenness[usable], groups))
        _, first = np.unique(groups[order], return_index=True)
        chosen.append(usable[order][first])
    return np.unique(np.concatenate(chosen))


def observations(bracket: Bracket, channel: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixel values (N, P) of the chosen pixels in every photograph, and ln of the exposures (P,).

    A value that cannot be believed, at an edge or beside a saturated pixel, is given as 0, which has no weight.
    """
    chosen = _choose_pixels(bracket, channel)
    believed = []
    for photograph in bracket.photographs:
        values = photograph.pixels[..., channel]
        doubtful = _unevenness(values.astype(np.float32)) > EVEN**2
        doubtful |= maximum_filter(values, NEAR_WHITE) == LEVELS - 1
        believed.append(np.where(doubtful, 0, values).ravel()[chosen].astype(int))
    values = np.stack(believed, axis=1)
    # A pixel that only one photograph saw well says nothing of the curve's shape.
    useful = ((values > 0) & (values < LEVELS - 1)).sum(1) >= 2
    return values[useful], np.log(bracket.exposures)


def _unevenness(values: np.ndarray) -> np.ndarray:
    """The variance of every pixel's 3×3 neighbourhood."""
    return uniform_filter(values**2, 3) - uniform_filter(values, 3) ** 2
