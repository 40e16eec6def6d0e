"""Where the next rays belong: to the pixels whose errors weigh most in the picture that is looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.renderers.progressive.convergence import Sums

REACH = 7
"""Pixels along each side of the square whose pixels choose for the one in its middle, which has no say itself. Of rare
bright paths a pixel that has met none yet has both too low a mean and too low a variance. Were it left as it is for
that, and its lucky neighbours averaged further, the picture would come out too dark."""


@dataclass(frozen=True, eq=False)
class Neediest:
    """Picks the pixels of the next pass: those whose mean squared error a pass more lowers most.

    backdrop : (H, W, 3), what is seen without the objects, in the render's unit
    even : passes that trace all pixels, from which the first estimate is taken
    share : of the pixels that each pass after them traces

    An error counts as a share of the radiance there and of the picture's mean, as the eye sees differences (Weber). A
    pass more lowers the squared error of a mean of n passes by its n-th part, so in the end passes are spread in
    proportion to the pixels' standard deviations (Neyman 1934).
    """

    backdrop: np.ndarray
    even: int
    share: float

    def __call__(self, sums: Sums) -> np.ndarray | None:
        """(H, W) bool, or None where all are to be traced."""
        if sums.passes < self.even:
            return None
        from scipy.ndimage import maximum_filter

        objects, difference, matte = (sums.mean(name) for name in ("objects", "difference", "matte"))
        variance = sums.variance("objects") + sums.variance("difference")
        seen = weighed_variance(objects + difference + (1 - matte[..., None]) * self.backdrop, variance)
        passes = sums.passes if sums.counts is None else sums.counts
        # Of a single pass, so that how often the others were traced says nothing of this one.
        gain = _of_others(seen * passes) / np.square(passes)
        # What nothing changes has nothing to gain; running sums leave rounding there.
        gain = np.where(maximum_filter(seen, REACH) > 0, gain, 0)
        least = np.partition(gain, -self._count(gain), axis=None)[-self._count(gain)]
        return (gain >= least) & (gain > 0)

    def _count(self, gain: np.ndarray) -> int:
        return max(1, int(self.share * gain.size))


def _of_others(values: np.ndarray) -> np.ndarray:
    """(H, W): of each pixel the mean of those around it, within REACH and the picture, but for its own."""
    from scipy.ndimage import uniform_filter

    square = REACH**2
    sums = square * uniform_filter(values, REACH, mode="constant") - values
    counts = square * uniform_filter(np.ones_like(values), REACH, mode="constant") - 1
    return np.maximum(sums, 0) / np.maximum(counts, 1)


def weighed_variance(picture: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """(H, W): the variance (H, W, 3) of a picture's pixels as the eye weighs it, by the radiance there and the mean."""
    radiance = np.maximum(picture, 0).sum(-1)
    return variance.sum(-1) / np.maximum(radiance + radiance.mean(), 1e-30) ** 2
