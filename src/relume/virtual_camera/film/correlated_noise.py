"""Correlated noise in three channels, endless: every pixel has its own, drawn or not, whatever is drawn beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SIDE = 256
"""Pixels of the squares that are convolved at a time: their transforms stay in a core's own cache."""


@dataclass(frozen=True, eq=False)
class CorrelatedNoise:
    """White noise in three channels that kernels have made alike between neighbours and channels.

    transfer : (3, 3, SIDE, SIDE // 2 + 1) complex64, the kernels' transforms: into a channel, from a channel
    reach : pixels, of the kernels to each side
    seed : ≥ 0
    """

    transfer: np.ndarray
    reach: int
    seed: int

    def square(self, top: int, left: int) -> np.ndarray:
        """The noise (3, side, side) float32 right and down of a pixel, `side` being SIDE − 2 reach."""
        from scipy.fft import irfft2, rfft2

        from relume.virtual_camera.film.grain_kernels import QUANTILES, fill_white, mix

        white = np.empty((3, SIDE, SIDE), np.float32)
        fill_white(np.uint64(self.seed % 2**64), top - self.reach, left - self.reach, QUANTILES, white)
        waves = np.asarray(rfft2(white))
        mix(self.transfer, waves)
        # What came round the transform's end lies in the first rows and columns.
        return np.asarray(irfft2(waves, (SIDE, SIDE), overwrite_x=True))[:, 2 * self.reach :, 2 * self.reach :]

    def each_square(self, height: int, width: int, work: Callable[[int, int, np.ndarray], None]) -> None:
        """Call `work(top, left, noise)` on every core, with noise (3, h, w) that covers (height, width) once in all."""
        from relume._kernel import in_threads

        side = SIDE - 2 * self.reach
        across = -(-width // side)

        def do(begin: int, end: int) -> None:
            for place in range(begin, end):
                top, left = place // across * side, place % across * side
                work(top, left, self.square(top, left)[:, : height - top, : width - left])

        in_threads(do, -(-height // side) * across, chunk=1)


def noise_of(kernels: np.ndarray, seed: int) -> CorrelatedNoise:
    """The noise that kernels (3, 3, 2r + 1, 2r + 1), into a channel from a channel, make of white noise."""
    from scipy.fft import rfft2

    if seed < 0:
        raise ValueError(f"seed is {seed}; expected 0 or more")
    transfer = np.asarray(rfft2(kernels, (SIDE, SIDE))).astype(np.complex64)
    return CorrelatedNoise(transfer, kernels.shape[-1] // 2, seed)
