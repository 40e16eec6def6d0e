"""The loop over pixels of the look-up table, compiled."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel


@exact_kernel
def lookup(values, gains, thresholds, starts, lowest, shift, comparisons, bounds, codes, counts):
    """Fill `codes` (H, W, 3) with the codes of values (H, W, 3) float32 times gains (3,) float32; 0 for NaN.

    thresholds, starts, lowest, shift, comparisons : of a `CodeTable`
    bounds : (2, 3) float32, its black and white
    counts : (3, 3) int64, to which are added how many values of each channel are above white, below black, and NaN
    """
    height, width, _ = values.shape
    last = np.int32(starts.shape[1] - 1)
    begin = np.int32(lowest)
    drop = np.int32(shift)
    for channel in range(3):
        row_of_table = min(channel, len(starts) - 1)
        first, steps = starts[row_of_table], thresholds[row_of_table]
        gain, black, white = gains[channel], bounds[0, channel], bounds[1, channel]
        above, below, absent = 0, 0, 0
        for y in range(height):
            for x in range(width):
                value = np.float32(values[y, x, channel] * gain)
                # Negative floats have negative bits, so that they fall into the first bin; those of NaN into the last.
                place = min(max((np.float32(value).view(np.int32) >> drop) - begin, np.int32(0)), last)
                code = first[place]
                for _ in range(comparisons):
                    code += value >= steps[code]
                above += value > white
                below += value < black
                if value != value:
                    code, absent = 0, absent + 1
                codes[y, x, channel] = code
        counts[0, channel] += above
        counts[1, channel] += below
        counts[2, channel] += absent
