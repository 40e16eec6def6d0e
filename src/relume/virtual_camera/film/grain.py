"""Grain: a photograph's noise by brightness, and how neighbouring pixels and channels share it.

Demosaicing, noise reduction and JPEG make the noise of neighbours alike, so noise that is to match a photograph needs
its covariance and not only its size. `plate_matching.grain_measuring` measures both on a photograph.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads

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


REACH = 3
"""Pixels over which the noise of neighbours is alike: demosaicing and the chroma of JPEG reach about so far."""
ROUNDING = 1 / 12
"""Variance of a pixel value from rounding alone; it is added again when the grained values are rounded."""
SPECTRUM = 32
"""Side, in pixels, of the grid on which the spectrum of the grain is taken: room for ±3 pixels without wrapping."""


@dataclass(frozen=True, eq=False)
class Grain:
    """Noise that depends on a pixel's value, stationary otherwise.

    values : (3, N) rising, a channel each: pixel values, or radiances
    deviation : (3, N) standard deviation at those values, in their unit, rounding not included
    correlation : (3, 3, 7, 7) of channel a at a pixel with channel b at offsets of −3 to 3 rows and columns; 1 for a
        channel with itself at no offset (the middle)
    """

    values: np.ndarray
    deviation: np.ndarray
    correlation: np.ndarray

    def __post_init__(self) -> None:
        side = 2 * REACH + 1
        if self.correlation.shape != (3, 3, side, side):
            raise ValueError(f"correlation is {self.correlation.shape}; expected (3, 3, {side}, {side})")
        if self.values.shape != self.deviation.shape or self.values.ndim != 2 or self.values.shape[0] != 3:
            raise ValueError(f"values are {self.values.shape}, deviation {self.deviation.shape}; expected (3, N) both")

    def deviation_at(self, values: np.ndarray) -> np.ndarray:
        """Standard deviation (…, 3) at pixel values or radiances (…, 3); beyond the table that of its ends."""
        tables = zip(self.values, self.deviation, strict=True)
        return np.stack([np.interp(values[..., c], *table) for c, table in enumerate(tables)], axis=-1)

    def noise(self, seed: int) -> CorrelatedNoise:
        """Noise of variance 1 with the grain's correlation, of a picture of any size.

        seed : ≥ 0; the same gives the same noise, and a larger picture that of a smaller one in its corner
        """
        return noise_of(_kernels(self.correlation), seed)

    def draw(self, size: tuple[int, int], seed: int) -> np.ndarray:
        """The `noise` (H, W, 3) float32 of a picture.

        size : (width, height) in pixels
        """
        width, height = size
        drawn = np.empty((height, width, 3), np.float32)

        def put(top: int, left: int, noise: np.ndarray) -> None:
            drawn[top : top + noise.shape[1], left : left + noise.shape[2]] = np.moveaxis(noise, 0, -1)

        self.noise(seed).each_square(height, width, put)
        return drawn

    def apply(
        self,
        values: np.ndarray,
        share: np.ndarray | float = 1.0,
        *,
        seed: int = 0,
        noise: np.ndarray | None = None,
    ) -> np.ndarray:
        """Values with the grain that belongs to them, (H, W, 3) float64.

        values : (H, W, 3) pixel values (not rounded) or radiances, as the grain's own table
        share : (H, W) or (H, W, 3), factor on the noise; 0 leaves a value as it is
        noise : (H, W, 3), of a part of a larger picture that was drawn as a whole; `draw` of `seed` unless given
        """
        height, width = values.shape[:2]
        share = np.asarray(share, np.float64)
        share = share[..., None] if share.ndim == 2 else share
        drawn = self.draw((width, height), seed) if noise is None else noise
        return values + share * self.deviation_at(values) * drawn


def _kernels(correlation: np.ndarray) -> np.ndarray:
    """Kernels (3, 3, 2R+1, 2R+1) that turn three white noises into noise with that correlation.

    The spectrum of the noise is the transform of its correlation (Wiener–Khinchin), a Hermitian 3 × 3 matrix at every
    frequency; its square root is the filter. What of a measured correlation no noise can have, negative eigenvalues, is
    left out.
    """
    reach, side = REACH, 2 * REACH + 1
    placed = np.zeros((3, 3, SPECTRUM, SPECTRUM))
    placed[..., :side, :side] = correlation
    placed = np.roll(placed, (-reach, -reach), axis=(-2, -1))
    spectrum = np.moveaxis(np.fft.fft2(placed), (0, 1), (-2, -1))
    spectrum = (spectrum + np.conj(np.swapaxes(spectrum, -1, -2))) / 2
    eigenvalues, vectors = np.linalg.eigh(spectrum)
    root = (vectors * np.sqrt(np.maximum(eigenvalues, 0))[..., None, :]) @ np.conj(np.swapaxes(vectors, -1, -2))
    # C_ab(d) = Σ K_a(u) K_b(u + d) makes the spectrum conj(K) Kᵀ, so K is the conjugate root.
    root = np.conj(root)
    kernels = np.real(np.fft.ifft2(np.moveaxis(root, (-2, -1), (0, 1))))
    kernels = np.roll(kernels, (SPECTRUM // 2, SPECTRUM // 2), axis=(-2, -1))[..., 1:, 1:]
    # What was left out and the channels' own shares make the variance 1 again.
    return kernels / np.sqrt((kernels**2).sum((1, 2, 3)))[:, None, None, None]
