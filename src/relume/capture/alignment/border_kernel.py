"""The loops beside the moving itself: what lies outside a moved frame, and whole pixels beside white."""

from __future__ import annotations

import numpy as np

from relume.capture.alignment.clipped_blocks import BLOCK
from relume.image.kernel import exact_inlined, exact_kernel, inlined, kernel

HIT = 1e-3
"""Pixels; nearer to a pixel its neighbours have no weight."""
BEYOND = 0.02
"""Pixels beyond the outermost pixels' centres that still count as the picture."""


@exact_inlined
def _within(x, y, cosine, sine, x_start, y_start, width, height):
    """Whether the reference's pixel (x, y) is found in the frame."""
    column, row = x_start - sine * y + cosine * x, y_start + cosine * y + sine * x
    return column >= -BEYOND and row >= -BEYOND and column <= width - 1 + BEYOND and row <= height - 1 + BEYOND


@exact_kernel
def _beyond(cosine, sine, x_start, y_start, begin, end, outside):
    """Rows begin…end of the mask of what lies beyond a frame's border.

    outside : (H, W) bool
    """
    height, width = outside.shape
    for y in range(begin, end):
        # The columns where the row enters the frame and leaves it, by its left and right border and by its other two.
        column, row = x_start - sine * y, y_start + cosine * y
        enters, leaves = (-BEYOND - column) / cosine, (width - 1 + BEYOND - column) / cosine
        if sine != 0:
            top, bottom = (-BEYOND - row) / sine, (height - 1 + BEYOND - row) / sine
            enters, leaves = max(enters, min(top, bottom)), min(leaves, max(top, bottom))
        x0 = int(np.ceil(min(max(enters, 0.0), float(width))))
        x1 = int(np.floor(min(max(leaves, -1.0), width - 1.0))) + 1
        # The quotients are rounded; what counts is where the pixels themselves are found.
        while x0 > 0 and _within(x0 - 1, y, cosine, sine, x_start, y_start, width, height):
            x0 -= 1
        while x0 < x1 and not _within(x0, y, cosine, sine, x_start, y_start, width, height):
            x0 += 1
        while x1 < width and x1 >= x0 and _within(x1, y, cosine, sine, x_start, y_start, width, height):
            x1 += 1
        while x1 > x0 and not _within(x1 - 1, y, cosine, sine, x_start, y_start, width, height):
            x1 -= 1
        outside[y, :x0] = True
        outside[y, x0:x1] = False
        outside[y, max(x0, x1) :] = True


@inlined
def _leans(before, x, y, cosine, sine, x_start, y_start, slant):
    """Whether the reference's pixel (x, y) leans on one that was outside."""
    height, width = before.shape
    column, row = x_start - sine * y + cosine * x, y_start + cosine * y + sine * x
    left, found = int(np.floor(column)), False
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
            found |= before[min(max(v, 0), height - 1), min(max(u, 0), width - 1)]
    return found


@kernel
def _lean_outside(before, cosine, sine, x_start, y_start, begin, end, outside):
    """Add to rows begin…end of the mask what leans on what was outside already.

    before : (H, W) bool
    """
    height, width = outside.shape
    slant, flat = sine / cosine, before.reshape(-1)
    for y in range(begin, end):
        for start in range(0, width, BLOCK // 3):
            stop = min(start + BLOCK // 3, width)
            # All that the block may lean on: mostly nothing of it was outside.
            column, row = x_start - sine * y + cosine * start, y_start + cosine * y + sine * start
            right, low = column + cosine * (stop - start), row + sine * (stop - start)
            first, last = min(max(int(column) - 3, 0), width - 1), min(max(int(right) + 4, 0), width - 1)
            top, bottom = int(np.floor(min(row, low))) - 3, int(np.floor(max(row, low))) + 4
            touched = False
            for v in range(min(max(top, 0), height - 1), min(max(bottom, 0), height - 1) + 1):
                at = np.uint64(v * width + first)
                for k in range(last - first + 1):
                    touched |= flat[at + np.uint64(k)]
            if touched:
                for x in range(start, stop):
                    if not outside[y, x]:
                        outside[y, x] = _leans(before, x, y, cosine, sine, x_start, y_start, slant)


@exact_kernel
def _take_whole(pixels, cosine, sine, x_start, y_start, white, begin, end, outside, moved):
    """Rows begin…end again, where a channel is white: the nearest pixel as it is.

    pixels, moved : (H·3W,), row by row
    white : least value that counts as saturated
    """
    height, width = outside.shape
    for y in range(begin, end):
        for left in range(0, width, BLOCK // 3):
            at, count = 3 * (y * width + left), min(BLOCK // 3, width - left)
            highest = moved[at]
            for j in range(3 * count):
                highest = max(highest, moved[np.uint64(at) + np.uint64(j)])
            if highest < white:
                continue
            for x in range(left, left + count):
                here = 3 * (y * width + x)
                if max(moved[here], moved[here + 1], moved[here + 2]) >= white and not outside[y, x]:
                    row = min(max(int(np.rint(y_start + cosine * y + sine * x)), 0), height - 1)
                    column = min(max(int(np.rint(x_start - sine * y + cosine * x)), 0), width - 1)
                    for channel in range(3):
                        moved[here + channel] = pixels[3 * (row * width + column) + channel]
