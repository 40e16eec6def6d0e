"""Which parts of a frame's rows hold clipped values: most hold none, or nothing else, and take shorter loops."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined

BLOCK = 192
"""Values of a row that are looked over together: 64 pixels."""
PLAIN, WHITE, MIXED = np.uint8(1), np.uint8(2), np.uint8(4)
"""What a block holds: nothing clipped, saturated values alone, or some of each. States of several are joined by or."""


@inlined
def _look_over(pixels, row, block, length, white, held):
    """Write down what a block of a row holds."""
    at = np.uint64(row * length + block * BLOCK)
    least, highest = pixels[at], pixels[at]
    for j in range(min(BLOCK, length - block * BLOCK)):
        value = pixels[at + np.uint64(j)]
        least, highest = min(least, value), max(highest, value)
    unclipped = PLAIN if least > 0 and np.float32(highest) < white else MIXED
    held[row, block] = WHITE if np.float32(least) >= white else unclipped


@inlined
def _cross(pixels, held, x_first, y_first, slant, begin_u, end_u, white, crossed):
    """What the pixels hold that a slanted line leans on between the columns begin_u and end_u, block by block.

    The line passes the columns u at the rows y_first + (u − x_first)·slant, and leans on two rows either way.
    crossed : (blocks,) uint8, 0 where the line does not pass
    """
    rows, length = held.shape[0], len(pixels) // held.shape[0]
    crossed[:] = 0
    for block in range(3 * begin_u // BLOCK, (3 * end_u - 1) // BLOCK + 1):
        one = y_first + (block * (BLOCK // 3) - x_first) * slant
        other = one + (BLOCK // 3 - 1) * slant
        state = np.uint8(0)
        for row in range(int(np.floor(min(one, other))) - 1, int(np.floor(max(one, other))) + 3):
            y = min(max(row, 0), rows - 1)
            if held[y, block] == 0:
                _look_over(pixels, y, block, length, white, held)
            state |= held[y, block]
        crossed[block] = state


@inlined
def _alike(crossed, begin, end):
    """Where the blocks that hold what the one at value `begin` does come to an end; at most `end`."""
    last = len(crossed) - 1
    block = min(max(begin // BLOCK, 0), last)
    state = crossed[block]
    while block < last and (block + 1) * BLOCK < end and crossed[block + 1] == state:
        block += 1
    return min(end, (block + 1) * BLOCK) if block < last else end
