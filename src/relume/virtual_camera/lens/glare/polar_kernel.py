"""The loop that draws a point spread given in polar coordinates, row by row."""

from __future__ import annotations

import numpy as np

from relume._kernel import kernel


@kernel
def draw_rows(first, width, hole, step, radial, level_step, pattern, near, rows):
    """Rows first… below the point, (n, padded columns), in the order of transforms: 0, 1, …, −2, −1 pixels right.

    Values are radial(r^¼) · pattern(r^¼, angle), both interpolated linearly, or those of `near` round the point;
    nothing within `hole` pixels of it to all sides.
    """
    reach = near.shape[0] // 2
    levels, angles = pattern.shape
    columns = rows.shape[1]
    turn = angles / np.pi
    for i in range(rows.shape[0]):
        y = first + i
        for x in range(columns):
            rows[i, x] = 0
        for x in range(hole + 1 if y <= hole else 0, width):
            if y <= reach and x <= reach:
                rows[i, x] = near[reach + y, reach + x]
                if x > 0:
                    rows[i, columns - x] = near[reach + y, reach - x]
                continue
            root = np.sqrt(np.sqrt(np.sqrt(np.float32(x * x + y * y))))
            at = root * step
            index = min(int(at), radial.shape[0] - 2)
            part = at - np.float32(index)
            value = radial[index] + part * (radial[index + 1] - radial[index])
            height = root * level_step
            level = min(int(height), levels - 2)
            upper = height - np.float32(level)
            angle = np.float32(np.arctan2(np.float32(y), np.float32(x))) * np.float32(turn)
            for side in range(2):
                # The angle on the left is half a turn less that on the right.
                place = angle if side == 0 else angles - angle
                bin_ = int(place)
                share = place - np.float32(bin_)
                bin_ = bin_ if bin_ < angles else bin_ - angles
                after = bin_ + 1 if bin_ + 1 < angles else 0
                below = pattern[level, bin_] + share * (pattern[level, after] - pattern[level, bin_])
                above = pattern[level + 1, bin_] + share * (pattern[level + 1, after] - pattern[level + 1, bin_])
                drawn = value * (below + upper * (above - below))
                if side == 0:
                    rows[i, x] = drawn
                elif x > 0:
                    rows[i, columns - x] = drawn
