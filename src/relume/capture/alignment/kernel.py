"""The loops of alignment: choosing a frame's features and looking them up in another frame."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, kernel


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


@exact_kernel
def _match(
    table, values, positions, gradients, low, high, cosine, sine, dx, dy, count, placed, targets, weights, edges
):
    """Features whose partner's values turn into values between `low` and `high` are written from `count` on.

    table : what the values −4, −3.75, … 260 turn into
    cosine, sine, dx, dy : of the motion from the partner to the reference
    placed, targets, weights, edges : positions in the reference, what the frame should show there, how sure that is
        (less where the relation is steep), gradients of the partner
    """
    for n in range(len(values)):
        place = (values[n] + 4) * 4
        below = int(place)
        target = table[below] + (place - below) * (table[below + 1] - table[below])
        # Over eight values.
        slope = (table[below + 16] - table[below - 16]) / 8
        if target > low and target < high and slope > 0.05:
            x, y = positions[n, 0], positions[n, 1]
            placed[count, 0], placed[count, 1] = cosine * x - sine * y + dx, sine * x + cosine * y + dy
            targets[count], weights[count] = target, 1 / (1 + slope * slope)
            edges[count, 0], edges[count, 1] = gradients[n, 0], gradients[n, 1]
            count += 1
    return count


@exact_kernel
def _in_both(fixed, fixed_inside, moving, moving_inside, step, across, down, ours, theirs):
    """Values of every `step`th pixel that both frames show, into `ours` and `theirs`; how many there are.

    across, down : column and row in `moving` of the pixel (0, 0), and what a column and a row further add to them
    """
    rows, columns = moving.shape
    count = 0
    for row in range(0, fixed.shape[0], step):
        for column in range(0, fixed.shape[1], step):
            x = int(np.rint(across[0] + across[1] * column + across[2] * row))
            y = int(np.rint(down[0] + down[1] * column + down[2] * row))
            if x >= 0 and y >= 0 and x < columns and y < rows and fixed_inside[row, column] and moving_inside[y, x]:
                ours[count], theirs[count] = fixed[row, column], moving[y, x]
                count += 1
    return count


@exact_kernel
def _place(positions, cosine, sine, dx, dy, width, height, scale, x, y):
    """Columns and rows (N,) in a level of positions (N, 2) in the reference, as `Motion.apply` and `Level.indices` give
    them bit for bit: at first motions are whole pixels of the coarsest level, and what lies on the border counts."""
    for n in range(len(positions)):
        right, down = positions[n, 0], positions[n, 1]
        x[n] = (cosine * right - sine * down + dx + width / 2) / scale - 0.5
        y[n] = (sine * right + cosine * down + dy + height / 2) / scale - 0.5


@kernel
def _look_up(values, valid, x, y, begin, end, seen):
    """Value and gradient of a frame at the positions (x, y), by bicubic interpolation (Catmull–Rom).

    seen : (N, 4): value, change across, change down, 1 where the sixteen pixels are valid
    """
    rows, columns = values.shape
    weights, slopes = np.empty((2, 4), np.float64), np.empty((2, 4), np.float64)
    flat, flat_valid = values.reshape(-1), valid.reshape(-1)
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
            start = np.uint64((top - 1 + j) * columns + left - 1)
            for i in range(4):
                pixel = flat[start + np.uint64(i)]
                sound &= flat_valid[start + np.uint64(i)] == 1
                line += weights[0, i] * pixel
                change += slopes[0, i] * pixel
            value += weights[1, j] * line
            across += weights[1, j] * change
            down += slopes[1, j] * line
        seen[n, 0], seen[n, 1], seen[n, 2], seen[n, 3] = value, across, down, sound


@exact_kernel
def _whiten(seen, targets, weights, whitened):
    """Residuals in units of their deviations where something was seen, into `whitened`; how many there are."""
    count = 0
    for n in range(len(seen)):
        if seen[n, 3] == 1:
            whitened[count] = (seen[n, 0] - targets[n]) * np.sqrt(weights[n])
            count += 1
    return count


@exact_kernel
def _differentiate(seen, whitened, points, cosine, sine, dx, dy, scale, radius, outlier, residual, jacobian, weighted):
    """How values change with dx, dy and a corner's way along the turn, row by row of what was seen.

    whitened : of what was seen, one after another; such as are far beyond `outlier` hardly count
    points : positions, targets and weights
    weighted : (N, 2) or (N, 3), `jacobian` (N, 3) times weights; without a turn where it has two columns
    """
    positions, targets, weights = points
    count = 0
    for n in range(len(seen)):
        if seen[n, 3] == 1:
            far = whitened[count] / outlier
            weight = weights[n] / ((1 + far * far) * (1 + far * far))
            residual[count] = seen[n, 0] - targets[n]
            across, down = seen[n, 1] / scale, seen[n, 2] / scale
            x = (cosine * positions[n, 0] - sine * positions[n, 1] + dx) - dx
            y = (sine * positions[n, 0] + cosine * positions[n, 1] + dy) - dy
            jacobian[count, 0], jacobian[count, 1] = across, down
            jacobian[count, 2] = (down * x - across * y) / radius
            for i in range(weighted.shape[1]):
                weighted[count, i] = jacobian[count, i] * weight
            count += 1


@kernel
def _agreement(seen, gradients):
    """Mean cosine between gradients and those seen, where something was seen."""
    total, count = 0.0, 0
    for n in range(len(seen)):
        if seen[n, 3] == 1:
            product = gradients[n, 0] * seen[n, 1] + gradients[n, 1] * seen[n, 2]
            squared = (gradients[n, 0] ** 2 + gradients[n, 1] ** 2) * (seen[n, 1] ** 2 + seen[n, 2] ** 2)
            total += product / max(np.sqrt(squared), 1e-9)
            count += 1
    return total / count
