"""The loop of the merge: one pass over a stretch of pixels of all photographs (its slow twin is in the tests).

Where weights belong to the values that other photographs predict, two kinds of values are not weighed by themselves:
those near white are judged by the shorter exposures, and pixels that are dark in the longest exposure by all the others
and by the pixels beside. What is rare is left by the tight loop for a second one, which costs it nothing.
"""

from __future__ import annotations

import math

import numpy as np

from relume.image.kernel import exact_kernel
from relume.image.radiance import BLACK, OUTSIDE, SATURATED

STEPS = 512
"""Entries of the tables of predicted exposures."""
BESIDE = 2
"""Pixels on either side in a row that help to predict a dark one."""
APART = 2.0
"""Deviations by which the shorter exposures must say more light than a value near white before it is doubted."""


@exact_kernel
def merge_stretch(
    values: np.ndarray,
    outside: np.ndarray,
    tables: np.ndarray,
    curve: np.ndarray,
    limits: np.ndarray,
    bright: np.ndarray,
    log_times: np.ndarray,
    logarithm: np.ndarray,
    variance: np.ndarray,
) -> int:
    """Eq. 6 for every pixel of a stretch, with the variance it leaves; how many channel values are left for `finish`.

    values : (P, N, 3) unsigned, photographs from the least to the most exposed
    outside : (P, N) bool, or (0, 0) where every pixel of every photograph is part of its picture
    tables : (3, levels, 3) float64: w g, w, w² var(ln E) of every value
    curve : (3, levels) float64: g of every value
    limits : (3, 3) int64: the value from which on a value may be white, the one below which a pixel's longest exposure
        is dark, and the greatest that is black
    bright : (3, 2 + 2 STEPS) float64: the least predicted ln exposure of the table and steps per unit of it; then w and
        w² var(ln E) at each step, white beyond the last
    log_times : (P,) ln of the exposures
    logarithm : (N, 3) float64, written: ln of the radiance
    variance : (N, 3) float32, written: of ln radiance; negative where no photograph measured, or only in the dark
    """
    photographs, count, _ = values.shape
    masked = outside.shape[0] > 0
    left = 0
    # Once and not for every value: a division takes as long as three photographs.
    whites = bright[:, 0] + STEPS / bright[:, 1]
    for i in range(count):
        for c in range(3):
            near, white = limits[c, 0], whites[c]
            # Sums of eq. 6 over the photographs.
            weighted, total, spread = 0.0, 0.0, 0.0
            longest = near
            for p in range(photographs):
                if masked and outside[p, i]:
                    continue
                z = values[p, i, c]
                longest = z
                if z >= near:
                    # White in one, alone or as the shorter ones predict, is white in every longer exposure, whatever
                    # its value.
                    if tables[c, z, 1] == 0 and weighted + log_times[p] * total >= white * total:
                        break
                    if total > 0:
                        # A value that the shorter exposures bear out is believed; else what they predict is weighed.
                        predicted, own = weighted / total, curve[c, z] - log_times[p]
                        if predicted - own > APART * math.sqrt(spread) / total:
                            step = (predicted + log_times[p] - bright[c, 0]) * bright[c, 1]
                            if step >= STEPS:
                                break
                            if step >= 0:
                                weight = bright[c, 2 + int(step)]
                                weighted += weight * own
                                total += weight
                                spread += bright[c, 2 + STEPS + int(step)]
                                continue
                weight = tables[c, z, 1]
                weighted += tables[c, z, 0] - weight * log_times[p]
                total += weight
                spread += tables[c, z, 2]
            # Measured: the weighted mean and its variance.
            if total > 0 and longest >= limits[c, 1]:
                logarithm[i, c] = weighted / total
                variance[i, c] = spread / (total * total)
            else:
                variance[i, c] = -1.0
                left += 1
    return left


@exact_kernel
def finish(
    values: np.ndarray,
    outside: np.ndarray,
    edges: np.ndarray,
    edges_outside: np.ndarray,
    place: tuple[int, int],
    bounds: np.ndarray,
    tables: np.ndarray,
    curve: np.ndarray,
    limits: np.ndarray,
    dark: np.ndarray,
    log_times: np.ndarray,
    logarithm: np.ndarray,
    variance: np.ndarray,
    clipped: np.ndarray,
) -> int:
    """What `merge_stretch` left, of negative `variance`: dark pixels, and bounds; how many stay unmeasured.

    values, outside, tables, curve, limits, log_times, logarithm : as there
    edges, edges_outside : (P, 2 BESIDE, 3), (P, 2 BESIDE) the same of the pixels before the stretch and after it
    place : of the stretch's first pixel in the picture, and the picture's width
    bounds : (3, levels) float64, the least ln exposure of a white value, the greatest of a black one
    dark : (3, 1 + 2 STEPS) float64: 1 / the exposure at the table's end; then w and w² var(E Δt) at each step of the
        root of predicted exposure
    variance : (N, 3) float32, written: of ln radiance; infinite where no photograph measured
    clipped : (N,) uint8, written where something was left: the marks of `RadianceMap.clipped`
    """
    photographs, count, _ = values.shape
    white = tables.shape[1] // 2
    masked = outside.shape[0] > 0
    unmeasured = 0
    for i in range(count):
        flag = 0
        for c in range(3):
            if variance[i, c] >= 0:
                continue
            # The longest exposure that shows the pixel.
            last = photographs - 1
            while masked and last >= 0 and outside[last, i]:
                last -= 1
            if last < 0:
                logarithm[i, c], variance[i, c] = -math.inf, math.inf
                unmeasured += 1
                flag = OUTSIDE
                continue
            # Dark, or beside a hot pixel's frame, it may be measured still.
            if values[last, i, c] < limits[c, 1]:
                mean, relative, total = _dark(
                    values, outside, edges, edges_outside, i, c, place, curve, limits[c, 2], dark, log_times
                )
            else:
                mean, relative, total = _after_hot(values, outside, i, c, limits[c, 0], bounds, tables, log_times)
            if total > 0:
                logarithm[i, c], variance[i, c] = mean, relative
                continue
            # The shortest exposure that shows white sets a lower bound, else the longest sets an upper one.
            unmeasured += 1
            variance[i, c] = math.inf
            for p in range(photographs):
                if masked and outside[p, i]:
                    continue
                last = p
                if values[p, i, c] > white:
                    break
            z = values[last, i, c]
            logarithm[i, c] = bounds[c, z] - log_times[last]
            if z > white:
                flag = SATURATED
            elif flag == 0:
                flag = BLACK
        clipped[i] = flag
    return unmeasured


