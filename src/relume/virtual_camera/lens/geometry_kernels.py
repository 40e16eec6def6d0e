"""The loop that fetches every colour of every pixel from its place in another picture."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel


@inlined
def _lagrange(t):
    """The weights at t, counted from the first of four places, of the cubic through their values."""
    a, b, c, d = t, t - 1, t - 2, t - 3
    return -b * c * d / 6, a * c * d / 2, -a * b * d / 2, a * b * c / 6


@inlined
def _keys(t):
    """The weights of the four pixels round a place, t past the second (Keys 1981, eq. 8, a = −½)."""
    s = t * t
    first, last = t * (t * (1 - t / 2) - np.float32(0.5)), s * (t - 1) / 2
    second = 1 + s * (np.float32(1.5) * t - np.float32(2.5))
    return first, second, 1 - first - second - last, last


@kernel
def _resample(radiance, places, hide, begin, end, out):
    """Rows begin…end of the picture whose pixels are found at `places`.

    places : (1 or 3, rows, columns, 2), right and down, at the points of a grid from corner to corner
    hide : whether what lies beyond the border is NaN, or the border's own light
    """
    height, width = radiance.shape[:2]
    colours, rows, columns = places.shape[:3]
    line = np.empty((columns, 2))
    for y in range(begin, end):
        # The grid of places, interpolated at this row.
        v = (y + 0.5) * (rows - 1) / height
        above = min(max(int(v) - 1, 0), rows - 4)
        w0, w1, w2, w3 = _lagrange(v - above)
        for colour in range(colours):
            for j in range(columns):
                for k in range(2):
                    line[j, k] = (
                        w0 * places[colour, above, j, k]
                        + w1 * places[colour, above + 1, j, k]
                        + w2 * places[colour, above + 2, j, k]
                        + w3 * places[colour, above + 3, j, k]
                    )
            lowest, highest = (0, 3) if colours == 1 else (colour, colour + 1)
            for x in range(width):
                # The place of this pixel in the picture.
                u = (x + 0.5) * (columns - 1) / width
                before = min(max(int(u) - 1, 0), columns - 4)
                u0, u1, u2, u3 = _lagrange(u - before)
                right = u0 * line[before, 0] + u1 * line[before + 1, 0]
                right += u2 * line[before + 2, 0] + u3 * line[before + 3, 0]
                down = u0 * line[before, 1] + u1 * line[before + 1, 1]
                down += u2 * line[before + 2, 1] + u3 * line[before + 3, 1]
                known = right >= 0 and right <= width and down >= 0 and down <= height
                if not known and (hide or np.isnan(right) or np.isnan(down)):
                    for c in range(lowest, highest):
                        out[y, x, c] = np.nan
                    continue
                # Radiance there, by Keys' cubic.
                right = min(max(right - 0.5, 0.0), width - 1.0)
                down = min(max(down - 0.5, 0.0), height - 1.0)
                i, j = int(down), int(right)
                p0, p1, p2, p3 = _keys(np.float32(right - j))
                q0, q1, q2, q3 = _keys(np.float32(down - i))
                j0, j2, j3 = max(j - 1, 0), min(j + 1, width - 1), min(j + 2, width - 1)
                i0, i2, i3 = max(i - 1, 0), min(i + 1, height - 1), min(i + 2, height - 1)
                for c in range(lowest, highest):
                    a, b, d, e = radiance[i, j, c], radiance[i, j2, c], radiance[i2, j, c], radiance[i2, j2, c]
                    value = q0 * (
                        p0 * radiance[i0, j0, c]
                        + p1 * radiance[i0, j, c]
                        + p2 * radiance[i0, j2, c]
                        + p3 * radiance[i0, j3, c]
                    )
                    value += q1 * (p0 * radiance[i, j0, c] + p1 * a + p2 * b + p3 * radiance[i, j3, c])
                    value += q2 * (p0 * radiance[i2, j0, c] + p1 * d + p2 * e + p3 * radiance[i2, j3, c])
                    value += q3 * (
                        p0 * radiance[i3, j0, c]
                        + p1 * radiance[i3, j, c]
                        + p2 * radiance[i3, j2, c]
                        + p3 * radiance[i3, j3, c]
                    )
                    out[y, x, c] = min(max(value, min(a, b, d, e)), max(a, b, d, e))
