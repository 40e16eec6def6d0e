"""Where the next rays belong, and how many there are to be: where errors weigh most in the picture that is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.filtering import dilated
from relume.renderers.progressive.convergence import Sums

REACH = 7
"""Pixels along each side of the square whose pixels choose for the one in its middle, which has no say itself. Of rare
bright paths a pixel that has met none yet has both too low a mean and too low a variance. Were it left as it is for
that, and its lucky neighbours averaged further, the picture would come out too dark."""

AT_ONCE = 2
"""Passes that trace the same pixels: what is traced at once has one start, and pixels are chosen half as often."""
FITTED = 8
"""Times that what pixels need is made smaller for the budget: each leaves a few more pixels with enough."""


@dataclass(frozen=True, eq=False)
class Neediest:
    """Picks the pixels of the next pass: those that have had fewer passes than they need.

    backdrop : (H, W, 3), what is seen without the objects, in the render's unit
    even : passes that trace all pixels, from which the first estimate is taken; two at least
    budget : passes of a pixel on average, at most
    as_good_as : passes of every pixel whose mean squared error is enough; None to spend the budget

    An error counts as a share of the radiance there and of the picture's mean, as the eye sees differences (Weber).
    Its mean square is least for so many passes where they are spread in proportion to the pixels' standard deviations
    σ (Neyman 1934). So spread, (Σσ)² / (N Σσ²) of the passes are as good as passes of all N pixels: few where the noise
    is in few pixels.
    """

    backdrop: np.ndarray
    even: int
    budget: float
    as_good_as: float | None = None

    def __call__(self, sums: Sums) -> np.ndarray | None:
        """(H, W) bool, none where all have what they need; None where all are to be traced."""
        if sums.passes < self.even:
            return None
        if sums.latest is not None and (sums.passes - self.even) % AT_ONCE:
            return sums.latest
        objects, difference, matte = (sums.mean(name) for name in ("objects", "difference", "matte"))
        # What is followed from the light is as noisy whichever pixels are traced.
        variance = sums.own_variance("objects") + sums.own_variance("difference")
        seen = weighed_variance(objects + difference + (1 - matte[..., None]) * self.backdrop, variance)
        passes = np.full(seen.shape, sums.passes) if sums.counts is None else sums.counts
        # Of a single pass, so that how often the others were traced says nothing of this one.
        each = _of_others(seen * passes)
        # What nothing changes has nothing to gain; running sums leave rounding there.
        each = np.where(dilated(seen > 0, REACH // 2), each, 0)
        # Rounded: a pixel that lacks less than half of them has enough.
        return np.asarray(self._needed(each, passes) - passes >= 0.5 * AT_ONCE)

    def expected(self, variance: np.ndarray, most: int) -> float:
        """How many passes a pixel is given on average, of `most`, by the weighed variance (H, W) in a small render."""
        begun = np.full(variance.shape, self.even)
        return float(np.clip(self._needed(_of_others(variance), begun), self.even, most).mean())

    def _needed(self, variance: np.ndarray, passes: np.ndarray) -> np.ndarray:
        """How many passes each pixel needs, of the variance of one, beside those that it has had."""
        deviation = np.sqrt(variance)
        total = float(deviation.sum())
        if total == 0:
            return np.zeros_like(variance)
        if self.as_good_as is None:
            needed = self.budget * (variance.size / total) * deviation
        else:
            needed = self.as_good_as * (total / float(variance.sum())) * deviation
        # Within the budget, of which the passes of pixels that need no more are spent already.
        for _ in range(FITTED):
            more = needed > passes
            left = self.budget * variance.size - float(passes[~more].sum())
            wanted = float(needed[more].sum())
            if wanted <= left:
                break
            needed = needed * max(left, 0.0) / wanted
        return needed


def _of_others(values: np.ndarray) -> np.ndarray:
    """(H, W): of each pixel the mean of those around it, within REACH and the picture, but for its own."""
    from scipy.ndimage import uniform_filter

    square = REACH**2
    sums = square * uniform_filter(values, REACH, mode="constant") - values
    counts = square * uniform_filter(np.ones_like(values), REACH, mode="constant") - 1
    return np.maximum(sums, 0) / np.maximum(counts, 1)


def _of_channels(values: np.ndarray) -> np.ndarray:
    """The sum over the channels (…, 3), which NumPy takes three times as long for along an axis."""
    return values[..., 0] + values[..., 1] + values[..., 2]


def weighed_variance(picture: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """(H, W): the variance (H, W, 3) of a picture's pixels as the eye weighs it, by the radiance there and the mean.

    A pixel that is not finite, which no pass mends, is dark and has no variance.
    """
    # One of a plate, or of a pass, would make all others NaN: none would be traced any more.
    radiance = _finite(_of_channels(np.maximum(picture, 0)))
    return _finite(_of_channels(variance)) / np.maximum(radiance + radiance.mean(), 1e-30) ** 2


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, 0)
