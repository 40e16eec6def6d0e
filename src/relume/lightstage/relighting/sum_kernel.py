"""Weighted sums of many pictures: the one loop behind relighting.

A picture is a row of interleaved values (red, green, blue, red, …). A total takes its lights strictly in their order,
in float64, one product and one addition each: no block size, no number of threads and no instruction set changes a bit.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numba.extending import overload

from relume.image.bands import in_threads
from relume.image.kernel import exact_kernel, exact_small, fuses, kernel
from relume.sphere.vector_steps import BYTES_AT_ONCE, add_four_lights

_RUN = 768
"""Values that one inner loop passes: whole pixels, and long enough to make up for starting it."""
_CHUNK = 64 * _RUN
"""Values of one call: their totals stay in a core's own cache while all lights pass."""
_LARGE = 2.0**970
"""A weight from which on 2⁵² times it may be no number."""


def add_weighted(values: np.ndarray, weights: np.ndarray, totals: np.ndarray, threads: int | None = None) -> None:
    """Add Σ_i weights[i, k] · values[i] to totals[k], in place.

    values : (n, P) uint8, float32 or float16, P a multiple of 3; rows without gaps
    weights : (n, K, 3) float64, one number a channel
    totals : (K, P) float64
    """
    seen = values.view(np.uint16) if values.dtype == np.float16 else values
    of_bytes = values.dtype == np.uint8 and fuses() and np.abs(weights).max(initial=0) < _LARGE
    fours = len(values) // 4 * 4 if of_bytes else 0

    def work(begin: int, end: int) -> None:
        stop = begin + (end - begin) // BYTES_AT_ONCE * BYTES_AT_ONCE if fours else begin
        if fours:
            _add_bytes(seen[:fours], weights, totals, begin, stop)
            _add(seen[:fours], weights, totals, stop, end)
        _add(seen[fours:], weights[fours:], totals, begin, end)

    in_threads(work, values.shape[1], threads, chunk=_CHUNK)


def add_labelled(values: np.ndarray, weights: np.ndarray, labels: np.ndarray, totals: np.ndarray) -> None:
    """Add Σ_i weights[i, labels[p], c] · values[i, p, c] to totals[p, c], in place.

    values : (n, pixels, 3) float32
    weights : (n, K, 3) float64
    labels : (pixels,) integers below K
    totals : (pixels, 3) float64
    """
    in_threads(lambda begin, end: _add_labelled(values, weights, labels, totals, begin, end), len(labels))


