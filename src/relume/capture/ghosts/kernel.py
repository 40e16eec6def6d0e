"""What the small squares of photographs say about the radiance there: from where to where it may be, and who agrees.

Squares, not pixels, are compared: the mean of many values is less noisy than one, and a shift of the camera by part of
a pixel changes it less.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import kernel
from relume.image.photograph import Photograph

_ROWS = 16
"""Rows of squares measured by one call."""


def square_bounds(
    photographs: Sequence[Photograph],
    exposures: np.ndarray,
    noise: np.ndarray,
    ends: np.ndarray,
    log_times: np.ndarray,
    *,
    side: int,
    shift: float,
    crosstalk: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each photograph says of each square of `side` × `side` pixels: bounds of its radiance, and its middle.

    exposures, noise : (3, levels) float32, sensor exposure of each pixel value, and deviation of a square's ln exposure
    ends : (3, 2), the values at or below which a pixel is black, and from which on it is white
    log_times : (P,) ln of the photographs' exposures per unit of radiance
    shift : pixels by which photographs may still be out of register
    crosstalk : share of one channel's exposure that may be in another's

    Returns the least and greatest ln radiance (P, 2, h, w, 3) float32, ±∞ on the side where a black or white pixel
    says nothing; the mean pixel value (P, h, w, 3); and (P, h, w) bool, whether no pixel is black or white in any
    channel, or outside the picture.
    """
    width, height = photographs[0].size
    shape = (-(-height // side), -(-width // side))
    bounds = np.empty((len(photographs), 2, *shape, 3), np.float32)
    middle = np.empty((len(photographs), *shape, 3), photographs[0].pixels.dtype)
    measured = np.empty((len(photographs), *shape), bool)
    top = np.take_along_axis(exposures, ends[:, 1:], 1)
    table = np.where(np.arange(exposures.shape[1]) <= ends[:, :1], np.float32(0), np.minimum(exposures, top))
    share = min(shift / side, 1.0)
    for photograph, log_time, *written in zip(photographs, log_times, bounds, middle, measured, strict=True):
        outside = np.zeros((0, 0), bool) if photograph.outside is None else photograph.outside
        frame = (photograph.pixels, outside, table, exposures, noise, ends, float(log_time), side, share, crosstalk)
        in_threads(partial(_bound, *frame, *written), shape[0], chunk=_ROWS)
    return bounds, middle, measured


def disagreement(bounds: np.ndarray, middle: np.ndarray, corrections: np.ndarray) -> np.ndarray:
    """How far apart, in ln radiance, the photographs are that differ most: (h, w) float32, negative where all agree.

    bounds : (P, 2, h, w, 3), changed: `corrections` (P, 2, 3, levels) of the mean values `middle` are added
    """
    height, width = middle.shape[1:3]
    apart = np.empty((height, width), np.float32)
    in_threads(lambda a, b: _compare(bounds, middle, corrections, a, b, apart), height, chunk=_ROWS)
    return apart


@kernel
def consensus(bounds, order, agree, unsure):
    """Which photographs agree with a source: bounds (P, 2, N, 3), order (P) with the source first → agree (P, N) bool.

    Each in turn joins if its bounds overlap with what those before have in common. Intervals that overlap pairwise
    have a point in common (Helly), so all that have joined agree with each other. `unsure` (N) bool is written too:
    whether some photograph agrees with the source, but not with the others that do. Then the largest party counts:
    who passes through a clipped background passes in one frame, and the background stands in all others.
    """
    count = order.shape[0]
    joined = np.empty(count, np.bool_)
    for n in range(bounds.shape[2]):
        unsure[n], largest = False, 0
        for second in range(1, max(count, 2)):
            low0, low1, low2 = -np.inf, -np.inf, -np.inf
            up0, up1, up2 = np.inf, np.inf, np.inf
            members = 0
            for k in range(count):
                # The source first, then the second, then the others in their order.
                place = k if k == 0 or k > second else (second if k == 1 else k - 1)
                p = order[place]
                a0, b0 = max(low0, bounds[p, 0, n, 0]), min(up0, bounds[p, 1, n, 0])
                a1, b1 = max(low1, bounds[p, 0, n, 1]), min(up1, bounds[p, 1, n, 1])
                a2, b2 = max(low2, bounds[p, 0, n, 2]), min(up2, bounds[p, 1, n, 2])
                joined[p] = a0 <= b0 and a1 <= b1 and a2 <= b2
                if joined[p]:
                    low0, low1, low2, up0, up1, up2 = a0, a1, a2, b0, b1, b2
                    members += 1
            if members > largest:
                largest = members
                for p in range(count):
                    agree[p, n] = joined[p]
            if second == 1:
                s = order[0]
                for p in range(count):
                    overlaps = not joined[p]
                    for c in range(3):
                        overlaps &= (
                            bounds[p, 0, n, c] <= bounds[s, 1, n, c] and bounds[s, 0, n, c] <= bounds[p, 1, n, c]
                        )
                    unsure[n] |= overlaps
                if not unsure[n]:
                    break


@kernel
def _bound(
    pixels, outside, table, exposures, noise, ends, log_time, side, share, crosstalk, bounds, middle, measured,
    begin, end,
):  # fmt: skip
    height, width, top = pixels.shape[0], pixels.shape[1], table.shape[1] - 1
    mean, least, greatest, value = np.empty(3), np.empty(3, np.intp), np.empty(3, np.intp), np.empty(3, np.intp)
    darkest, lightest = np.empty(3, np.intp), np.empty(3, np.intp)
    for i in range(begin, end):
        y0, y1 = i * side, min((i + 1) * side, height)
        above, below = max(y0 - 1, 0), min(y1, height - 1)
        for j in range(middle.shape[1]):
            x0, x1 = j * side, min((j + 1) * side, width)
            before, after = max(x0 - 1, 0), min(x1, width - 1)
            lost = False
            if outside.shape[0] > 0:
                for y in range(above, below + 1):
                    for x in range(before, after + 1):
                        lost |= outside[y, x]
            whole, white, brightest = not lost, False, 0.0
            for c in range(3):
                total, values, low, high = np.float32(0), 0, top, 0
                for y in range(y0, y1):
                    for x in range(x0, x1):
                        z = int(pixels[y, x, c])
                        total += table[c, z]
                        values += z
                        low, high = min(low, z), max(high, z)
                mean[c], value[c] = total / ((y1 - y0) * (x1 - x0)), values // ((y1 - y0) * (x1 - x0))
                least[c], greatest[c] = low, high
                for x in range(before, after + 1):
                    z, w = int(pixels[above, x, c]), int(pixels[below, x, c])
                    low, high = min(low, z, w), max(high, z, w)
                for y in range(y0, y1):
                    z, w = int(pixels[y, before, c]), int(pixels[y, after, c])
                    low, high = min(low, z, w), max(high, z, w)
                darkest[c], lightest[c] = low, high
                whole &= least[c] > ends[c, 0] and greatest[c] < ends[c, 1]
                white |= greatest[c] >= ends[c, 1]
                brightest = max(brightest, table[c, high])
                middle[i, j, c] = value[c]
            measured[i, j] = whole
            for c in range(3):
                black, full = int(ends[c, 0]), int(ends[c, 1])
                floor = exposures[c, black]
                level = max(mean[c], floor)
                mixed = crosstalk * (3 if white else 1) * (max(brightest, level) / level - 1)
                slack = noise[c, min(max(value[c], black), full)] + mixed
                # A shift by part of a pixel swaps at most that share of the square for what lies around it.
                loss = share * (table[c, greatest[c]] - table[c, darkest[c]])
                gain = share * (table[c, lightest[c]] - table[c, least[c]])
                # Some black pixels hide little in a square that is bright; noise lifts a few in one that is black.
                nothing = lost or (least[c] <= black and (greatest[c] >= top or value[c] < 3 * black))
                if nothing or mean[c] <= loss:
                    bounds[0, i, j, c] = -np.inf
                else:
                    bounds[0, i, j, c] = np.log(mean[c] - loss) - log_time - slack
                # Beside a white channel a JPEG, whose colours are coarse, leaves the others short of their own white.
                if lost or greatest[c] >= full - (full // 40 if white else 0):
                    bounds[1, i, j, c] = np.inf
                else:
                    hidden = floor if least[c] <= black else np.float32(0)
                    bounds[1, i, j, c] = np.log(mean[c] + gain + hidden) - log_time + slack


@kernel
def _compare(bounds, middle, corrections, begin, end, apart):
    count = bounds.shape[0]
    for i in range(begin, end):
        for j in range(apart.shape[1]):
            worst = np.float32(-np.inf)
            for c in range(3):
                highest, lowest = np.float32(-np.inf), np.float32(np.inf)
                for p in range(count):
                    value = middle[p, i, j, c]
                    low = bounds[p, 0, i, j, c] + corrections[p, 0, c, value]
                    up = bounds[p, 1, i, j, c] + corrections[p, 1, c, value]
                    bounds[p, 0, i, j, c], bounds[p, 1, i, j, c] = low, up
                    highest, lowest = max(highest, low), min(lowest, up)
                worst = max(worst, highest - lowest)
            apart[i, j] = worst
