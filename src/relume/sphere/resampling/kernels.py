"""Kernels that gather light by target pixels.

Each does one step for many cells: small kernels compile quickly, and a projection is compiled once for all uses.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel
from relume.sphere.mappings.kernels import FINE, RIM, neighbour, solid_angle, spread
from relume.sphere.mappings.layouts import EQUIDISTANT, EQUISOLID, LAT_LONG, ORTHOGRAPHIC
from relume.sphere.vector_steps import ask_for, between_four

RUN = 16
"""Pixels along a row that share their number of cells."""
SHARED = 4
"""Lines that share it."""
AHEAD = 64
"""Cells from one that is looked up to one whose pixels are asked for: a map is larger than what a core keeps."""
_HALF, _ONE = np.float32(0.5), np.float32(1)


@kernel
def sums(planes, light, begin, end, peaks):
    """Σ radiance × solid angle of lines begin…end and Σ solid angle, (4,); fills `peaks` (lines, 3), their maxima."""
    kind, rows, columns, stride, origins = planes.kind, planes.rows, planes.columns, planes.stride, planes.origins
    total = np.zeros(4)
    for line in range(begin, end):
        plane, row = line // rows, line % rows
        start = origins[plane] + row * stride
        one, two, three, shown = 0.0, 0.0, 0.0, 0.0
        p, q, r = np.float32(0), np.float32(0), np.float32(0)
        if kind == LAT_LONG:
            for i in range(start, start + columns):
                a, b, c = light[i, 0], light[i, 1], light[i, 2]
                one, two, three = one + a, two + b, three + c
                p, q, r = max(p, a), max(q, b), max(r, c)
            angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, row)
            one, two, three, shown = one * angle, two * angle, three * angle, angle * columns
        else:
            for column in range(columns):
                i = start + column
                angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, column)
                if angle > 0:
                    shown += angle
                    a, b, c = light[i, 0], light[i, 1], light[i, 2]
                    one, two, three = one + a * angle, two + b * angle, three + c * angle
                    p, q, r = max(p, a), max(q, b), max(r, c)
        total[0], total[1], total[2] = total[0] + one, total[1] + two, total[2] + three
        total[3] += shown
        peaks[line, 0], peaks[line, 1], peaks[line, 2] = p, q, r
    return total


@kernel
def round_caps(light, rows, columns, caps, begin, end):
    """Rows of a lat-long near its poles, averaged along themselves over what is a pixel's height there.

    caps : (2·K·columns, 3) of the first and last K rows; begin…end of 2·K
    """
    deep = caps.shape[0] // columns // 2
    band = np.empty((3 * columns, 3), np.float32)
    for line in range(begin, end):
        row = line if line < deep else rows - 2 * deep + line
        width = 1 / np.sin(np.pi * (row + 0.5) / rows)
        reach = int(np.ceil(width / 2 - 0.5))
        share = width / 2 - reach + 0.5
        start, out, length = row * columns, line * columns, columns + 2 * reach
        band[:reach] = light[start + columns - reach : start + columns]
        band[reach : reach + columns] = light[start : start + columns]
        band[reach + columns : length] = light[start : start + reach]
        one, two, three = 0.0, 0.0, 0.0
        for i in range(1, 2 * reach):
            one, two, three = one + band[i, 0], two + band[i, 1], three + band[i, 2]
        # Three running sums, so that none waits for itself.
        scale, double = 1 / width, np.float64
        old_one, old_two, old_three = double(band[0, 0]), double(band[0, 1]), double(band[0, 2])
        for i in range(columns):
            last, after, into = np.uint64(i + 2 * reach), np.uint64(i + 1), np.uint64(out + i)
            new_one, new_two, new_three = double(band[last, 0]), double(band[last, 1]), double(band[last, 2])
            caps[into, 0] = (one + share * (old_one + new_one)) * scale
            caps[into, 1] = (two + share * (old_two + new_two)) * scale
            caps[into, 2] = (three + share * (old_three + new_three)) * scale
            old_one, old_two, old_three = double(band[after, 0]), double(band[after, 1]), double(band[after, 2])
            one, two, three = one + (new_one - old_one), two + (new_two - old_two), three + (new_three - old_three)


@kernel
def divisions(planes, step, begin, wide, high, counts):
    """Columns and rows of cells, about `step` radians apart, in each run of a line's pixels, and cells a line.

    begin : the first line
    wide, high : (lines, runs), filled
    counts : (lines,), filled
    """
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    counts[:] = 0
    for line in range(len(wide)):
        row = (begin + line) % rows
        if line % SHARED and row % SHARED:
            # A few lines share what one has: at a distance of so few pixels it is nearly the same.
            wide[line], high[line], counts[line] = wide[line - 1], high[line - 1], counts[line - 1]
            continue
        middle = 2 * (row + 0.5) / rows - 1
        for run in range(wide.shape[1]):
            first, last = run * RUN, min(run * RUN + RUN, columns)
            # The spread is greatest at one end of a run, or nearly.
            near, near_down = spread(kind, planes.across, planes.down, rows, 2 * (first + 0.5) / columns - 1, middle)
            far, far_down = spread(kind, planes.across, planes.down, rows, 2 * (last - 0.5) / columns - 1, middle)
            wide[line, run] = max(1, int(np.ceil(max(near, far) * 2 / (columns * step) - 1e-3)))
            high[line, run] = max(1, int(np.ceil(max(near_down, far_down) * 2 / (rows * step) - 1e-3)))
            counts[line] += wide[line, run] * high[line, run] * (last - first)


@kernel
def cells(planes, begin, end, wide, high, xs, ys, owner, parts):
    """Fills the cells of lines begin…end, but for those that a disc does not show; returns how many there are.

    wide, high : (lines, runs), of `divisions`; pixels own cells by their place in these lines
    parts : of how many cells a pixel would be, each owner's; 0 where it shows nothing
    """
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    disc = kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC
    place, own, edge = 0, 0, rows * rows * 0.25
    for line in range(end - begin):
        row = (begin + line) % rows
        for run in range(wide.shape[1]):
            across_many, down_many = wide[line, run], high[line, run]
            many, step, step_down = across_many * down_many, 2 / (columns * across_many), 2 / (rows * down_many)
            top = 2 * row / rows - 1 + 0.5 * step_down
            first_column, last_column = run * RUN, min(run * RUN + RUN, columns)
            # Whether the rim comes near any of the run's pixels.
            far = max(abs(first_column - columns * 0.5), abs(last_column - columns * 0.5))
            off = abs(row + 0.5 - rows * 0.5)
            rim = disc and far * far + (off + 0.5) * (off + 0.5) > edge
            for column in range(first_column, last_column):
                own += 1
                cut = False
                if rim:
                    # A pixel whose nearest corner lies beyond the rim shows nothing.
                    middle = abs(column + 0.5 - columns * 0.5)
                    left, above = max(middle - 0.5, 0.0), max(off - 0.5, 0.0)
                    if left * left + above * above >= edge:
                        parts[own - 1] = 0
                        continue
                    cut = (middle + 0.5) * (middle + 0.5) + (off + 0.5) * (off + 0.5) > edge
                parts[own - 1] = many
                before, first = place, 2 * column / columns - 1 + 0.5 * step
                for j in range(down_many):
                    down = top + j * step_down
                    for i in range(across_many):
                        across = first + i * step
                        if not cut or across * across + down * down <= 1:
                            at = np.uint64(place)
                            xs[at], ys[at], owner[at] = across, down, own - 1
                            place += 1
                if place == before:
                    # None of its cells is on the disc: the nearest point of the rim stands for the sliver that is.
                    across, down = 2 * (column + 0.5) / columns - 1, 2 * (row + 0.5) / rows - 1
                    shrunk = (1 - 1e-6) / np.sqrt(across * across + down * down)
                    xs[place], ys[place], owner[place] = across * shrunk, down * shrunk, own - 1
                    place += 1
    return place


@kernel
def locate(source, deep, plane, xs, ys, place):
    """Turns points into places between pixels: `place` is where the upper left of the four begins, `xs` and `ys` how
    far to the right and below it the point lies.

    deep : rows of a lat-long that `round_caps` averaged near each pole
    place : −1 where the source shows nothing; −2 − n near a plane's edge, rim or seam, where n counts the pixels of
        planes that are one wider all round; from the number of the source's values on, a place in its caps
    """
    kind, rows, columns, stride, origins = source.kind, source.rows, source.columns, source.stride, source.origins
    disc = kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC
    safe = np.float32((1 - 3.0 / rows) * abs(1 - 3.0 / rows)) if disc else np.float32(4)
    half_columns, half_rows = np.float32(columns / 2), np.float32(rows / 2)
    behind = 3 * rows * columns
    gap = 3 * (rows - 2 * deep) * columns
    for i in range(len(xs)):
        x, y = (xs[i] + _ONE) * half_columns - _HALF, (ys[i] + _ONE) * half_rows - _HALF
        near = xs[i] * xs[i] + ys[i] * ys[i] <= safe
        across, down = np.floor(x), np.floor(y)
        xs[i], ys[i] = x - across, y - down
        # By 32 bits, which vector instructions convert; a row has no more pixels, and a column neither.
        column, row = np.int64(np.int32(across)), np.int64(np.int32(down))
        near = near and column >= 0 and column + 1 < columns and row >= 0 and row + 1 < rows
        near = near and row + 1 != deep and row + 1 != rows - deep
        index = 3 * (row * stride + column)
        if deep > 0:
            index = index + behind if row < deep else index
            index = index + behind - gap if row >= rows - deep else index
        beyond = -2 - ((row + 1) * (columns + 2) + column + 1)
        place[i] = index if near else beyond
    if len(origins) > 1 or not source.whole:
        for i in range(len(xs)):
            if plane[i] < 0:
                place[i] = -1
            elif place[i] >= 0:
                place[i] += 3 * origins[plane[i]]


@kernel
def across_edges(source, plane, place, light, caps):
    """The neighbours (M, 12) of places near an edge, rim or seam, upper left first; of such n is now which of them."""
    rows, columns = source.rows, source.columns
    deep = len(caps) // columns // 6
    low, high = deep * columns, (rows - deep) * columns
    count = 0
    for i in range(len(place)):
        count += place[i] < -1
    beyond, count = np.empty((count, 12), np.float32), 0
    for i in range(len(place)):
        if place[i] >= -1:
            continue
        row, column = (-2 - place[i]) // (columns + 2) - 1, (-2 - place[i]) % (columns + 2) - 1
        for k in range(4):
            index = neighbour(
                source.kind, source.across, source.down, rows, columns, source.stride, source.origins, source.frames,
                source.whole, plane[i], row + k // 2, column + k % 2,
            )  # fmt: skip
            for channel in range(3):
                if deep > 0 and index < low:
                    beyond[count, 3 * k + channel] = caps[3 * index + channel]
                elif deep > 0 and index >= high:
                    beyond[count, 3 * k + channel] = caps[3 * (index - high + low) + channel]
                else:
                    beyond[count, 3 * k + channel] = light[3 * index + channel]
        place[i] = -2 - count
        count += 1
    return beyond


@kernel
def settle(stride, place, xs, ys, owner, weight, light, caps, beyond, values, inside, every):
    """Looks cells up in a source; their weighted means and the sums of their weights go to the pixels that own them.

    stride : columns of the source
    owner : of one pixel's cells, one behind the other
    light : (3·N,) float32, the source's pixels
    caps : see `round_caps`, flat; empty where the source is no lat-long
    beyond : of `across_edges`
    values : (K, 3) float32, the mean of what the source shows
    inside, every : (K,) float32, the weights of the cells that the source shows, and of all
    """
    channels, count = len(light), len(xs)
    # Signed addresses: with unsigned ones numbers that may be below 0 are added in floating point.
    pixels, averaged = np.int64(light.ctypes.data), np.int64(caps.ctypes.data) - 4 * channels
    edges, below = np.int64(beyond.ctypes.data), np.int64(12 * stride)
    i = 0
    while i < count:
        # Unsigned, so that no index is asked whether it counts from the end.
        own, shown, total = owner[np.uint64(i)], np.float32(0), np.float32(0)
        first_one, first_two, first_three = np.float32(0), np.float32(0), np.float32(0)
        more_one, more_two, more_three = np.float32(0), np.float32(0), np.float32(0)
        while i < count and owner[np.uint64(i)] == own:
            at = np.uint64(i)
            share, where, later = weight[at], place[at], place[np.uint64(min(i + AHEAD, count - 1))]
            soon = (pixels if later < channels else averaged) + 4 * later
            ask_for(soon)
            ask_for(soon + below)
            total += share
            if where != -1:
                # The cell's colour: from the source's pixels, from the round caps at its poles, or across an edge.
                upper = (pixels if where < channels else averaged) + 4 * where
                lower = upper + below
                if where < 0:
                    upper = edges + 48 * (-2 - where)
                    lower = upper + 24
                one, two, three = between_four(upper, lower, xs[at], ys[at])
                # Weighted sums of the differences from the pixel's first cell, which keep more digits.
                if shown == 0:
                    first_one, first_two, first_three = one, two, three
                shown += share
                more_one += share * (one - first_one)
                more_two += share * (two - first_two)
                more_three += share * (three - first_three)
            i += 1
        # The pixel's mean, which is never below 0.
        scale, mine = _ONE / max(shown, np.float32(1e-30)), np.uint64(own)
        values[mine, 0] = max(first_one + more_one * scale, np.float32(0))
        values[mine, 1] = max(first_two + more_two * scale, np.float32(0))
        values[mine, 2] = max(first_three + more_three * scale, np.float32(0))
        inside[mine], every[mine] = shown, total


@kernel
def finish(planes, begin, end, values, inside, every, parts, least, saturated, radiance, covered, marks):
    """Writes lines begin…end from what was found for their pixels; returns their total, (3,).

    radiance : (M, 3) float32, the image's pixels
    covered : (M,) float32, the share of each that the source shows; empty where that is 1
    marks : (M,) uint8; empty where nothing is known
    """
    kind, rows, columns, stride, origins = planes.kind, planes.rows, planes.columns, planes.stride, planes.origins
    disc = kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC
    rim = RIM if kind == ORTHOGRAPHIC else 2
    total = np.zeros(3)
    for line in range(begin, end):
        row = line % rows
        start = origins[line // rows] + row * stride
        ring = solid_angle(kind, planes.across, planes.down, rows, columns, row, row) if kind == LAT_LONG else 0.0
        above, most = (2 * (row + 0.5) / rows - 1) ** 2, (1 - 2 * rim / rows) * abs(1 - 2 * rim / rows)
        pitch, cell = 2 / columns, 4.0 / (rows * columns)
        one, two, three = 0.0, 0.0, 0.0
        first = (line - begin) * columns
        for column in range(columns):
            index, own = np.uint64(start + column), np.uint64(first + column)
            if parts[own] == 0 or every[own] == 0:
                radiance[index, 0], radiance[index, 1], radiance[index, 2] = 0, 0, 0
                continue
            a, b, c = values[own, 0], values[own, 1], values[own, 2]
            if len(covered) > 0:
                share = inside[own] / every[own]
                a, b, c = a * share, b * share, c * share
                covered[index] = share
            radiance[index, 0], radiance[index, 1], radiance[index, 2] = a, b, c
            if len(marks) > 0:
                marks[index] = 1 if saturated[own] else least[own]
            angle = ring
            if kind != LAT_LONG:
                # Of fine images the densities at the cells are good enough, but not where a rim cuts pixels.
                if columns >= FINE and not (disc and above + ((column + 0.5) * pitch - 1) ** 2 > most):
                    angle = every[own] / parts[own] * cell
                else:
                    angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, column)
            one, two, three = one + a * angle, two + b * angle, three + c * angle
        total[0], total[1], total[2] = total[0] + one, total[1] + two, total[2] + three
    return total


@kernel
def mark(source, plane, xs, ys, owner, codes, least, saturated):
    """What the pixels under cells are marked with: any that is SATURATED, else the least of the nearest ones."""
    for i in range(len(xs)):
        p, own = plane[i], owner[i]
        if p < 0:
            least[own] = min(least[own], 3)
            continue
        x, y = (xs[i] + _ONE) * source.columns * _HALF - _HALF, (ys[i] + _ONE) * source.rows * _HALF - _HALF
        column, row = int(np.floor(x)), int(np.floor(y))
        right, below = x - column, y - row
        nearest = (2 if below > 0.5 else 0) + (1 if right > 0.5 else 0)
        for k in range(4):
            index = neighbour(
                source.kind, source.across, source.down, source.rows, source.columns, source.stride, source.origins,
                source.frames, source.whole, p, row + k // 2, column + k % 2,
            )  # fmt: skip
            share = (right if k % 2 else 1 - right) * (below if k // 2 else 1 - below)
            if codes[index] == 1 and share > 1e-3:
                saturated[own] = 1
            if k == nearest:
                least[own] = min(least[own], codes[index])


@kernel
def scaled(radiance, scale, begin, end):
    """Multiplies channels in place."""
    one, two, three = scale[0], scale[1], scale[2]
    for i in range(begin, end):
        radiance[i, 0] *= one
        radiance[i, 1] *= two
        radiance[i, 2] *= three
