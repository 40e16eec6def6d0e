"""From readings of stripes to the areas of a backdrop that a pixel sees: one, or two where one explains too little.

A reading is the share of a pixel's light from the backdrop that came from white stripes, (C − black) / (white − black):
the integral of the pixel's weight over them. Areas are boxes of constant weight along the backdrop's axes, in texels
(middle and width across, middle and width down); the readings are fitted by least squares, so that what straddles an
edge of a stripe is placed between the texels (Zongker et al. 1999).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.image.bands import in_threads
from relume.lightstage.matting import kernel as matte_kernel
from relume.lightstage.matting.gray_code import Patterns

_ROUNDS = 2
"""Of fitting anew near what neighbours say: a second one uses the first one's better neighbours."""


@dataclass(frozen=True, eq=False)
class Search:
    """What boxes along one axis would read: where a fit begins, and how it goes on.

    cumulative : (K, n + 1) float64, running sums of the stripes over n texels
    table : (K, C) float32, readings of C boxes; their middles and widths (C,) float64, texels
    pictures : (K,) which of the patterns are striped along this axis
    """

    cumulative: np.ndarray
    table: np.ndarray
    middles: np.ndarray
    widths: np.ndarray
    pictures: np.ndarray


def search_along(patterns: Patterns, axis: str, steps: int = 4) -> Search:
    """Boxes of all widths from half a texel, at `steps` places in their width but no nearer than half a texel.

    Each is wider than the one before by two steps: a search of fewer steps is coarser, and as much faster.
    """
    pictures = np.array([index for index, stripe in enumerate(patterns.stripes) if stripe.axis == axis])
    white = np.stack([patterns.stripes[index].white for index in pictures]).astype(np.float64)
    texels = white.shape[1]
    cumulative = np.concatenate([np.zeros((len(white), 1)), np.cumsum(white, axis=1)], axis=1)
    middles, widths, width = [], [], 2 / steps
    while width < texels:
        step = max(2 / steps, width / steps)
        middles.append(np.arange(step / 2, texels, step))
        widths.append(np.full(len(middles[-1]), width))
        width *= 1 + 2 / steps
    middle = np.concatenate([*middles, [texels / 2]])
    wide = np.concatenate([*widths, [float(texels)]])
    edges = np.arange(texels + 1)
    begin, end = np.clip(middle - wide / 2, 0, texels), np.clip(middle + wide / 2, 0, texels)
    sums = [np.interp(end, edges, row) - np.interp(begin, edges, row) for row in cumulative]
    return Search(cumulative, (np.stack(sums) / (end - begin)).astype(np.float32), middle, wide, pictures)


def _for_all(loop: Callable[..., None], pixels: np.ndarray, *arguments: Any, chunk: int = 4096) -> None:
    """Call a kernel on every core for all of its pixels, whose array is its first argument behind the range."""
    in_threads(lambda begin, end: loop(begin, end, pixels, *arguments), len(pixels), chunk=chunk)


def fitted_alone(readings: np.ndarray, search: Search) -> np.ndarray:
    """The one box along an axis that explains readings (P, K) best: (P, 3) middle, width, summed squared misfit."""
    fitted = np.empty((len(readings), 3), np.float32)
    boxes = search.table, search.middles, search.widths
    # In rows, as the kernels get them elsewhere: in another order of memory they would be compiled once more.
    _for_all(matte_kernel.fit_one, np.ascontiguousarray(readings), search.cumulative, *boxes, fitted)
    return fitted


