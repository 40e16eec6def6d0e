"""Kernel: what a perspective view shows in the pixels of a lat-long map."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel
from relume.image.radiance import OUTSIDE, SATURATED


@kernel
def view_in_rows(picture, codes, lens, rotation, latitudes, longitudes, begin, end, rows, cells, shown):
    """Mean radiance and more of rows begin … end of a map of `rows` rows, from cells² look-ups in each pixel.

    picture : (H, W, 3) float32
    codes : (H, W) uint8, as of `RadianceMap.clipped`
    lens : focal length, distortion, square of the tangent at which the picture ends, and the cosine of the angle from
        the axis beyond which no middle of a pixel sees any of it
    rotation : (3, 3) world-from-camera
    latitudes : (rows·cells, 2) sine and cosine of the cells' angles from +Y
    longitudes : (2·rows·cells, 2) sine and cosine of the cells' longitudes
    shown : (end − begin, 2·rows, 6) float32, filled with radiance, the share of it that is saturated, the share of the
        pixel that the view covers, and the mean distance from the rim, pixels; 0 where nothing is seen
    """
    height, width = picture.shape[0], picture.shape[1]
    focal_length, distortion, widest, far = lens[0], lens[1], lens[2], lens[3]
    middle = cells // 2
    for row in range(begin, end):
        for column in range(2 * rows):
            # Most pixels of the map are far from the view: one look decides.
            ring, up = latitudes[row * cells + middle, 0], latitudes[row * cells + middle, 1]
            place = column * cells + middle
            x, z = ring * longitudes[place, 0], -ring * longitudes[place, 1]
            if -(x * rotation[0, 2] + up * rotation[1, 2] + z * rotation[2, 2]) < far:
                continue
            # The mean over the cells of the map's pixel, each weighed by its solid angle.
            red = green = blue = saturated = covered = whole = rim = 0.0
            for down in range(cells):
                ring, up = latitudes[row * cells + down, 0], latitudes[row * cells + down, 1]
                for across in range(cells):
                    whole += ring
                    place = column * cells + across
                    x, z = ring * longitudes[place, 0], -ring * longitudes[place, 1]
                    depth = -(x * rotation[0, 2] + up * rotation[1, 2] + z * rotation[2, 2])
                    if depth <= 1e-6:
                        continue
                    # Where the lens shows this direction.
                    right = (x * rotation[0, 0] + up * rotation[1, 0] + z * rotation[2, 0]) / depth
                    above = (x * rotation[0, 1] + up * rotation[1, 1] + z * rotation[2, 1]) / depth
                    square = right * right + above * above
                    if square >= widest:
                        continue
                    bent = focal_length * (1 + distortion * square)
                    px, py = width / 2 + bent * right, height / 2 - bent * above
                    inner = min(min(px, width - px), min(py, height - py))
                    if inner < 0:
                        continue
                    # Bilinear look-up; a cell that touches what is outside counts as not covered.
                    px, py = min(max(px - 0.5, 0.0), width - 1.0), min(max(py - 0.5, 0.0), height - 1.0)
                    left, top = min(int(px), max(width - 2, 0)), min(int(py), max(height - 2, 0))
                    beside, below = min(left + 1, width - 1), min(top + 1, height - 1)
                    fx, fy = px - left, py - top
                    a, b, c, d = (1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy
                    ca, cb, cc, cd = codes[top, left], codes[top, beside], codes[below, left], codes[below, beside]
                    if ca == OUTSIDE or cb == OUTSIDE or cc == OUTSIDE or cd == OUTSIDE:
                        continue
                    covered += ring
                    rim += ring * inner
                    saturated += ring * (
                        a * (ca == SATURATED) + b * (cb == SATURATED) + c * (cc == SATURATED) + d * (cd == SATURATED)
                    )
                    red += ring * (
                        a * picture[top, left, 0] + b * picture[top, beside, 0]
                        + c * picture[below, left, 0] + d * picture[below, beside, 0]
                    )  # fmt: skip
                    green += ring * (
                        a * picture[top, left, 1] + b * picture[top, beside, 1]
                        + c * picture[below, left, 1] + d * picture[below, beside, 1]
                    )  # fmt: skip
                    blue += ring * (
                        a * picture[top, left, 2] + b * picture[top, beside, 2]
                        + c * picture[below, left, 2] + d * picture[below, beside, 2]
                    )  # fmt: skip
            # Colour, share saturated, share covered, and the distance from the picture's rim.
            out = row - begin
            share = 1 / covered if covered > 0 else 0.0
            shown[out, column, 0], shown[out, column, 1] = red * share, green * share
            shown[out, column, 2] = blue * share
            shown[out, column, 3], shown[out, column, 4] = saturated * share, covered / whole
            shown[out, column, 5] = rim * share


@kernel
def add_view(shown, cost, begin, rows, ramp, total, weight, bound):
    """Add what a view shows to the mean of all, by its weight; of what is saturated keep the highest bound.

    cost : (C + 2, 2C + 2) float32, the view's cost on a coarse map with one more cell on every side; weights are
        exp(−cost)
    ramp : pixels from the rim over which the weight rises
    total, bound : (rows of the strip, 2·rows, 3) float64
    weight : (rows of the strip, 2·rows) float64
    """
    coarse = cost.shape[0] - 2
    for out in range(shown.shape[0]):
        y = (begin + out + 0.5) / rows * coarse + 0.5
        top = min(int(y), coarse)
        fy = y - top
        for column in range(shown.shape[1]):
            if shown[out, column, 4] <= 0:
                continue
            if shown[out, column, 3] > 0:
                for channel in range(3):
                    bound[out, column, channel] = max(bound[out, column, channel], shown[out, column, channel])
                continue
            x = (column + 0.5) / (2 * rows) * 2 * coarse + 0.5
            left = min(int(x), 2 * coarse)
            fx = x - left
            height = (cost[top, left] * (1 - fx) + cost[top, left + 1] * fx) * (1 - fy) + (
                cost[top + 1, left] * (1 - fx) + cost[top + 1, left + 1] * fx
            ) * fy
            share = np.exp(-height) * shown[out, column, 4] * min(max(shown[out, column, 5] / ramp, 1e-3), 1.0)
            weight[out, column] += share
            for channel in range(3):
                total[out, column, channel] += share * shown[out, column, channel]
