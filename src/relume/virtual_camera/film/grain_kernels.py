"""The loops that draw white noise, mix its channels' transforms, and put noise on pixel values, compiled."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_inlined, exact_kernel
from relume.virtual_camera.film.float_table import looked_up, tabulated

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""SplitMix64's step from counter to counter."""
FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
S27, S30, S31 = (np.uint64(n) for n in (27, 30, 31))
_SIGN, _SIZE, _HALF = np.uint64(1), np.uint64(0x7FFFFFFF), np.float32(2.0**-32)
S32 = np.uint64(32)


def _quantile(chance: np.ndarray) -> np.ndarray:
    """How many deviations a normal number exceeds with that chance; 0 beyond ½."""
    from scipy.special import ndtri

    return -ndtri(np.minimum(chance, 0.5))


QUANTILES = tabulated(_quantile)
"""Of normal numbers, by the chance to exceed them: right to 1e-5 deviations."""


@exact_inlined
def mixed(state):
    """SplitMix64's output of a counter (Steele, Lea & Flood 2014): every place has its own number, drawn or not."""
    z = (state ^ (state >> S30)) * FIRST
    z = (z ^ (z >> S27)) * SECOND
    return z ^ (z >> S31)


@exact_inlined
def _normal(drawn, quantiles):
    """A normal number from 32 even bits: one is its sign, 31 the chance to be farther from 0."""
    chance = (np.float32((drawn >> _SIGN) & _SIZE) + np.float32(0.5)) * _HALF
    size = looked_up(quantiles, np.int64(np.float32(chance).view(np.int32)))
    return size if drawn & _SIGN else -size


@exact_kernel
def fill_white(seed, top, left, quantiles, out):
    """Independent normal numbers of variance 1 into `out` (3, h, w), those of the pixels from row `top`, column `left`.

    A pixel's numbers follow from the seed and its place alone. None is beyond 6.3 deviations: of 31 bits of chance.
    """
    first = mixed(seed + GOLDEN)
    for y in range(out.shape[1]):
        key = mixed(first + np.uint64(top + y) * GOLDEN)
        for x in range(out.shape[2]):
            place = np.uint64(2 * (left + x))
            drawn = mixed(key + place * GOLDEN)
            out[0, y, x] = _normal(drawn, quantiles)
            out[1, y, x] = _normal(drawn >> S32, quantiles)
            out[2, y, x] = _normal(mixed(key + (place + _SIGN) * GOLDEN), quantiles)


@exact_kernel
def mix(transfer, waves):
    """Transforms `waves` (3, h, w) times the matrices (3, 3, h, w) of their frequencies, in place."""
    for y in range(waves.shape[1]):
        for x in range(waves.shape[2]):
            red, green, blue = waves[0, y, x], waves[1, y, x], waves[2, y, x]
            for a in range(3):
                waves[a, y, x] = transfer[a, 0, y, x] * red + transfer[a, 1, y, x] * green + transfer[a, 2, y, x] * blue


@exact_kernel
def add_to_values(shown, noise, values, deviations, light):
    """Add noise to the pixel values of linear display values `shown` (h, w, 3), in place; what saturates stays.

    noise : (3, h, w) of variance 1
    values, deviations, light : tables over floats: a linear value's pixel value, the deviation there (3 of them), and
        a pixel value's linear value
    """
    for y in range(shown.shape[0]):
        for x in range(shown.shape[1]):
            for c in range(3):
                linear = shown[y, x, c]
                if linear > 0 and linear < 1:
                    bits = np.int64(np.float32(linear).view(np.int32))
                    value = looked_up(values, bits) + noise[c, y, x] * looked_up(deviations[c], bits)
                    value = np.float32(min(max(value, np.float32(0)), np.float32(255)))
                    shown[y, x, c] = looked_up(light, np.int64(np.float32(value).view(np.int32)))
