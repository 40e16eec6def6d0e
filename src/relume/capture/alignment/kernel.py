"""The loops of alignment: choosing a frame's features and looking them up in another frame."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel


@kernel
def _features(values, valid, cell, faintest, places, found):
    """The steepest pixel of every cell: its row and column into `places`, its value and gradient into `found`."""
    rows, columns = values.shape
    flat, sound = values.reshape(-1), valid.reshape(-1)
    steepness, steepest = np.empty(columns), np.empty(-(-columns // cell))
    row, column = np.empty(len(steepest), np.int64), np.empty(len(steepest), np.int64)
    one, width = np.uint64(1), np.uint64(columns)
    count = 0
    for top in range(1, rows - 1, cell):
        steepest[:], row[:] = faintest * faintest, -1
        for y in range(top, min(top + cell, rows - 1)):
            # A row's gradients first, in a loop of its own that has no branches; 0 where one of nine pixels is clipped.
            start = np.uint64(y) * width
            for k in range(1, columns - 1):
                here = start + np.uint64(k)
                above, below = here - width, here + width
                across = 0.5 * (flat[here + one] - flat[here - one])
                down = 0.5 * (flat[below] - flat[above])
                well = sound[above - one] & sound[above] & sound[above + one] & sound[here - one] & sound[here]
                well &= sound[here + one] & sound[below - one] & sound[below] & sound[below + one]
                steepness[k] = (across * across + down * down) * np.float64(well)
            for n in range(len(steepest)):
                for x in range(1 + n * cell, min(1 + (n + 1) * cell, columns - 1)):
                    if steepness[x] > steepest[n]:
                        steepest[n], row[n], column[n] = steepness[x], y, x
        for n in range(len(steepest)):
            if row[n] >= 0:
                y, x = row[n], column[n]
                places[count, 0], places[count, 1] = y, x
                found[count, 0] = values[y, x]
                found[count, 1] = 0.5 * (values[y, x + 1] - values[y, x - 1])
                found[count, 2] = 0.5 * (values[y + 1, x] - values[y - 1, x])
                count += 1
    return count


@kernel
def _look_up(values, valid, x, y, begin, end, seen):
    """Value and gradient of a frame at the positions (x, y), by bicubic interpolation (Catmull–Rom).

    seen : (N, 4): value, change across, change down, 1 where the sixteen pixels are valid
    """
    rows, columns = values.shape
    weights, slopes = np.empty((2, 4), np.float64), np.empty((2, 4), np.float64)
    for n in range(begin, end):
        seen[n, 3] = 0
        if not (x[n] >= 1 and y[n] >= 1 and x[n] < columns - 2 and y[n] < rows - 2):
            continue
        left, top = int(x[n]), int(y[n])
        for axis in range(2):
            f = x[n] - left if axis == 0 else y[n] - top
            weights[axis, 0] = f * (-0.5 + f * (1 - 0.5 * f))
            weights[axis, 1] = 1 + f * f * (-2.5 + 1.5 * f)
            weights[axis, 2] = f * (0.5 + f * (2 - 1.5 * f))
            weights[axis, 3] = f * f * (-0.5 + 0.5 * f)
            slopes[axis, 0] = -0.5 + f * (2 - 1.5 * f)
            slopes[axis, 1] = f * (-5 + 4.5 * f)
            slopes[axis, 2] = 0.5 + f * (4 - 4.5 * f)
            slopes[axis, 3] = f * (-1 + 1.5 * f)
        value, across, down, sound = 0.0, 0.0, 0.0, True
        for j in range(4):
            line, change = 0.0, 0.0
            for i in range(4):
                pixel = values[top - 1 + j, left - 1 + i]
                sound &= valid[top - 1 + j, left - 1 + i] == 1
                line += weights[0, i] * pixel
                change += slopes[0, i] * pixel
            value += weights[1, j] * line
            across += weights[1, j] * change
            down += slopes[1, j] * line
        seen[n, 0], seen[n, 1], seen[n, 2], seen[n, 3] = value, across, down, sound
