"""Two photographs compared: how much brighter one is, without a response, and whether both show one scene.

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
STRANGE = 0.36
"""Similarity below which photographs show different scenes: unrelated ones reach 0.27 at most, and pairs of one scene
that are four stops apart or hand-held lie above 0.46."""
_COARSE = 40  # blocks across: a hand's shake is less than two of them
SHIFTS = [(down, right) for down in range(-2, 3) for right in range(-2, 3)]  # blocks
_VALUES = (12, 24, 48, 96)
"""Pixel values that are distinguished, coarsely against the noise of a black, finely for the little that a flat scene
shows; each picture pair is taken as it is most alike."""
_SURROUND = 9  # blocks; all pictures are lighter at the top and fall off at the edge, so only departures count


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
    found = []
    for less_below, more_below in zip(less.below, more.below, strict=True):
        # Levels evenly spaced in value, not in share: a church is nine tenths dark, and its windows show the most.
        share = np.interp(_LEVELS, less.steps, less_below)
        partner = np.interp(share, more_below, more.steps)
        tail = np.minimum(share, 1 - share) * min(less.pixels, more.pixels)
        seen = (tail >= _TAIL) & (partner > DARKEST) & (partner < BRIGHTEST)
        found.append((_LEVELS[seen], partner[seen]))
    return tuple(found)


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


def _blocks(values: np.ndarray, step: int, fine: int) -> np.ndarray:
    """Sums of `fine` × `fine` pixels that lie `step` apart; the rest at the right and lower edge is left out."""
    pitch = step * fine
    height, width = (max(1, side // pitch) for side in values.shape[:2])
    total = np.zeros((height, width, *values.shape[2:]), np.uint32)
    for row in range(0, min(pitch, values.shape[0]), step):
        for column in range(0, min(pitch, values.shape[1]), step):
            total += values[row::pitch, column::pitch][:height, :width]
    return total


def structure(picture: Reduced) -> np.ndarray:
    """What is where in a photograph: ranks of coarse blocks less those around them, (V, h, w) for `_VALUES`.

    They are 0 outside the picture.
    """
    from scipy.ndimage import uniform_filter

    grey, inside = coarse_blocks(picture)
    height, width = inside.shape
    share = np.maximum(uniform_filter(inside.astype(np.float64), _SURROUND, mode="constant"), 1e-6)
    ranks = np.zeros((len(_VALUES), height, width))
    for plane, values in zip(ranks, _VALUES if inside.any() else (), strict=False):
        plane[inside] = ranks_of(np.rint(values * grey)[inside])
        plane[inside] -= plane[inside].mean()
        plane -= np.where(inside, uniform_filter(plane, _SURROUND, mode="constant") / share, 0.0)
    return ranks


def coarse_blocks(picture: Reduced) -> tuple[np.ndarray, np.ndarray]:
    """Means (h, w) of about 40 blocks across, 0 to 1, and whether all of a block is inside the picture."""
    fine = max(1, round(max(picture.inside.shape) / _COARSE))
    height, width = (max(1, side // fine) for side in picture.inside.shape)
    grey = picture.encoded.mean(axis=2)[: height * fine, : width * fine].reshape(height, fine, width, fine)
    inside = picture.inside[: height * fine, : width * fine].reshape(height, fine, width, fine)
    return grey.mean(axis=(1, 3)), np.asarray(inside.all(axis=(1, 3)))


def ranks_of(values: np.ndarray) -> np.ndarray:
    """Ranks from 1, ties at their mean: `scipy.stats.rankdata`, whose module takes half a second to load."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[place]


def similarity(first: np.ndarray, second: np.ndarray) -> float | None:
    """Rank correlation of two structures at the best small shift, −1 to 1; None where one photograph shows nothing."""
    best = None
    for down, right in SHIFTS:
        a, b = overlap(first, down, right), overlap(second, -down, -right)
        power = np.sqrt((a * a).sum(axis=(1, 2)) * (b * b).sum(axis=(1, 2)))
        if (power > 0).any():
            alike = ((a * b).sum(axis=(1, 2))[power > 0] / power[power > 0]).max()
            best = float(alike) if best is None else max(best, float(alike))
    return best


def overlap(ranks: np.ndarray, down: int, right: int) -> np.ndarray:
    """The planes without their first `down` rows and `right` columns; where negative, without the last ones."""
    _, height, width = ranks.shape
    rows = slice(max(down, 0), height + min(down, 0))
    return ranks[:, rows, max(right, 0) : width + min(right, 0)]
