"""How much brighter one photograph is than another, from pixels alone and without a response.

Every verdict here is drawn from photographs made small: a look at a bracket must cost nothing beside merging it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.errors import NotABracket
from relume.image.colour import decode_srgb
from relume.image.photograph import Photograph

WIDTH = 300
"""Blocks across a reduced photograph: enough for thousands of pixel values, few enough to cost milliseconds."""
DARKEST, BRIGHTEST = 0.06, 0.9
"""Pixel values (0 to 1) that are compared: below lies the noise of a black, above the shoulder before white."""
_FINE = 4  # pixels looked at along a block's side; their mean has a quarter of a pixel's noise
_LEVELS = np.linspace(DARKEST, BRIGHTEST, 64)
_BINS = 1024  # at most: of 16 bits the lowest six do not matter here
_TAIL = 30  # pixels that must lie above and below a level in both photographs: a rank among fewer is chance
_LEAST_SEEN = 6  # levels, over the channels, below which no ratio is given


@dataclass(frozen=True, eq=False)
class Reduced:
    """A photograph made small.

    name : the file
    encoded : (h, w, 3) float32, means of blocks of pixel values, 0 to 1
    inside : (h, w) bool, False where any pixel looked at is outside the picture
    below : (3, S) share of the single pixels of each channel that lie below each of `steps`; of single pixels, because
        the mean of black and white is a grey that no light ever made
    steps : (S,) pixel values, 0 to 1, halfway between those that a pixel can have
    pixels : how many single pixels those are
    """

    name: str
    encoded: np.ndarray
    inside: np.ndarray
    below: np.ndarray
    steps: np.ndarray
    pixels: int

    @property
    def mean(self) -> float:
        """Mean pixel value, 0 to 1: rises with exposure as long as anything is neither black nor white."""
        return float(1.0 - self.below[:, 1:].mean())


def reduced(photograph: Photograph) -> Reduced:
    """The photograph as means of about 300 blocks across; raises NotABracket where all of it is outside."""
    side, most = max(photograph.size), np.iinfo(photograph.pixels.dtype).max
    # A small photograph keeps its pixels: blocks of one are better than hardly any blocks.
    fine = min(_FINE, max(1, side // WIDTH))
    step = max(1, round(side / (WIDTH * fine)))
    encoded = _blocks(photograph.pixels, step, fine) / np.float32(most * fine**2)
    inside = np.ones(encoded.shape[:2], bool)
    if photograph.outside is not None:
        inside = _blocks(photograph.outside, step, fine) == 0
    if not inside.any():
        raise NotABracket(f"{photograph.name}: all of it is marked as outside the picture; leave it out of the bracket")
    single, bins = photograph.pixels[:: 2 * step, :: 2 * step], min(most + 1, _BINS)
    if photograph.outside is not None:
        single = single[~photograph.outside[:: 2 * step, :: 2 * step]]
    values = single.reshape(-1, 3) // ((most + 1) // bins)
    steps = (np.arange(bins + 1) * ((most + 1) // bins) - 0.5) / most
    counts = np.stack([np.bincount(channel, minlength=bins) for channel in np.ascontiguousarray(values.T)])
    below = np.concatenate([np.zeros((3, 1)), np.cumsum(counts, axis=1)], axis=1) / max(1, len(values))
    return Reduced(photograph.name, encoded, inside, below, steps, len(values))


def matched(less: Reduced, more: Reduced) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """A channel each: pixel values of `less` and those of `more` that show the same light, (N,) each, 0 to 1.

    Equal shares of the two pictures are matched and not equal places, so that neither a camera that moved nor a
    passer-by matters (histogram specification; Grossberg & Nayar 2003, "Determining the camera response from images:
    what is knowable?"). Values near black or white in either are left out.
    """
    return tuple(_matched_channel(less, more, channel) for channel in range(3))


def log_ratio(less: Reduced, more: Reduced) -> float | None:
    """ln of how much more light `more` was given than `less` if sRGB encoded both; None where nothing shows it."""
    first, second = (np.concatenate(values) for values in zip(*matched(less, more), strict=True))
    if len(first) < _LEAST_SEEN:
        return None
    return float(np.median(np.log(decode_srgb(second) / decode_srgb(first))))


def brightness_chain(pictures: Sequence[Reduced]) -> np.ndarray:
    """ln exposure of each picture above that of the darkest, (P,), summed over neighbours in brightness.

    Raises NotABracket where two neighbours have no well exposed values in common.
    """
    order = sorted(range(len(pictures)), key=lambda i: pictures[i].mean)
    exposures = np.zeros(len(pictures))
    for darker, brighter in pairwise(order):
        ratio = log_ratio(pictures[darker], pictures[brighter])
        if ratio is None:
            raise NotABracket(
                f"{pictures[brighter].name}: its exposure is unknown, and it shares no well exposed pixels with "
                f"{pictures[darker].name} to estimate it from; give one time per photograph with --times"
            )
        exposures[brighter] = exposures[darker] + ratio
    return exposures


def _matched_channel(less: Reduced, more: Reduced, channel: int) -> tuple[np.ndarray, np.ndarray]:
    # Levels evenly spaced in value, not in share: a church is nine tenths dark, and its windows show the most.
    share = np.interp(_LEVELS, less.steps, less.below[channel])
    partner = np.interp(share, more.below[channel], more.steps)
    tail = np.minimum(share, 1 - share) * min(less.pixels, more.pixels)
    seen = (tail >= _TAIL) & (partner > DARKEST) & (partner < BRIGHTEST)
    return _LEVELS[seen], partner[seen]


def _blocks(values: np.ndarray, step: int, fine: int) -> np.ndarray:
    """Sums of `fine` × `fine` pixels that lie `step` apart; the rest at the right and lower edge is left out."""
    pitch = step * fine
    height, width = (max(1, side // pitch) for side in values.shape[:2])
    total = np.zeros((height, width, *values.shape[2:]), np.uint32)
    for row in range(0, min(pitch, values.shape[0]), step):
        for column in range(0, min(pitch, values.shape[1]), step):
            total += values[row::pitch, column::pitch][:height, :width]
    return total
