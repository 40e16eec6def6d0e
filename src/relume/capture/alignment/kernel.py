"""The loops of alignment: reducing a frame, choosing its features, looking them up in another frame."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel


@kernel
def _reduce(pixels, factor, low, high, scale, begin, end, values, valid):
    """Rows begin…end of the green channel's mean over factor × factor pixels; valid where none of them is clipped."""
    columns = values.shape[1]
    total, least, most = np.empty(columns, np.int64), np.empty(columns, np.int64), np.empty(columns, np.int64)
    share = scale / (factor * factor)
    for y in range(begin, end):
        total[:], least[:], most[:] = 0, 65535, 0
        for row in range(y * factor, (y + 1) * factor):
            for x in range(columns):
                for column in range(x * factor, (x + 1) * factor):
                    value = np.int64(pixels[row, column, 1])
                    total[x] += value
                    least[x] = min(least[x], value)
                    most[x] = max(most[x], value)
        for x in range(columns):
            values[y, x] = total[x] * share
            valid[y, x] = (least[x] > low) & (most[x] < high)


@kernel
def _features(values, valid, cell, faintest, places, found):
    """The steepest pixel of every cell: its row and column into `places`, its value and gradient into `found`."""
    rows, columns = values.shape
    count = 0
    for top in range(1, rows - 1, cell):
        for left in range(1, columns - 1, cell):
            steepest, row, column = faintest * faintest, -1, -1
            for y in range(top, min(top + cell, rows - 1)):
                for x in range(left, min(left + cell, columns - 1)):
                    across = 0.5 * (values[y, x + 1] - values[y, x - 1])
                    down = 0.5 * (values[y + 1, x] - values[y - 1, x])
                    steepness = across * across + down * down
                    if steepness > steepest and valid[y, x] == 1:
                        sound = True
                        for j in range(-1, 2):
                            for i in range(-1, 2):
                                sound &= valid[y + j, x + i] == 1
                        if sound:
                            steepest, row, column = steepness, y, x
            if row >= 0:
                places[count, 0], places[count, 1] = row, column
                found[count, 0] = values[row, column]
                found[count, 1] = 0.5 * (values[row, column + 1] - values[row, column - 1])
                found[count, 2] = 0.5 * (values[row + 1, column] - values[row - 1, column])
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
