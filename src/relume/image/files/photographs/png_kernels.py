"""The loop over the bytes of a PNG: back from the differences that its rows are stored as (W3C PNG, clause 9)."""

from __future__ import annotations

from relume._kernel import exact_kernel


@exact_kernel
def unfilter(lines, step, rows):
    """Fill `rows` ((H, N) uint8) from `lines` ((H, 1 + N) uint8), each of which begins with the number of its filter.

    step : bytes from one pixel to the next, at least 1
    Returns the first line whose filter is none of the five, the number of lines where all are.
    """
    height, length = rows.shape
    for y in range(height):
        kind = lines[y, 0]
        if kind > 4:
            return y
        # Ahead of a row's first pixel, and above the first row, all is 0.
        for x in range(length):
            left = 0 if x < step else int(rows[y, x - step])
            above = 0 if y == 0 else int(rows[y - 1, x])
            if kind == 0:
                told = 0
            elif kind == 1:
                told = left
            elif kind == 2:
                told = above
            elif kind == 3:
                told = (left + above) >> 1
            else:
                corner = 0 if x < step or y == 0 else int(rows[y - 1, x - step])
                guess = left + above - corner
                to_left, to_above, to_corner = abs(guess - left), abs(guess - above), abs(guess - corner)
                if to_left <= to_above and to_left <= to_corner:
                    told = left
                elif to_above <= to_corner:
                    told = above
                else:
                    told = corner
            rows[y, x] = (int(lines[y, 1 + x]) + told) & 255
    return height