@exact_kernel
def _after_hot(values, outside, i, c, near, bounds, tables, log_times):
    """Eq. 6 without frames that alone are white: longer ones are not, and shorter ones blacker than they could be."""
    masked = outside.shape[0] > 0
    weighted, total, spread = 0.0, 0.0, 0.0
    for p in range(values.shape[0]):
        if masked and outside[p, i]:
            continue
        z = values[p, i, c]
        weight = tables[c, z, 1]
        if z >= near and weight == 0 and total == 0:
            if _odd(values, outside, i, c, p, near, bounds, log_times):
                continue
            break
        weighted += tables[c, z, 0] - weight * log_times[p]
        total += weight
        spread += tables[c, z, 2]
    if total == 0:
        return 0.0, 0.0, 0.0
    return weighted / total, spread / (total * total), total


@exact_kernel
def _odd(values, outside, i, c, white, near, bounds, log_times):
    """Whether a frame alone is white: a longer one is not, and a shorter one is blacker than it could then be."""
    masked, dimmer = outside.shape[0] > 0, False
    for p in range(white + 1, values.shape[0]):
        if not (masked and outside[p, i]):
            dimmer |= values[p, i, c] < near
    if not dimmer:
        return False
    least = bounds[c, values[white, i, c]] - log_times[white]
    for p in range(white):
        if not (masked and outside[p, i]) and bounds[c, values[p, i, c]] - log_times[p] < least:
            return True
    return False


@exact_kernel
def _dark(values, outside, edges, edges_outside, i, c, place, curve, black, dark, log_times):
    """A dark pixel: the mean of exposures, each weighed by what the others and the pixels beside say; as for eq. 6.

    The mean is that of exposure and not of its logarithm, whose noise is lopsided in the dark.
    """
    photographs, count, masked = values.shape[0], values.shape[1], outside.shape[0] > 0
    column = (place[0] + i) % place[1]
    first, end = i - min(BESIDE, column), i + min(BESIDE, place[1] - 1 - column) + 1
    # Light and time of the pixel itself, and of those on its left and on its right.
    light, time, light_left, time_left, light_right, time_right = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(photographs):
        seconds = math.exp(log_times[p])
        for j in range(first, end):
            if 0 <= j < count:
                z, lost = values[p, j, c], masked and outside[p, j]
            else:
                k = BESIDE + j if j < 0 else BESIDE + j - count
                z, lost = edges[p, k, c], masked and edges_outside[p, k]
            if lost:
                continue
            # A black value says nothing but that there is little.
            shown = math.exp(curve[c, z]) if z > black else 0.0
            if j == i:
                light += shown
                time += seconds
            elif j < i:
                light_left += shown
                time_left += seconds
            else:
                light_right += shown
                time_right += seconds
    weighted, total, spread = 0.0, 0.0, 0.0
    for p in range(photographs):
        if masked and outside[p, i]:
            continue
        z = values[p, i, c]
        seconds, own = math.exp(log_times[p]), math.exp(curve[c, z])
        # The darker of both sides: at an edge one of them is another thing. A single value has nothing but itself.
        rest, since = light - (own if z > black else 0.0), time - seconds
        predicted = own
        if time_left > 0 or since > 1e-6 * seconds:
            predicted = (rest + light_left) / (since + time_left) * seconds
        if time_right > 0:
            beside = (rest + light_right) / (since + time_right) * seconds
            predicted = min(predicted, beside) if time_left > 0 else beside
        k = min(int(math.sqrt(max(predicted, 0.0) * dark[c, 0]) * STEPS), STEPS - 1)
        weight = dark[c, 1 + k] * seconds
        weighted += weight * own
        total += weight * seconds
        spread += dark[c, 1 + STEPS + k] * seconds * seconds
    if total == 0 or weighted == 0:
        return 0.0, 0.0, 0.0
    # ln E and its variance.
    mean = weighted / total
    return math.log(mean), spread / (total * mean) ** 2, total
