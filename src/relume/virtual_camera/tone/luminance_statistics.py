"""What a light meter reads from a picture: log average, highest luminance, percentiles.

Pixels of exactly 0 count nowhere: a renderer's background and what a camera did not see are no light to adapt to.
Results do not depend on the number of threads.
"""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.virtual_camera.tone import luminance_kernels as kernels
from relume.virtual_camera.tone.luminance_curve import WEIGHTS

_TABLES = 16
"""Of counts for a picture: as many as keep the cores busy, none of them large beside the pixels it counts."""


def light_sum(radiance: np.ndarray) -> tuple[np.ndarray, float]:
    """Mean colour (3,) float64, linear Rec. 709, and highest luminance of radiance (H, W, 3) float32, in its unit."""
    pixels = _pixels(radiance)
    parts = np.array(in_threads(lambda a, b: kernels.channel_sums(pixels, WEIGHTS, a, b), len(pixels)))
    return parts[:, :3].sum(0) / len(pixels), float(parts[:, 3].max())


def log_average(radiance: np.ndarray, addend: float = 0.0) -> float:
    """exp of the mean of ln(L + addend), in the unit of radiance (H, W, 3) float32; 1 where nothing is above 0.

    addend : δ of Reinhard et al. 2002, eq. 1, for pixels near black
    """
    pixels = _pixels(radiance)
    parts = in_threads(lambda a, b: kernels.logarithm_sum(pixels, WEIGHTS, float(addend), a, b), len(pixels))
    count = sum(part[1] for part in parts)
    return float(np.exp(sum(part[0] for part in parts) / count)) if count else 1.0


def percentiles(light: np.ndarray, *percents: float) -> list[float]:
    """The least value that so many percent of those above 0 do not exceed, for each; 0 where none is.

    light : any shape, float32, 0 or more: luminances, or the channels of radiance
    percents : 0 to 100; 100 is the highest value

    Exact order statistics: bits of floats that are not negative sort as the floats do, so two counts find one.
    """
    bits = np.ascontiguousarray(light, dtype=np.float32).reshape(-1).view(np.int32)
    chunk = max(1 << 20, -(-len(bits) // _TABLES))
    parts = in_threads(lambda a, b: kernels.count_high_bits(bits, a, b), len(bits), chunk=chunk)
    high, zeros = np.sum([part[0] for part in parts], axis=0), sum(part[1] for part in parts)
    lit = len(bits) - zeros
    if not lit:
        return [0.0] * len(percents)
    found = []
    for percent in percents:
        rank = zeros + min(max(int(np.ceil(percent / 100 * lit)), 1), lit)
        upper = int(np.searchsorted(np.cumsum(high), rank))
        rank -= int(high[:upper].sum())
        low = in_threads(lambda a, b, upper=upper: kernels.count_low_bits(bits, upper, a, b), len(bits), chunk=chunk)
        lower = int(np.searchsorted(np.cumsum(np.sum(low, axis=0)), rank))
        found.append(float(np.uint32((upper << kernels.LOW_BITS) | lower).view(np.float32)))
    return found


def luminances(radiance: np.ndarray) -> np.ndarray:
    """(H, W) float32 of radiance (H, W, 3) float32, in its unit."""
    pixels = _pixels(radiance)
    light = np.empty(len(pixels), np.float32)
    in_threads(lambda a, b: kernels.fill_luminances(pixels, WEIGHTS, a, b, light), len(pixels))
    return light.reshape(radiance.shape[:2])


def _pixels(radiance: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(radiance, dtype=np.float32).reshape(-1, 3)
