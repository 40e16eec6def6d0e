"""The Lambert table by sums over hemispheres: exact, and linear in the map's pixels.

k·max(0, N·L) is linear in L where it is not zero, and on a row of a lat-long map it is not zero for one run of
columns. Running sums of I, I·cos φ and I·sin φ along each row give a run's sum from its two ends.
"""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import kernel
from relume.light.harmonics.transform import Flux

_ROWS = 32
"""Rows summed by one call: the sum over calls is in one order, whatever the threads."""


def hemisphere_sums(flux: np.ndarray | Flux, rows: int) -> np.ndarray:
    """Σ flux · max(0, N·L) over the pixels of a lat-long map, (rows, 2·rows, 3) float64, at every table entry N.

    flux : (H, 2H, 3), radiance × solid angle
    """
    size = flux.shape[0]

    def work(begin: int, end: int) -> np.ndarray:
        return _sums(np.ascontiguousarray(flux[begin:end], np.float64), begin, size, rows)

    parts = in_threads(work, size, chunk=_ROWS)
    # At grazing angles rounding leaves a little less than nothing.
    return np.maximum(np.sum(parts, axis=0), 0)


@kernel
def _sums(band, begin, size, rows):
    columns = band.shape[1]
    step = 2 * np.pi / columns
    table = np.zeros((rows, 2 * rows, 3))
    running = np.empty((columns + 1, 9))
    cosines, sines = np.cos(step * (np.arange(columns) + 0.5)), np.sin(step * (np.arange(columns) + 0.5))
    for i in range(begin, begin + band.shape[0]):
        running[0] = 0
        for k in range(columns):
            for c in range(3):
                value = band[i - begin, k, c]
                running[k + 1, 3 * c] = running[k, 3 * c] + value
                running[k + 1, 3 * c + 1] = running[k, 3 * c + 1] + value * cosines[k]
                running[k + 1, 3 * c + 2] = running[k, 3 * c + 2] + value * sines[k]
        polar = np.pi * (i + 0.5) / size
        for j in range(rows):
            normal = np.pi * (j + 0.5) / rows
            # N·L = a + b cos Δφ is positive for |Δφ| < reach.
            a, b = np.cos(polar) * np.cos(normal), np.sin(polar) * np.sin(normal)
            if a <= -b:
                continue
            reach = np.pi if a >= b else np.arccos(-a / b)
            for column in range(2 * rows):
                longitude = np.pi * (column + 0.5) / rows
                if a >= b:
                    first, last = 0, columns
                else:
                    first = int(np.ceil((longitude - reach) / step - 0.5))
                    last = int(np.floor((longitude + reach) / step - 0.5)) + 1
                along, across = b * np.cos(longitude), b * np.sin(longitude)
                turns = (last // columns) - (first // columns)
                low, high = first % columns, last % columns
                for c in range(3):
                    total = a * (running[high, 3 * c] - running[low, 3 * c] + turns * running[columns, 3 * c])
                    total += along * (
                        running[high, 3 * c + 1] - running[low, 3 * c + 1] + turns * running[columns, 3 * c + 1]
                    )
                    total += across * (
                        running[high, 3 * c + 2] - running[low, 3 * c + 2] + turns * running[columns, 3 * c + 2]
                    )
                    table[j, column, c] += total
    return table
