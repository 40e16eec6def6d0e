"""The loop of the merge: one pass over a stretch of pixels of all photographs (its slow twin is in the tests)."""

from __future__ import annotations

import math

import numpy as np

from relume._kernel import exact_kernel
from relume.image.radiance import BLACK, OUTSIDE, SATURATED


@exact_kernel
def merge_stretch(
    values: np.ndarray,
    outside: np.ndarray,
    bounds: np.ndarray,
    tables: np.ndarray,
    log_times: np.ndarray,
    logarithm: np.ndarray,
    variance: np.ndarray,
    clipped: np.ndarray,
) -> int:
    """Eq. 6 for every pixel of a stretch, with the variance it leaves; the number of channel values measured.

    values : (P, N, 3) unsigned, photographs from the least to the most exposed
    outside : (P, N) bool, or (0, 0) where every pixel of every photograph is part of its picture
    bounds : (3, levels) float64, the least ln exposure of a white value, the greatest of a black one
    tables : (3, levels, 3) float64: w g, w, w² var(ln E) of every value
    log_times : (P,) ln of the exposures
    logarithm : (N, 3) float64, written: ln of the radiance
    variance : (N, 3) float64, written: of ln radiance; infinite where no photograph measured
    clipped : (N,) uint8, written: the marks of `RadianceMap.clipped`
    """
    photographs, count, _ = values.shape
    white = tables.shape[1] // 2
    masked = outside.shape[0] > 0
    measured = 0
    for i in range(count):
        flag = 0
        for c in range(3):
            # Sums of eq. 6 over the photographs.
            weighted, total, spread = 0.0, 0.0, 0.0
            for p in range(photographs):
                if masked and outside[p, i]:
                    continue
                z = values[p, i, c]
                weight = tables[c, z, 1]
                weighted += tables[c, z, 0] - weight * log_times[p]
                total += weight
                spread += tables[c, z, 2]
            # Measured: the weighted mean and its variance.
            if total > 0:
                logarithm[i, c] = weighted / total
                variance[i, c] = spread / (total * total)
                measured += 1
                continue
            # The shortest exposure that shows white sets a lower bound, else the longest sets an upper one.
            last = -1
            variance[i, c] = math.inf
            for p in range(photographs):
                if masked and outside[p, i]:
                    continue
                last = p
                if values[p, i, c] > white:
                    break
            if last < 0:
                logarithm[i, c] = -math.inf
                flag = OUTSIDE
                continue
            z = values[last, i, c]
            logarithm[i, c] = bounds[c, z] - log_times[last]
            if z > white:
                flag = SATURATED
            elif flag == 0:
                flag = BLACK
        clipped[i] = flag
    return measured
