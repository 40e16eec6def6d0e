"""Choosing pixels by running sums, for many random numbers at once."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_kernel, exact_small, in_threads


def chosen_pixels(
    u: np.ndarray, marginal: np.ndarray, conditional: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (N,) of the pixels, and the place within them (N, 2) in [0, 1), right and down.

    u : (N, 2) in [0, 1); the first chooses the column, the second the row
    marginal, conditional : (H + 1,) and (H, W + 1) running sums from 0 over rows and along each
    """
    rows, columns, within = np.empty(len(u), np.int64), np.empty(len(u), np.int64), np.empty((len(u), 2))
    in_threads(lambda begin, end: _choose(u, marginal, conditional, rows, columns, within, begin, end), len(u))
    return rows, columns, within


# Sums must be compared as they are: a black pixel whose ends were rounded apart could be drawn.
@exact_kernel
def _choose(u, marginal, conditional, rows, columns, within, begin, end):
    for n in range(begin, end):
        value = u[n, 1] * marginal[-1]
        row = _last_not_above(marginal, value)
        rows[n] = row
        within[n, 1] = _place(marginal, row, value)
        value = u[n, 0] * conditional[row, -1]
        column = _last_not_above(conditional[row], value)
        columns[n] = column
        within[n, 0] = _place(conditional[row], column, value)


@exact_small
def _last_not_above(sums, value):
    """The last k with sums[k] ≤ value < sums[k + 1]: never a step without height."""
    low, high = 0, len(sums) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if sums[middle] <= value:
            low = middle
        else:
            high = middle
    # u·total may round up to the total; the last step with height is meant.
    while low > 0 and sums[low + 1] <= sums[low]:
        low -= 1
    return low


@exact_small
def _place(sums, k, value):
    """Where in the step the value lies, below 1 also after rounding."""
    return min(max((value - sums[k]) / (sums[k + 1] - sums[k]), 0.0), 1 - 2.0**-53)
