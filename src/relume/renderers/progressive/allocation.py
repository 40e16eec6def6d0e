"""Where the next rays belong, and how many there are to be: where errors weigh most in the picture that is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.renderers.progressive.convergence import Sums

REACH = 7
"""Pixels along each side of the square whose pixels choose for the one in its middle, which has no say itself. Of rare
bright paths a pixel that has met none yet has both too low a mean and too low a variance. Were it left as it is for
that, and its lucky neighbours averaged further, the picture would come out too dark."""

WIDE = 4 * REACH + 1
"""The same of a wider square, which says how far the mean of the small one is to be believed: of light that is met
seldom most small squares have seen none, and their pixels would be given too little."""

AT_ONCE = 2
"""Passes that trace the same pixels: what is traced at once has one start."""
FITTED = 8
"""Times that what pixels need is made smaller for the budget: each leaves a few more pixels with enough."""


@dataclass(frozen=True, eq=False)
class Neediest:
    """Plans how many passes each pixel has, from the even passes alone.

    backdrop : (H, W, 3), what is seen without the objects, in the render's unit
    even : passes that trace all pixels, from which the noise is estimated; two at least
    budget : passes of a pixel on average, at most
    as_good_as : passes of every pixel whose mean squared error is enough; None to spend the budget

    An error counts as a share of the radiance there and of the picture's mean, as the eye sees differences (Weber).
    Its mean square is least for so many passes where they are spread in proportion to the pixels' standard deviations
    σ (Neyman 1934). So spread, (Σσ)² / (N Σσ²) of the passes are as good as passes of all N pixels: few where the noise
    is in few pixels. Neither a pixel's own passes, but for their part in the picture's sums, nor later ones have a say,
    so that its mean is that of even rays (Kirk & Arvo 1991).
    """

    backdrop: np.ndarray
    even: int
    budget: float
    as_good_as: float | None = None

    def __call__(self, sums: Sums) -> np.ndarray | None:
        """(H, W) int32, how many passes each pixel is to have in all; None as long as all are to be traced."""
        if sums.passes < self.even:
            return None
        objects, difference, matte = (sums.mean(name) for name in ("objects", "difference", "matte"))
        # What is followed from the light is as noisy whichever pixels are traced.
        variance = sums.own_variance("objects") + sums.own_variance("difference")
        seen = weighed_variance(objects + difference + (1 - matte[..., None]) * self.backdrop, variance)
        return self._planned(_expected_of(seen), sums.passes)

    def expected(self, variance: np.ndarray, most: int) -> float:
        """How many passes a pixel is given on average, of `most`, by the weighed variance (h, w) in a small render."""
        return float(np.minimum(self._planned(_expected_of(variance), self.even), most).mean())

    def _planned(self, variance: np.ndarray, begun: int) -> np.ndarray:
        """How many passes each pixel is to have, `begun` of them done, by variances in any unit."""
        needed = np.maximum(self._needed(variance, begun), begun)
        # In groups that trace the same pixels; who lacks less than half of one has enough.
        return begun + AT_ONCE * np.rint((needed - begun) / AT_ONCE).astype(np.int32)

    def _needed(self, variance: np.ndarray, begun: int) -> np.ndarray:
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
            more = needed > begun
            left = self.budget * variance.size - begun * float(np.count_nonzero(~more))
            wanted = float(needed[more].sum())
            if wanted <= left:
                break
            needed = needed * max(left, 0.0) / wanted
        return needed


def _expected_of(variance: np.ndarray) -> np.ndarray:
    """(H, W): what each pixel's variance is expected to be by those around it, not by its own."""
    variance = variance.astype(np.float64, copy=False)
    near, wide = _of_others(variance, REACH), _of_others(variance, WIDE)
    # Near means scatter as single values do, over their number; what they differ by beyond that is the picture's.
    # Seen where no small square holds the pixel: one that is bright by luck would believe its dark neighbours.
    scatter, mean, square = (_of_others(v, WIDE, REACH) for v in (np.square(variance - near), near, np.square(near)))
    chance = scatter / (REACH**2 - 1)
    differ = np.maximum(square - np.square(mean) - chance, 0)
    believed = differ / np.maximum(differ + chance, 1e-300)
    return believed * near + (1 - believed) * wide


def _of_others(values: np.ndarray, reach: int, but: int = 1) -> np.ndarray:
    """(H, W): of each pixel the mean of those around it, within `reach` and the picture, but for those within `but`."""
    sums = _of_square(values, reach) - _of_square(values, but)
    ones = np.ones_like(values)
    counts = _of_square(ones, reach) - _of_square(ones, but)
    return np.maximum(sums, 0) / np.maximum(counts, 1)


def _of_square(values: np.ndarray, reach: int) -> np.ndarray:
    from scipy.ndimage import uniform_filter

    return reach**2 * uniform_filter(values, reach, mode="constant")


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
