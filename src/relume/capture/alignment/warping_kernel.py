"""The loop that moves a frame: bicubic interpolation in two passes, down the columns and then along the rows.

Whole arrays are read at unsigned places: Numba counts the references to every slice, and asks of every signed place
whether it counts from the end, which no vector can.
"""

from __future__ import annotations

import numpy as np

from relume.capture.alignment.clipped_blocks import BLOCK, PLAIN, WHITE, _alike, _cross
from relume.image.kernel import inlined, kernel

WHOLE = 24
"""Values that fill vectors and pixels alike: a loop over a multiple of it leaves none to be taken one by one."""


@inlined
def _cubic(p0, p1, p2, p3, f, white):
    """The value at the fraction f between p1 and p2 (Catmull–Rom).

    It stays a value that is not clipped, however the interpolation swings.
    """
    half, three = np.float32(0.5), np.float32(1.5)
    value = (
        p0 * (f * (f * (np.float32(1) - half * f) - half))
        + p1 * (np.float32(1) + f * f * (three * f - np.float32(2.5)))
        + p2 * (f * (half + f * (np.float32(2) - three * f)))
        + p3 * (f * f * (half * f - half))
    )
    one = np.float32(1)
    value = one if value < one else value
    return white - one if value > white - one else value


@inlined
def _between(p0, p1, p2, p3, f, white, most):
    """The same, but `most` or 0 where it leans on white or black.

    A pixel that counts for less than a fiftieth is not leant on. Black leans on the inner pixels only: the outer ones'
    weights are small, and a value that should be a little below 0 is nothing that they could hide.
    """
    outer = (f > np.float32(0.05)) & (f < np.float32(0.95))
    q1, q2 = p1 if f < np.float32(0.98) else p2, p2 if f > np.float32(0.02) else p1
    q0, q3 = p0 if outer else q1, p3 if outer else q2
    least = q1 if q1 < q2 else q2
    a, b = q0 if q0 > q1 else q1, q2 if q2 > q3 else q3
    highest = a if a > b else b
    value = _cubic(p0, p1, p2, p3, f, white)
    value = np.float32(0) if least < np.float32(1) else value
    return most if highest >= white else value


