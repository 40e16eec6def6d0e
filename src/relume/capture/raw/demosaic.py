"""Colours of a mosaic: linear interpolation with gradient correction (Malvar, He & Cutler 2004).

A missing colour is the mean of its nearest samples plus a share of how far the photosite's own colour bends away from
its surroundings. Three departures, for radiance of any range: the result stays within the samples of its colour in the
5 × 5 window (and three standard deviations of noise), so that bright edges do not ring; what touches a saturated
photosite is only averaged; and the channels are balanced before, because the correction takes detail to be neutral.
"""

from __future__ import annotations

import numpy as np

from relume.capture.raw.kernel import mirrored
from relume.image.bands import in_threads
from relume.image.kernel import kernel
from relume.image.radiance import SATURATED

_ROWS = 32
# Rows and columns of the 13 photosites that count: itself, four beside, four diagonal, four two away.
_TAPS = np.array(
    [(0, 0), (0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1), (0, -2), (0, 2), (-2, 0), (2, 0)]
)
# The paper's figure 2, in eighths, over those photosites.
_ITSELF = (8.0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
_GREEN = (4.0, 2, 2, 2, 2, 0, 0, 0, 0, -1, -1, -1, -1)
_ALONG_ROW = (5.0, 4, 4, 0, 0, -1, -1, -1, -1, -1, -1, 0.5, 0.5)
_ALONG_COLUMN = (5.0, 0, 0, 4, 4, -1, -1, -1, -1, 0.5, 0.5, -1, -1)
_DIAGONAL = (6.0, 0, 0, 0, 0, 2, 2, 2, 2, -1.5, -1.5, -1.5, -1.5)


def developed_mosaic(
    mosaic: np.ndarray,
    variance: np.ndarray,
    clipped: np.ndarray,
    pattern: np.ndarray,
    balance: np.ndarray,
    matrix: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radiance (H, W, 3) in Rec. 709, its variance and the clipped mask (H, W), of a merged mosaic (H, W).

    variance : (H, W); (1, 1) of zeros where the mosaic is exact
    clipped : (H, W) uint8, the mask of the photosites
    balance : (3,) multiplies the channels before anything else
    matrix : (3, 3) balanced camera colours → Rec. 709

    The variance is that of the weighted sum of photosites which an output channel is, their common ones counted once;
    neighbouring pixels are not independent. A pixel is clipped where a nearest sample of one of its channels is; its
    variance is infinite, and no channel exceeds the lowest of its saturated ones, so that light which saturates them
    all comes out neutral at a level that each of them surely reached, not pink.
    """
    height, width = mosaic.shape
    mosaic = np.ascontiguousarray(mosaic, np.float32)
    exact = variance.shape != mosaic.shape
    colours = np.empty((height, width, 3), np.float32)
    spread = np.zeros((1, 1, 3) if exact else (height, width, 3), np.float32)
    mask = np.zeros((height, width), np.uint8)
    kernels, nearest, channels, shares = _tables(np.asarray(pattern), np.asarray(balance, float), matrix)
    rows, columns = mirrored(height), mirrored(width)
    in_threads(
        lambda begin, end: _develop(
            mosaic, variance, clipped, kernels, nearest, channels, shares, np.asarray(balance, float),
            np.ascontiguousarray(matrix, float), rows, columns, _TAPS, exact, colours, spread, mask, begin, end,
        ),
        height,
        chunk=_ROWS,
    )  # fmt: skip
    return colours, spread, mask


def _tables(
    pattern: np.ndarray, balance: np.ndarray, matrix: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For each of the four sites: (4, 3, 13) the filters of its channels, (4, 3, 13) the means they correct,
    (4, 13) the photosites' channels, and (4, 3, 13) the shares, squared, of photosites in the output channels."""
    kernels, channels = np.empty((4, 3, 13)), np.empty((4, 13), np.int64)
    for site in range(4):
        y, x = divmod(site, 2)
        channels[site] = [pattern[(y + dy) % 2, (x + dx) % 2] for dy, dx in _TAPS]
        own, beside = pattern[y, x], pattern[y, 1 - x]
        for channel in range(3):
            if channel == own:
                kernels[site, channel] = _ITSELF
            elif channel == 1:
                kernels[site, channel] = _GREEN
            elif own == 1:
                kernels[site, channel] = _ALONG_ROW if channel == beside else _ALONG_COLUMN
            else:
                kernels[site, channel] = _DIAGONAL
    kernels /= 8
    nearest = np.where(channels[:, None, :] == np.arange(3)[:, None], np.maximum(kernels, 0), 0.0)
    nearest[..., 9:] = 0
    nearest /= nearest.sum(-1, keepdims=True)
    shares = (np.einsum("oc,sct->sot", matrix, kernels) * balance[channels][:, None, :]) ** 2
    return kernels, nearest, channels, shares


@kernel
def _develop(
    mosaic, variance, clipped, kernels, nearest, channels, shares, balance, matrix, rows, columns, taps, exact,
    colours, spread, mask, begin, end,
):  # fmt: skip
    values, variances, camera = np.empty(13), np.zeros(13), np.empty(3)
    lowest, highest, limited = np.empty(3), np.empty(3), np.empty(3)
    for y in range(begin, end):
        for x in range(mosaic.shape[1]):
            site = 2 * (y & 1) + (x & 1)
            saturated = False
            for t in range(13):
                i, j = rows[y + 2 + taps[t, 0]], columns[x + 2 + taps[t, 1]]
                values[t] = mosaic[i, j] * balance[channels[site, t]]
                saturated |= clipped[i, j] != 0
                if not exact:
                    variances[t] = variance[i, j] * balance[channels[site, t]] ** 2
            if saturated:
                limit, flag = np.inf, 0
                for c in range(3):
                    mean, worst = 0.0, 0
                    for t in range(9):
                        if nearest[site, c, t] > 0:
                            mean += nearest[site, c, t] * values[t]
                            state = clipped[rows[y + 2 + taps[t, 0]], columns[x + 2 + taps[t, 1]]]
                            # Saturated goes before black: a pixel that is both is bounded from below alone.
                            if state != 0 and (worst == 0 or state < worst):
                                worst = state
                    limited[c] = mean
                    if worst == SATURATED:
                        limit = min(limit, mean)
                    if worst != 0 and (flag == 0 or worst < flag):
                        flag = worst
                mask[y, x] = flag
                if flag != 0:
                    for o in range(3):
                        colour = 0.0
                        for c in range(3):
                            colour += matrix[o, c] * min(limited[c], limit)
                        colours[y, x, o] = colour
                        if not exact:
                            spread[y, x, o] = np.inf
                    continue
            # The samples of each colour in the window bound what may come of the correction.
            lowest[:] = np.inf
            highest[:] = -np.inf
            for dy in range(5):
                for dx in range(5):
                    c = channels[(2 * ((y + dy) & 1) + ((x + dx) & 1)), 0]
                    value = mosaic[rows[y + dy], columns[x + dx]] * balance[c]
                    lowest[c] = min(lowest[c], value)
                    highest[c] = max(highest[c], value)
            for c in range(3):
                mean, corrected, uncertain = 0.0, 0.0, 0.0
                for t in range(13):
                    mean += nearest[site, c, t] * values[t]
                    corrected += kernels[site, c, t] * values[t]
                    uncertain += kernels[site, c, t] ** 2 * variances[t]
                if saturated:
                    camera[c] = mean
                else:
                    tolerance = 3 * np.sqrt(uncertain)
                    camera[c] = min(max(corrected, lowest[c] - tolerance), highest[c] + tolerance)
            for o in range(3):
                colour = 0.0
                for c in range(3):
                    colour += matrix[o, c] * camera[c]
                colours[y, x, o] = colour
                if not exact:
                    total = 0.0
                    for t in range(13):
                        share = shares[site, o, t]
                        if saturated:  # only averaged: what is saturated has no share, and an infinite variance
                            share = 0.0
                            for c in range(3):
                                share += matrix[o, c] * nearest[site, c, t]
                            share *= share * balance[channels[site, t]] ** 2
                        if share > 0:
                            total += share * variance[rows[y + 2 + taps[t, 0]], columns[x + 2 + taps[t, 1]]]
                    spread[y, x, o] = total
