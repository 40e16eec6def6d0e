"""Curves of luminance: every pixel times what its luminance asks for, so that colours keep their proportions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.virtual_camera.tone import luminance_kernels as kernels

MOST = 1e30
"""What luminances and display values are held at: the sun has 1.6e9 cd/m², and float32 ends at 3.4e38, so that sums
and products with anything an operator knows stay finite."""
WEIGHTS = LUMINANCE_WEIGHTS.astype(np.float32)
_ROWS = 64


def without_overflow(radiance: np.ndarray, scale: float) -> np.ndarray:
    """Radiance (H, W, 3) float32 none of which is above MOST, nor above it when multiplied by `scale`; the input itself
    where there is nothing to hold."""
    limit = np.float32(MOST / max(scale, 1.0))
    highest = max(in_threads(lambda begin, end: radiance[begin:end].max(), len(radiance), chunk=_ROWS))
    return radiance if highest <= limit else np.minimum(radiance, limit)


def curved(radiance: np.ndarray, displayed: Callable[[np.ndarray], np.ndarray], *, lowest: float = 0.0) -> np.ndarray:
    """Pixels whose luminance is `displayed` of what it was, R : G : B kept; float32 of the shape of `radiance`.

    radiance : (H, W, 3) float32, finite, 0 or more
    displayed : of luminances (N,) float64 above 0, in the unit of `radiance`; above MOST it counts as that
    lowest : that any channel comes to, 0 or less: of a curve that is below 0 in the dark, what it is of black

    The curve is asked at 256 luminances a stop, over all that float32 holds, and read between them: of a power between
    0 and 2 that is right to 4e-6. Black stays black.
    """
    factors, floor = factor_table(displayed), np.float32(lowest)
    return _in_bands(
        radiance, lambda pixels, begin, end, out: kernels.apply_table(pixels, WEIGHTS, factors, floor, begin, end, out)
    )


def photographic(radiance: np.ndarray, scale: float, white: float) -> np.ndarray:
    """Pixels whose luminance is x(1 + x/white²)/(1 + x) of x = scale times it (Reinhard et al. 2002, eq. 4).

    radiance : (H, W, 3) float32, finite, 0 or more
    white : that becomes 1, in the unit of x; infinity leaves eq. 3, x/(1 + x)
    """
    return _in_bands(
        radiance,
        lambda pixels, begin, end, out: kernels.apply_photographic(
            pixels, WEIGHTS, float(scale), 1 / float(white), begin, end, out
        ),
    )


def scaled(radiance: np.ndarray, gain: float) -> np.ndarray:
    """Pixels times a gain, float32."""
    factor = np.float32(gain)

    def scale(pixels: np.ndarray, begin: int, end: int, out: np.ndarray) -> None:
        np.multiply(pixels[begin:end], factor, out=out[begin:end])

    return _in_bands(radiance, scale)


def factor_table(displayed: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(2¹⁶ + 1,) float32, what a luminance is multiplied by at each luminance whose last bits are 0."""
    nodes = (np.arange((1 << (31 - kernels.CELL_BITS)) + 1, dtype=np.uint32) << kernels.CELL_BITS).view(np.float32)
    known = np.isfinite(nodes) & (nodes > 0)
    light = nodes[known].astype(np.float64)
    factors = np.zeros(nodes.size)
    factors[known] = np.minimum(displayed(light), MOST) / light
    # Towards black a curve may rise without end; below the least that float32 holds no light is lost.
    factors[0] = factors[1]
    factors[~known & (nodes != 0)] = factors[known][-1]
    most = float(np.finfo(np.float32).max)
    return np.clip(factors, -most, most).astype(np.float32)


def _in_bands(radiance: np.ndarray, work: Callable[[np.ndarray, int, int, np.ndarray], None]) -> np.ndarray:
    pixels = np.ascontiguousarray(radiance, dtype=np.float32).reshape(-1, 3)
    result = np.empty_like(pixels)
    in_threads(lambda begin, end: work(pixels, begin, end, result), len(pixels))
    return result.reshape(radiance.shape)
