"""The loop that moves a frame: bicubic interpolation in two passes, down the columns and then along the rows."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel

HIT = 1e-3
"""Pixels; nearer to a pixel its neighbours have no weight."""
BEYOND = 0.02
"""Pixels beyond the outermost pixels' centres that still count as the picture."""


@inlined
def _between(p0, p1, p2, p3, f, white, most):
    """The value at the fraction f between p1 and p2 (Catmull–Rom); `most` or 0 where it leans on white or black.

    What leans on nothing clipped stays a value that is not clipped, however the interpolation swings. A pixel that
    counts for less than a fiftieth is not leant on. Black leans on the inner pixels only: the outer ones' weights are
    small, and a value that should be a little below 0 is nothing that they could hide.
    """
    outer = (f > np.float32(0.05)) & (f < np.float32(0.95))
    q1, q2 = p1 if f < np.float32(0.98) else p2, p2 if f > np.float32(0.02) else p1
    q0, q3 = p0 if outer else q1, p3 if outer else q2
    least = q1 if q1 < q2 else q2
    a, b = q0 if q0 > q1 else q1, q2 if q2 > q3 else q3
    highest = a if a > b else b
    half, three = np.float32(0.5), np.float32(1.5)
    value = (
        p0 * (f * (f * (np.float32(1) - half * f) - half))
        + p1 * (np.float32(1) + f * f * (three * f - np.float32(2.5)))
        + p2 * (f * (half + f * (np.float32(2) - three * f)))
        + p3 * (f * f * (half * f - half))
    )
    one = np.float32(1)
    value = one if value < one else value
    value = white - one if value > white - one else value
    value = np.float32(0) if least < one else value
    return most if highest >= white else value


@kernel
def _move(pixels, cosine, sine, x_start, y_start, white, most, begin, end, columns, moved):
    """Rows begin…end of a frame moved onto the reference.

    pixels : (H, 3W), a row's channels side by side
    x_start, y_start : where the reference's pixel (0, 0) is found in this frame
    columns : (3W + 24,) float32, the pixel 0, 0, 0, 1, 1, 1, … that each value of a row belongs to
    white : least value that counts as saturated; `most` is the largest there is

    A line of the reference crosses this frame along a slanted line. The first pass finds the value of every column
    where that line crosses it, the second interpolates between columns: 8 products instead of 16, and no error, as
    long as the line is not steep.
    """
    rows, length = pixels.shape
    width = length // 3
    slant = sine / cosine
    line = np.empty(length + 24, np.float32)
    for y in range(begin, end):
        x_first, y_first = x_start - sine * y, y_start + cosine * y
        # Columns of this frame that the line needs: line[3·(u − first)…] belongs to column u.
        first = int(np.floor(x_first)) - 2
        needed = int(np.floor(x_first + cosine * (width - 1))) + 4 - first
        begin_u, end_u = max(first, 0), min(first + needed, width)
        u = begin_u
        while u < end_u:
            crossing = y_first + (u - x_first) * slant
            above = int(np.floor(crossing))
            # The run of columns that the line crosses between the same two rows.
            run = end_u - u
            if slant > 0:
                run = min(run, max(int((above + 1 - crossing) / slant), 0) + 1)
            elif slant < 0:
                run = min(run, max(int((above - crossing) / slant), 0) + 1)
            # Slices, so that indices count from 0: only then are the loops vectorised.
            begin_j, end_j = 3 * u, 3 * (u + run)
            r0 = pixels[min(max(above - 1, 0), rows - 1), begin_j:end_j]
            r1 = pixels[min(max(above, 0), rows - 1), begin_j:end_j]
            r2 = pixels[min(max(above + 1, 0), rows - 1), begin_j:end_j]
            r3 = pixels[min(max(above + 2, 0), rows - 1), begin_j:end_j]
            part = line[3 * (u - first) : 3 * (u - first + run)]
            start, step = np.float32(crossing - above), np.float32(slant)
            for j in range(3 * run):
                p0, p1, p2, p3 = np.float32(r0[j]), np.float32(r1[j]), np.float32(r2[j]), np.float32(r3[j])
                part[j] = _between(p0, p1, p2, p3, start + step * columns[j], white, most)
            u += run
        for j in range(max(0, 3 * (begin_u - first))):
            line[j] = line[3 * (begin_u - first) + j % 3]
        last = 3 * (end_u - 1 - first)
        for j in range(last + 3, 3 * needed):
            line[j] = line[last + j % 3]
        x = 0
        while x < width:
            crossing = x_first + cosine * x
            left = int(np.floor(crossing))
            # Along the row the columns keep step with the reference's until a whole pixel is lost to the cosine.
            run = width - x
            if cosine < 1:
                run = min(run, int((crossing - left) / (1 - cosine)) + 1)
            start, step = np.float32(crossing - left), np.float32(cosine - 1)
            begin_j, fetched = 3 * (left - 1 - first), moved[y, 3 * x : 3 * (x + run)]
            part = line[begin_j : begin_j + 3 * run + 9]
            for j in range(3 * run):
                f = start + step * columns[j]
                value = _between(part[j], part[j + 3], part[j + 6], part[j + 9], f, white, most) + np.float32(0.5)
                fetched[j] = np.int32(value)
            x += run


@kernel
def _lean_outside(before, cosine, sine, x_start, y_start, begin, end, outside):
    """Rows begin…end of the mask of what lies beyond this frame's border or leans on what was outside already.

    before : (H, W) bool, or empty where nothing was outside
    """
    height, width = outside.shape
    for y in range(begin, end):
        for x in range(width):
            column, row = x_start - sine * y + cosine * x, y_start + cosine * y + sine * x
            within = column >= -BEYOND and row >= -BEYOND
            outside[y, x] = not (within and column <= width - 1 + BEYOND and row <= height - 1 + BEYOND)
    if before.size == 0:
        return
    slant = sine / cosine
    for y in range(begin, end):
        for x in range(width):
            if outside[y, x]:
                continue
            column, row = x_start - sine * y + cosine * x, y_start + cosine * y + sine * x
            left = int(np.floor(column))
            for u in range(left - 1, left + 3):
                # A column or row that the position hits has no neighbours to lean on.
                if abs(column - u) > HIT and min(column - left, left + 1 - column) < HIT:
                    continue
                # Where the slanted line of `_move` crosses this column.
                crossing = row + (u - column) * slant
                top = int(np.floor(crossing))
                for v in range(top - 1, top + 3):
                    if abs(crossing - v) > HIT and min(crossing - top, top + 1 - crossing) < HIT:
                        continue
                    outside[y, x] |= before[min(max(v, 0), height - 1), min(max(u, 0), width - 1)]
