"""The loop in which cones and rods see a picture's pixels, compiled."""

from __future__ import annotations

import numpy as np

from relume._kernel import kernel


@kernel
def see(pixels, to_xyz, cones, rods, black, colour, begin, end, result):
    """Pixels begin to end as cones and rods see them: cones · (R, G, B) + rods · scotopic luminance − black.

    pixels, result : (N, 3) float32, which may be one array
    to_xyz : (3, 3) float32
    colour : False for the same luminance in the colour that cones alone would see

    The scotopic luminance is that of `vision.scotopic_luminance`.
    """
    for i in range(begin, end):
        red, green, blue = pixels[i, 0], pixels[i, 1], pixels[i, 2]
        x = to_xyz[0, 0] * red + to_xyz[0, 1] * green + to_xyz[0, 2] * blue
        y = to_xyz[1, 0] * red + to_xyz[1, 1] * green + to_xyz[1, 2] * blue
        z = to_xyz[2, 0] * red + to_xyz[2, 1] * green + to_xyz[2, 2] * blue
        share = np.float32(0)
        if x > 0:
            share = rods * max(np.float32(1.33) * (1 + (y + z) / x) - np.float32(1.68), np.float32(0))
        if colour:
            factor, added = cones, share * y - black
        else:
            factor, added = cones + share, -black
        result[i, 0] = factor * red + added
        result[i, 1] = factor * green + added
        result[i, 2] = factor * blue + added
