"""The loops that make a frame smaller: by whole factors at first, then by halves.

Arrays are read at unsigned places: Numba asks of every signed one whether it counts from the end, which no vector can.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, kernel


@kernel
def _reduce(pixels, width, factor, low, high, scale, begin, end, sums, values, valid):
    """Rows begin…end of the green channel's mean over factor × factor pixels; valid where none of them is clipped.

    pixels : (H·3·width,), row by row
    sums : empty, of a type that holds the sum of `factor` values: the narrower, the more fit a vector
    """
    columns, length = values.shape[1], 3 * factor * values.shape[1]
    total = np.empty(length, sums.dtype)
    least, most = np.empty(length, pixels.dtype), np.empty(length, pixels.dtype)
    mean, low_of, high_of = np.empty(columns), np.empty(columns, pixels.dtype), np.empty(columns, pixels.dtype)
    share = scale / (factor * factor)
    for y in range(begin, end):
        # Down the columns, all channels side by side.
        at = np.uint64(3 * width * factor * y)
        for k in range(length):
            total[k] = pixels[at + np.uint64(k)]
        for k in range(length):
            value = pixels[at + np.uint64(k)]
            least[k], most[k] = value, value
        for row in range(factor * y + 1, factor * (y + 1)):
            at = np.uint64(3 * width * row)
            for k in range(length):
                total[k] += pixels[at + np.uint64(k)]
            for k in range(length):
                value = pixels[at + np.uint64(k)]
                least[k], most[k] = min(least[k], value), max(most[k], value)
        # Along the row, green alone.
        for column in range(factor):
            green = np.uint64(3 * column + 1)
            for x in range(columns):
                k = np.uint64(x) * np.uint64(3 * factor) + green
                mean[x] = total[k] if column == 0 else mean[x] + total[k]
                low_of[x] = least[k] if column == 0 else min(low_of[x], least[k])
                high_of[x] = most[k] if column == 0 else max(high_of[x], most[k])
        for x in range(columns):
            values[y, x] = mean[x] * share
            valid[y, x] = (low_of[x] > low) & (high_of[x] < high)


@exact_kernel
def _halve(values, valid, inside, half, half_valid, half_inside):
    """Means of 2×2 pixels; valid where three of the four are, inside where all are."""
    rows, columns = half.shape
    width = np.uint64(values.shape[1])
    flat, flat_valid, flat_inside = values.reshape(-1), valid.reshape(-1), inside.reshape(-1)
    for y in range(rows):
        at = np.uint64(2 * y) * width
        for x in range(columns):
            a = at + np.uint64(2 * x)
            b, c, d = a + np.uint64(1), a + width, a + width + np.uint64(1)
            half[y, x] = (flat[a] + flat[b] + flat[c] + flat[d]) * np.float32(0.25)
            half_valid[y, x] = np.uint8(flat_valid[a] + flat_valid[b] + flat_valid[c] + flat_valid[d]) >= 3
            half_inside[y, x] = flat_inside[a] & flat_inside[b] & flat_inside[c] & flat_inside[d]