def blended(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Σ_i weights[i, k % 3] · values[i, k] in single precision: (P,) float32, for pictures that are near ones anyway.

    values : (n, P) float16 or float32, P a multiple of 3; finite; rows without gaps
    weights : (n, 3)
    """
    halves = values.dtype == np.float16
    seen = values.view(np.uint16) if halves else values
    # Beside 2¹¹², which halves' exponents lack (`_single`), the largest weight is 1.
    largest = float(np.abs(weights).max(initial=0)) or 1.0
    factors = np.ascontiguousarray(weights / largest * (2.0**112 if halves else 1.0), np.float32)
    picture = np.zeros(values.shape[1], np.float32)
    in_threads(lambda begin, end: _blend(seen, factors, picture, begin, end), values.shape[1], chunk=_CHUNK)
    picture *= np.float32(largest)
    return picture


@exact_small
def _half(bits):
    """The number that 16 bits hold as half a float: the exponent moved by 112; infinity and NaN are kept."""
    magnitude = np.uint32(bits & np.uint16(0x7FFF)) << np.uint32(13)
    finite = np.uint32(magnitude).view(np.float32) * np.float32(2.0**112)
    endless = np.uint32(magnitude | np.uint32(0x7F800000)).view(np.float32)
    value = finite if magnitude < np.uint32(0x0F800000) else endless
    return np.float64(-value if bits & np.uint16(0x8000) else value)


def _number(value):
    """What a stored value stands for: 16 bits are half a float, all else is the number it is."""


@overload(_number)
def _number_of(value):
    # One kernel for all kinds: Numba keeps none on disk that a function made.
    if value == types.uint16:
        return lambda value: _half(value)
    return lambda value: np.float64(value)


@exact_kernel
def _add(values, weights, totals, begin, end):
    """Four lights pass at once, so that a total is touched once for four."""
    count, kinds = values.shape[0], weights.shape[1]
    fours = count - count % 4
    laid_out = np.empty((4, _RUN))  # the weights of four lights, as the values lie
    for first in range(0, fours, 4):
        for kind in range(kinds):
            for light in range(4):
                for k in range(0, _RUN, 3):
                    for channel in range(3):
                        laid_out[light, k + channel] = weights[first + light, kind, channel]
            w0, w1, w2, w3 = laid_out[0], laid_out[1], laid_out[2], laid_out[3]
            for start in range(begin, end, _RUN):
                stop = min(start + _RUN, end)
                total = totals[kind, start:stop]
                v0, v1 = values[first, start:stop], values[first + 1, start:stop]
                v2, v3 = values[first + 2, start:stop], values[first + 3, start:stop]
                for k in range(stop - start):
                    so_far = total[k] + _number(v0[k]) * w0[k]
                    so_far += _number(v1[k]) * w1[k]
                    so_far += _number(v2[k]) * w2[k]
                    total[k] = so_far + _number(v3[k]) * w3[k]
    for light in range(fours, count):
        for kind in range(kinds):
            for at in range(begin, end):
                totals[kind, at] += _number(values[light, at]) * weights[light, kind, (at - begin) % 3]


def _single(value):
    """`_number` in single precision, of finite values; of 16 bits 2⁻¹¹² times that."""


@overload(_single)
def _single_of(value):
    if value == types.uint16:
        # Sign, exponent and digits where float32 has them. Were the factor here, sums would be multiplied by it, and
        # lose digits before.
        return lambda value: np.int32((np.int32(np.int16(value)) << np.int32(13)) & np.int32(-0x70002000)).view(
            np.float32
        )
    return lambda value: np.float32(value)


@kernel
def _blend(values, weights, picture, begin, end):
    """Eight values pass at once, so that a total is touched once for eight."""
    laid_out = np.zeros((8, _RUN), np.float32)
    for first in range(0, values.shape[0], 8):
        # Past the last one the first again, by nothing.
        count = min(8, values.shape[0] - first)
        for i in range(8):
            for k in range(0, _RUN, 3):
                for channel in range(3):
                    laid_out[i, k + channel] = weights[first + i, channel] if i < count else np.float32(0)
        a, b, c, d = laid_out[0], laid_out[1], laid_out[2], laid_out[3]
        e, f, g, h = laid_out[4], laid_out[5], laid_out[6], laid_out[7]
        last = values.shape[0] - 1
        for start in range(begin, end, _RUN):
            stop = min(start + _RUN, end)
            total = picture[start:stop]
            p, q = values[first, start:stop], values[min(first + 1, last), start:stop]
            r, s = values[min(first + 2, last), start:stop], values[min(first + 3, last), start:stop]
            t, u = values[min(first + 4, last), start:stop], values[min(first + 5, last), start:stop]
            v, w = values[min(first + 6, last), start:stop], values[min(first + 7, last), start:stop]
            for k in range(stop - start):
                total[k] += (
                    (_single(p[k]) * a[k] + _single(q[k]) * b[k]) + (_single(r[k]) * c[k] + _single(s[k]) * d[k])
                ) + ((_single(t[k]) * e[k] + _single(u[k]) * f[k]) + (_single(v[k]) * g[k] + _single(w[k]) * h[k]))


@kernel
def add_points(picture, pixels, lights, values, weights):
    """Add values (M, 3) at pixels, times the weights (N, 3) of their lights, to a picture (P, 3)."""
    for i in range(len(pixels)):
        for channel in range(3):
            picture[pixels[i], channel] += values[i, channel] * weights[lights[i], channel]


@exact_kernel
def _add_bytes(values, weights, totals, begin, end):
    """`_add` of bytes, for lights by fours and values by `BYTES_AT_ONCE`: the same bits, near what memory gives."""
    factors = np.empty((4, 2, BYTES_AT_ONCE))
    for first in range(0, values.shape[0], 4):
        for kind in range(weights.shape[1]):
            for light in range(4):
                for k in range(BYTES_AT_ONCE):
                    weight = weights[first + light, kind, k % 3]
                    factors[light, 0, k], factors[light, 1, k] = weight, weight * -(2.0**52)
            place, start = totals[kind, begin:], values[first, begin:]
            add_four_lights(
                place.ctypes.data,
                start.ctypes.data,
                values.shape[1],
                factors.ctypes.data,
                (end - begin) // BYTES_AT_ONCE,
            )


@exact_kernel
def _add_labelled(values, weights, labels, totals, begin, end):
    for light in range(values.shape[0]):
        for pixel in range(begin, end):
            label = labels[pixel]
            for channel in range(3):
                totals[pixel, channel] += np.float64(values[light, pixel, channel]) * weights[light, label, channel]


def summed_tiles(
    starts: np.ndarray, kinds: np.ndarray, digits: np.ndarray, weights: np.ndarray, picture: np.ndarray
) -> None:
    """Write into each tile of the picture the sum of its entries, weighted by their kind.

    starts : (tiles + 1,) int64, where the entries of a tile begin
    kinds : (entries,) int32
    digits : (entries, 3, 64) int8, a tile's values channel by channel
    weights : (kinds, 3) float32
    picture : (H, W, 3) float32; H and W are multiples of 8
    """
    in_threads(
        lambda begin, end: _sum_tiles(starts, kinds, digits, weights, picture, begin, end), len(starts) - 1, chunk=256
    )


@kernel
def _sum_tiles(starts, kinds, digits, weights, picture, begin, end):
    across = picture.shape[1] // 8
    totals = np.empty((3, 64), np.float32)
    for tile in range(begin, end):
        totals[:] = 0
        first, stop = starts[tile], starts[tile + 1]
        fours = stop - (stop - first) % 4
        for entry in range(first, fours, 4):  # four at once, so that a total is touched once for four
            a, b, c, d = kinds[entry], kinds[entry + 1], kinds[entry + 2], kinds[entry + 3]
            for channel in range(3):
                total = totals[channel]
                p, q = digits[entry, channel], digits[entry + 1, channel]
                r, s = digits[entry + 2, channel], digits[entry + 3, channel]
                wp, wq, wr, ws = weights[a, channel], weights[b, channel], weights[c, channel], weights[d, channel]
                for k in range(64):
                    total[k] += (np.float32(p[k]) * wp + np.float32(q[k]) * wq) + (
                        np.float32(r[k]) * wr + np.float32(s[k]) * ws
                    )
        for entry in range(fours, stop):
            for channel in range(3):
                for k in range(64):
                    totals[channel, k] += np.float32(digits[entry, channel, k]) * weights[kinds[entry], channel]
        top, left = tile // across * 8, tile % across * 8
        for k in range(64):
            for channel in range(3):
                picture[top + k // 8, left + k % 8, channel] = totals[channel, k]
