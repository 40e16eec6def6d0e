"""The loop that spreads every pixel over its disc of confusion, the nearest first, each behind what is before it."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel

LAYER = 4
"""Sizes of discs that are spread together: half a pixel of radius. Within a layer nothing hides anything."""
OPAQUE = 1e-9
"""Of a pixel's view still open when all that is behind is left out."""


@kernel
def _defocus(
    radiance,
    size,
    behind,
    opening,
    deepest,
    lowest,
    first,
    down,
    right,
    change,
    reach,
    widest,
    top,
    bottom,
    left,
    end,
    out,
):
    """Rows top…bottom, columns left…end of a picture out of focus.

    size : (H, W) int16, of every pixel's disc; behind : (H, W) int32, the pixel that stands for what it hides, or −1
    opening : (H, W) bool, whether an edge lies within a pixel's disc; deepest : (sizes,) int32, the last of the sizes
        that count where none does
    lowest, first, down, right, change, reach : of a DiscTable; widest : its largest reach

    Each layer's light and coverage are sums over discs of weight 1. The layers are added front to back, each to what
    is still open, so that connected surfaces close up, however many layers they span. What stays open is divided out.
    Discs of changing size never add up to 1 quite: where no edge is near, what is left open shows nothing behind.
    """
    rows, columns = bottom - top, end - left
    height, width = size.shape
    # The picture goes on as its mirror image.
    source_y, source_x = np.empty(rows + 2 * widest, np.int64), np.empty(columns + 2 * widest, np.int64)
    for i in range(source_y.size):
        y = (top - widest + i) % (2 * height)
        source_y[i] = y if y < height else 2 * height - 1 - y
    for j in range(source_x.size):
        x = (left - widest + j) % (2 * width)
        source_x[j] = x if x < width else 2 * width - 1 - x
    # Sort the pixels whose discs reach this block into layers of depth: count first, then place.
    layers = (reach.size - 1) // LAYER + 1
    begins = np.zeros(layers + 2, np.int64)
    for counting in range(2):
        if counting == 1:
            for layer in range(layers):
                begins[layer + 1] += begins[layer]
            place, pixel = np.empty(begins[layers], np.int64), np.empty(begins[layers], np.int32)
            following = begins.copy()
        else:
            place, pixel, following = np.empty(0, np.int64), np.empty(0, np.int32), begins
        for i in range(source_y.size):
            y = i - widest
            beside_y = -y if y < 0 else (y - rows + 1 if y >= rows else 0)
            for j in range(source_x.size):
                x = j - widest
                beside = max(beside_y, -x if x < 0 else (x - columns + 1 if x >= columns else 0))
                own = source_y[i] * width + source_x[j]
                hidden = behind[source_y[i], source_x[j]]
                for part in range(2):
                    source = own if part == 0 else hidden
                    if source < 0:
                        continue
                    index = size[source // width, source % width] - lowest
                    if reach[index] < beside:
                        continue
                    layer = index // LAYER
                    if counting == 0:
                        begins[layer + 1] += 1
                    else:
                        place[following[layer]], pixel[following[layer]] = i * source_x.size + j, source
                        following[layer] += 1
    # Each layer, front to back: its discs as changes along the rows, ...
    changes, light = np.zeros((rows, columns + 1, 4)), np.zeros((rows, columns, 3))
    covered = np.zeros((rows, columns))
    for layer in range(layers):
        lowest_row, highest_row = rows, 0
        for entry in range(begins[layer], begins[layer + 1]):
            source = pixel[entry]
            v, u = source // width, source % width
            index = size[v, u] - lowest
            y, x = place[entry] // source_x.size - widest, place[entry] % source_x.size - widest
            red, green, blue = float(radiance[v, u, 0]), float(radiance[v, u, 1]), float(radiance[v, u, 2])
            far = reach[index]
            lowest_row, highest_row = min(lowest_row, max(y - far, 0)), max(highest_row, min(y + far + 1, rows))
            for k in range(first[index], first[index + 1]):
                row, column = y + down[k], x + right[k]
                if row < 0 or row >= rows or column >= columns:
                    continue
                column = max(column, 0)
                weight = change[k]
                changes[row, column, 0] += weight * red
                changes[row, column, 1] += weight * green
                changes[row, column, 2] += weight * blue
                changes[row, column, 3] += weight
        # ... summed along the rows, and added to what is still open.
        for y in range(lowest_row, highest_row):
            red, green, blue, cover = 0.0, 0.0, 0.0, 0.0
            for x in range(columns):
                red += changes[y, x, 0]
                green += changes[y, x, 1]
                blue += changes[y, x, 2]
                cover += changes[y, x, 3]
                for c in range(4):
                    changes[y, x, c] = 0
                still_open = 1 - covered[y, x]
                if cover < OPAQUE or still_open < OPAQUE:
                    continue
                if not opening[top + y, left + x] and layer > deepest[size[top + y, left + x] - lowest] // LAYER:
                    continue
                share = 1.0 if cover <= still_open else still_open / cover
                light[y, x, 0] += share * red
                light[y, x, 1] += share * green
                light[y, x, 2] += share * blue
                covered[y, x] += share * cover
    for y in range(rows):
        for x in range(columns):
            for c in range(3):
                # Sums of changes round: light that is not there may be below 0 by that.
                out[top + y, left + x, c] = max(light[y, x, c] / covered[y, x], 0.0)