def fitted_near(readings: np.ndarray, search: Search, fitted: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """The same boxes where readings leave them free to move drawn to where their neighbours say they lie.

    Between two edges of the finest stripes readings place a narrow box no closer, but what a smooth surface
    shows moves evenly: the mean of opposite neighbours, where these agree, is where a pixel is expected.
    """
    for _ in range(_ROUNDS):
        middle, width = fitted[:, 0].reshape(shape), fitted[:, 1].reshape(shape)
        expected, strength = _expected(middle, width)
        drawn = fitted.copy()
        _for_all(
            matte_kernel.fit_near,
            np.ascontiguousarray(readings),
            search.cumulative,
            expected.ravel(),
            strength.ravel(),
            drawn,
        )
        fitted = drawn
    return fitted


def _expected(middle: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the four pairs of opposite neighbours expect a pixel's box (H, W), and how strongly: misfit a texel²."""
    padded = np.pad(middle.astype(np.float64), 1, mode="edge")
    height, across = middle.shape
    means = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        before = padded[1 - down : 1 - down + height, 1 - right : 1 - right + across]
        after = padded[1 + down : 1 + down + height, 1 + right : 1 + right + across]
        means.append(0.5 * (before + after))
    stack = np.stack(means)
    expected, spread = np.median(stack, axis=0), np.ptp(stack, axis=0)
    # Beyond a texel, or a part of the box, neighbours disagree: an edge runs between them.
    scale = np.maximum(1.0, 0.25 * width)
    sure = np.clip(1 - np.maximum(spread, np.abs(expected - middle)) / (2 * scale), 0, 1)
    return expected, (_STRENGTH * sure / scale**2)


_STRENGTH = 0.02
"""Misfit of a box one texel off where its neighbours expect it: less than a reading that is off by a sixth."""


def fitted_together(
    readings: np.ndarray,
    searches: tuple[Search, Search],
    pixels: np.ndarray,
    single: np.ndarray,
    straight: np.ndarray,
    shape: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The two areas whose light explains readings (P, K) best.

    readings : of the pictures striped across first, then down
    pixels : (P,) which of the picture's they are
    single : (H · W, 4) the areas of all pixels, each fitted alone
    straight : (P, 4) what is seen where nothing is in the way, NaN where unknown
    Returns areas (2, P, 4), the first one's share (P,), and the summed squared misfit (P,).
    """
    across, down = searches
    fitted = np.empty((len(readings), 10), np.float32)
    counts = np.array([len(across.pictures), len(down.pictures)])
    sums, alone = (across.cumulative, down.cumulative), single[pixels]
    boxes = (across.table, down.table), (across.middles, down.middles), (across.widths, down.widths)
    _for_all(matte_kernel.fit_two, readings, sums, boxes, counts, alone, straight, fitted, chunk=256)
    numbers = np.full(shape, -1)
    numbers.flat[pixels] = np.arange(len(pixels))
    for _ in range(_SWEEPS):
        before, fitted = fitted, np.empty_like(fitted)
        fixed = numbers, readings, sums, boxes, counts, single
        _for_all(matte_kernel.fit_among, pixels, *fixed, before, _TOGETHER, fitted, chunk=256)
    return np.stack([fitted[:, :4], fitted[:, 4:8]]), fitted[:, 8], fitted[:, 9]


_SWEEPS, _TOGETHER = 1, 0.2
"""Times that neighbours pass their areas on, and the summed squared misfit that an area unlike all of theirs costs."""


def readings_of(areas: np.ndarray, searches: tuple[Search, Search]) -> np.ndarray:
    """What areas (…, 4) read of all pictures, those striped across first: (…, K)."""
    reads = []
    for axis, search in enumerate(searches):
        texels = search.cumulative.shape[1] - 1
        middle, width = areas[..., 2 * axis].astype(np.float64), areas[..., 2 * axis + 1].astype(np.float64)
        begin = np.clip(middle - width / 2, 0, texels - 0.01)
        end = np.maximum(np.clip(middle + width / 2, 0, texels), begin + 0.01)
        edges = np.arange(texels + 1)
        reads += [
            (np.interp(end, edges, row) - np.interp(begin, edges, row)) / (end - begin) for row in search.cumulative
        ]
    return np.stack(reads, axis=-1)