@inlined
def _down(pixels, rows, x_first, y_first, slant, first, begin_u, end_u, columns, white, most, crossed, line):
    """The first pass: the values where a slanted line crosses the columns begin_u…end_u."""
    length = len(pixels) // rows
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
        start, step = np.float32(crossing - above), np.float32(slant)
        a, b = length * min(max(above - 1, 0), rows - 1), length * min(max(above, 0), rows - 1)
        c, d = length * min(max(above + 1, 0), rows - 1), length * min(max(above + 2, 0), rows - 1)
        i, end = 3 * u, 3 * (u + run)
        while i < end:
            state, after = crossed[i // BLOCK], _alike(crossed, i, end)
            # What is written beyond the run is written again by the next one, or lies beyond the border.
            wide = min((after - i + WHOLE - 1) // WHOLE * WHOLE, length - i)
            r0, r1, r2, r3 = np.uint64(a + i), np.uint64(b + i), np.uint64(c + i), np.uint64(d + i)
            part, column = np.uint64(i - 3 * first), np.uint64(i - 3 * u)
            if state == WHITE:
                for k in range(wide):
                    line[part + np.uint64(k)] = most
            elif state == PLAIN:
                for k in range(wide):
                    j = np.uint64(k)
                    p0, p1 = np.float32(pixels[r0 + j]), np.float32(pixels[r1 + j])
                    p2, p3 = np.float32(pixels[r2 + j]), np.float32(pixels[r3 + j])
                    line[part + j] = _cubic(p0, p1, p2, p3, start + step * columns[column + j], white)
            else:
                for k in range(wide):
                    j = np.uint64(k)
                    p0, p1 = np.float32(pixels[r0 + j]), np.float32(pixels[r1 + j])
                    p2, p3 = np.float32(pixels[r2 + j]), np.float32(pixels[r3 + j])
                    line[part + j] = _between(p0, p1, p2, p3, start + step * columns[column + j], white, most)
            i = after
        u += run


@inlined
def _along(line, crossed, x_first, cosine, first, columns, white, most, y, width, moved):
    """The second pass: the values of row `y`, between the columns."""
    x, o3, o6, o9 = 0, np.uint64(3), np.uint64(6), np.uint64(9)
    while x < width:
        crossing = x_first + cosine * x
        left = int(np.floor(crossing))
        # Along the row the columns keep step with the reference's until a whole pixel is lost to the cosine.
        run = width - x
        if cosine < 1:
            run = min(run, int((crossing - left) / (1 - cosine)) + 1)
        start, step = np.float32(crossing - left), np.float32(cosine - 1)
        begin, end = 3 * (left - 1), 3 * (left - 1 + run)
        i = begin
        while i < end:
            state, after = crossed[min(max(i // BLOCK, 0), len(crossed) - 1)], _alike(crossed, i, end)
            part, column = np.uint64(i - 3 * first), np.uint64(i - begin)
            out = np.uint64(3 * (width * y + x) + i - begin)
            if state == WHITE:
                for k in range(after - i):
                    moved[out + np.uint64(k)] = np.int32(most)
            elif state == PLAIN:
                for k in range(after - i):
                    j = np.uint64(k)
                    p0, p1, p2, p3 = line[part + j], line[part + (j + o3)], line[part + (j + o6)], line[part + (j + o9)]
                    value = _cubic(p0, p1, p2, p3, start + step * columns[column + j], white)
                    moved[out + j] = np.int32(value + np.float32(0.5))
            else:
                for k in range(after - i):
                    j = np.uint64(k)
                    p0, p1, p2, p3 = line[part + j], line[part + (j + o3)], line[part + (j + o6)], line[part + (j + o9)]
                    value = _between(p0, p1, p2, p3, start + step * columns[column + j], white, most)
                    moved[out + j] = np.int32(value + np.float32(0.5))
            i = after
        x += run


@kernel
def _move(pixels, held, cosine, sine, x_start, y_start, white, most, begin, end, columns, moved):
    """Rows begin…end of a frame moved onto the reference.

    pixels, moved : (H·3W,), row by row, a row's channels side by side
    held : (H, blocks) uint8, what is known of the blocks of `pixels`; 0 where nothing is. Threads may share it
    x_start, y_start : where the reference's pixel (0, 0) is found in this frame
    columns : (3W + 24,) float32, the pixel 0, 0, 0, 1, 1, 1, … that each value of a row belongs to
    white : least value that counts as saturated; `most` is the largest there is

    A line of the reference crosses this frame along a slanted line. The first pass finds the value of every column
    where that line crosses it, the second interpolates between columns: 8 products instead of 16, and no error, as
    long as the line is not steep.
    """
    rows, length = held.shape[0], len(pixels) // held.shape[0]
    width = length // 3
    slant = sine / cosine
    line = np.empty(length + 2 * WHOLE, np.float32)
    crossed = np.empty(held.shape[1], np.uint8)
    for y in range(begin, end):
        x_first, y_first = x_start - sine * y, y_start + cosine * y
        # Columns of this frame that the line needs: line[3·(u − first)…] belongs to column u.
        first = int(np.floor(x_first)) - 2
        needed = int(np.floor(x_first + cosine * (width - 1))) + 4 - first
        begin_u, end_u = max(first, 0), min(first + needed, width)
        if begin_u >= end_u:
            # The line passes by the frame.
            nearest = length * min(max(int(np.rint(y_first)), 0), rows - 1) + (0 if end_u <= 0 else length - 3)
            for j in range(length):
                moved[y * length + j] = pixels[nearest + j % 3]
            continue
        _cross(pixels, held, x_first, y_first, slant, begin_u, end_u, white, crossed)
        _down(pixels, rows, x_first, y_first, slant, first, begin_u, end_u, columns, white, most, crossed, line)
        before, last = 3 * (begin_u - first), 3 * (end_u - 1 - first)
        for j in range(before):
            line[j] = line[before + j % 3]
        for j in range(last + 3, 3 * needed):
            line[j] = line[last + j % 3]
        # The second pass reaches three pixels into the next block.
        for block in range(len(crossed) - 1):
            crossed[block] |= crossed[block + 1]
        _along(line, crossed, x_first, cosine, first, columns, white, most, y, width, moved)
