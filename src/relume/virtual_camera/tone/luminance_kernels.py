"""Loops over the luminances of a picture's pixels, compiled: sums, logarithms, counts and curves.

Pixels are (N, 3) float32, weights (3,) float32 of luminance. Each loop works on pixels begin to end.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, kernel

BLOCK = 256
"""Mantissas, each below 2, that are multiplied before a logarithm is taken: their product stays below 2²⁵⁶."""
LOW_BITS = 16
"""Of a value's 32 that the first count of two leaves out."""
CELL_BITS = 15
"""Of a luminance's 32 that a table leaves to interpolation: 256 cells a stop are left, and 8 bits of exponent."""

_MANTISSA, _ONE = (1 << 52) - 1, 1023 << 52
_CELL = (1 << CELL_BITS) - 1
_SIZE = (1 << 31) - 1  # all bits but the sign: there are negative zeros


@kernel
def channel_sums(pixels, weights, begin, end):
    """Σ of each channel, and the highest luminance."""
    red, green, blue = 0.0, 0.0, 0.0
    highest = np.float32(0)
    for i in range(begin, end):
        red += pixels[i, 0]
        green += pixels[i, 1]
        blue += pixels[i, 2]
        highest = max(highest, weights[0] * pixels[i, 0] + weights[1] * pixels[i, 1] + weights[2] * pixels[i, 2])
    return red, green, blue, highest


@kernel
def logarithm_sum(pixels, weights, addend, begin, end):
    """Σ ln(L + addend) over the luminances above 0, and how many these are."""
    total, powers, count = 0.0, 0, 0
    for block in range(begin, end, BLOCK):
        # A logarithm of a product costs one logarithm: exponents are added and mantissas multiplied.
        product = 1.0
        for i in range(block, min(block + BLOCK, end)):
            light = weights[0] * pixels[i, 0] + weights[1] * pixels[i, 1] + weights[2] * pixels[i, 2]
            lit = light > 0
            bits = np.float64(light + addend).view(np.int64)
            powers += ((bits >> 52) - 1023) * lit
            product *= np.int64((bits & _MANTISSA) | _ONE).view(np.float64) if lit else 1.0
            count += lit
        total += np.log(product)
    return total + powers * np.log(2.0), count


@kernel
def fill_luminances(pixels, weights, begin, end, result):
    """Luminances into `result` (N,) float32."""
    for i in range(begin, end):
        result[i] = weights[0] * pixels[i, 0] + weights[1] * pixels[i, 1] + weights[2] * pixels[i, 2]


@exact_kernel
def count_high_bits(bits, begin, end):
    """(32768,) how many of `bits` (N,) int32 begin with each 15 bits after the sign; and how many have no other."""
    counts = np.zeros(1 << (31 - LOW_BITS), np.int64)
    zeros = 0
    for i in range(begin, end):
        size = bits[i] & _SIZE
        counts[size >> LOW_BITS] += 1
        zeros += size == 0
    return counts, zeros


@exact_kernel
def count_low_bits(bits, high, begin, end):
    """(65536,) how many of those of `bits` (N,) int32 that begin with `high` end with each 16 bits."""
    counts = np.zeros(1 << LOW_BITS, np.int64)
    for i in range(begin, end):
        size = bits[i] & _SIZE
        if size >> LOW_BITS == high:
            counts[size & ((1 << LOW_BITS) - 1)] += 1
    return counts


@kernel
def apply_table(pixels, weights, factors, lowest, begin, end, result):
    """Each pixel times the factor of its luminance, read between the table's nodes; no channel below `lowest`.

    factors : (2¹⁶ + 1,) float32, at the luminances whose last CELL_BITS bits are 0
    """
    share = np.float32(1.0 / (1 << CELL_BITS))
    for i in range(begin, end):
        light = weights[0] * pixels[i, 0] + weights[1] * pixels[i, 1] + weights[2] * pixels[i, 2]
        bits = np.float32(light).view(np.int32) & _SIZE
        cell = bits >> CELL_BITS
        factor = factors[cell] + (factors[cell + 1] - factors[cell]) * np.float32(bits & _CELL) * share
        for channel in range(3):
            result[i, channel] = max(pixels[i, channel] * factor, lowest)


@kernel
def apply_photographic(pixels, weights, scale, inverse_white, begin, end, result):
    """Each pixel times scale · (1 + x · inverse_white²) / (1 + x), x its luminance times `scale`."""
    for i in range(begin, end):
        light = weights[0] * pixels[i, 0] + weights[1] * pixels[i, 1] + weights[2] * pixels[i, 2]
        x = np.float64(light) * scale
        factor = np.float32(scale * (1.0 + x * inverse_white * inverse_white) / (1.0 + x))
        for channel in range(3):
            result[i, channel] = pixels[i, channel] * factor


@kernel
def see(pixels, to_xyz, cones, rods, black, colour, begin, end, result):
    """Pixels begin to end as cones and rods see them: cones · (R, G, B) + rods · scotopic luminance − black.

    pixels, result : (N, 3) float32, which may be one array
    to_xyz : (3, 3) float32
    colour : False for the same luminance in the colour that cones alone would see

    The scotopic luminance is that of `vision.scotopic_luminance`.
    """
    for i in range(begin, end):
        red, green, blue = pixels[i, 0], pixels[i, 1], pixels[i, 2]
        x = to_xyz[0, 0] * red + to_xyz[0, 1] * green + to_xyz[0, 2] * blue
        y = to_xyz[1, 0] * red + to_xyz[1, 1] * green + to_xyz[1, 2] * blue
        z = to_xyz[2, 0] * red + to_xyz[2, 1] * green + to_xyz[2, 2] * blue
        share = np.float32(0)
        if x > 0:
            share = rods * max(np.float32(1.33) * (1 + (y + z) / x) - np.float32(1.68), np.float32(0))
        if colour:
            factor, added = cones, share * y - black
        else:
            factor, added = cones + share, -black
        result[i, 0] = factor * red + added
        result[i, 1] = factor * green + added
        result[i, 2] = factor * blue + added
