"""Kernels that move light between layouts: gathered by target pixels, and what stands out pushed by source pixels.

Each does one step for many cells: small kernels compile quickly, and a projection is compiled once for all uses.
"""

from __future__ import annotations

import numpy as np

from relume._kernel import inlined, kernel
from relume.sphere.layouts import EQUIDISTANT, EQUISOLID, LAT_LONG, ORTHOGRAPHIC
from relume.sphere.mapping_kernels import neighbour, solid_angle, spread

_RUN = 8
"""Pixels along a row that share their number of cells."""
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
def round_caps(light, rows, columns, most, caps, begin, end):
    """Rows of a lat-long near its poles, averaged along themselves over what is a pixel's height there.

    caps : (2·K·columns, 3) of the first and last K rows; begin…end of 2·K
    """
    deep = caps.shape[0] // columns // 2
    for line in range(begin, end):
        row = line if line < deep else rows - 2 * deep + line
        width = 1 / np.sin(np.pi * (row + 0.5) / rows)
        reach = int(np.ceil(width / 2 - 0.5))
        share = width / 2 - reach + 0.5
        start, out = row * columns, line * columns
        for channel in range(3):
            top = most[channel]
            running = 0.0
            for step in range(1 - reach, reach):
                running += min(light[start + step % columns, channel], top)
            for column in range(columns):
                left, right = (column - reach) % columns, (column + reach) % columns
                first, last = min(light[start + left, channel], top), min(light[start + right, channel], top)
                caps[out + column, channel] = (running + share * (np.float64(first) + last)) / width
                leaving = min(light[start + (column + 1 - reach) % columns, channel], top)
                running += np.float64(last) - leaving


@inlined
def _mixed(table, index, below, across, down, channel, top):
    """Bilinear between four neighbours, in a form that gives back constants to the bit."""
    a, b = min(table[index, channel], top), min(table[index + 1, channel], top)
    c, d = min(table[below, channel], top), min(table[below + 1, channel], top)
    upper, lower = a + across * (b - a), c + across * (d - c)
    return upper + down * (lower - upper)


@inlined
def _single(light, caps, index, low, high, channel, top):
    """One pixel of a source; in a lat-long's first and last pixels (below low, from high on) of its caps."""
    if index < low:
        return caps[index, channel]
    if index >= high:
        return caps[index - high + low, channel]
    return min(light[index, channel], top)


@kernel
def divisions(planes, step, line, wide, high):
    """Columns and rows of cells, no more than `step` radians apart, in each run of a line's pixels; cells in all."""
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    middle, count = 2 * (line % rows + 0.5) / rows - 1, 0
    for run in range(len(wide)):
        begin, end = run * _RUN, min(run * _RUN + _RUN, columns)
        # The spread is greatest at one end of a run, or nearly.
        near, near_down = spread(kind, planes.across, planes.down, 2 * (begin + 0.5) / columns - 1, middle)
        far, far_down = spread(kind, planes.across, planes.down, 2 * (end - 0.5) / columns - 1, middle)
        wide[run] = max(1, int(np.ceil(max(near, far) * 2 / (columns * step) - 1e-3)))
        high[run] = max(1, int(np.ceil(max(near_down, far_down) * 2 / (rows * step) - 1e-3)))
        count += wide[run] * high[run] * (end - begin)
    return count


@kernel
def cells(planes, line, wide, high, first_owner, xs, ys, owner, count):
    """Appends a line's cells to `count` (1,) earlier ones; those that a disc does not show are left out."""
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    disc = kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC
    row, place = line % rows, count[0]
    middle = 2 * (row + 0.5) / rows - 1
    for column in range(columns):
        if disc:
            # A pixel whose nearest corner lies beyond the rim shows nothing.
            left = max(abs(column + 0.5 - columns * 0.5) - 0.5, 0.0)
            above = max(abs(row + 0.5 - rows * 0.5) - 0.5, 0.0)
            if left * left + above * above >= rows * rows * 0.25:
                continue
        before, across_many, down_many = place, wide[column // _RUN], high[column // _RUN]
        for j in range(down_many):
            down = 2 * (row + (j + 0.5) / down_many) / rows - 1
            for i in range(across_many):
                across = 2 * (column + (i + 0.5) / across_many) / columns - 1
                if not disc or across * across + down * down <= 1:
                    xs[place], ys[place], owner[place] = across, down, first_owner + column
                    place += 1
        if place == before:
            # None of its cells is on the disc: the nearest point of the rim stands for the sliver that is.
            across = 2 * (column + 0.5) / columns - 1
            shrunk = (1 - 1e-6) / np.sqrt(across * across + middle * middle)
            xs[place], ys[place], owner[place] = across * shrunk, middle * shrunk, first_owner + column
            place += 1
    count[0] = place


@kernel
def weigh(owner, weight, every):
    """Adds the weights of cells to the pixels that own them."""
    for i in range(len(owner)):
        every[owner[i]] += weight[i]


@kernel
def finish(planes, begin, end, first, added, inside, every, least, saturated, radiance, covered, marks):
    """Writes lines begin…end from what was added up for their pixels; returns their total, (3,).

    radiance : (M, 3) float32, the image's pixels
    covered : (M,) float32, the share of each that the source shows; empty where that is 1
    marks : (M,) uint8; empty where nothing is known
    """
    kind, rows, columns, stride, origins = planes.kind, planes.rows, planes.columns, planes.stride, planes.origins
    total = np.zeros(3)
    for line in range(begin, end):
        row = line % rows
        start = origins[line // rows] + row * stride
        ring = solid_angle(kind, planes.across, planes.down, rows, columns, row, row) if kind == LAT_LONG else 0.0
        one, two, three = 0.0, 0.0, 0.0
        for column in range(columns):
            index, own = start + column, (line - begin) * columns + column
            if every[own] == 0:
                continue
            scale = _ONE / max(inside[own], np.float32(1e-30))
            share = inside[own] / every[own]
            a = max((first[own, 0] + added[own, 0] * scale) * share, np.float32(0))
            b = max((first[own, 1] + added[own, 1] * scale) * share, np.float32(0))
            c = max((first[own, 2] + added[own, 2] * scale) * share, np.float32(0))
            radiance[index, 0], radiance[index, 1], radiance[index, 2] = a, b, c
            if len(covered) > 0:
                covered[index] = share
            if len(marks) > 0:
                marks[index] = 1 if saturated[own] else least[own]
            angle = ring
            if kind != LAT_LONG:
                angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, column)
            one, two, three = one + a * angle, two + b * angle, three + c * angle
        total[0], total[1], total[2] = total[0] + one, total[1] + two, total[2] + three
    return total


@kernel
def settle(source, plane, xs, ys, owner, weight, light, caps, most, first, added, inside):
    """Looks cells up in a source and adds them to the pixels that own them.

    light : (N, 3) float32, the source's pixels, of which no more than `most` (3,) is seen
    caps : see `round_caps`; empty where the source is no lat-long
    first, added, inside : the first value found, what others differ from it by, weighted, and the sum of weights
    """
    kind, across, down, rows, columns = source.kind, source.across, source.down, source.rows, source.columns
    stride, origins, frames, whole = source.stride, source.origins, source.frames, source.whole
    disc = kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC
    deep = caps.shape[0] // columns // 2
    low, high = deep * columns, (rows - deep) * columns
    safe = (1 - 3.0 / rows) * abs(1 - 3.0 / rows)
    half_columns, half_rows = np.float32(columns / 2), np.float32(rows / 2)
    red, green, blue = most[0], most[1], most[2]
    for i in range(len(xs)):
        p = plane[i]
        if p < 0:
            continue
        x, y = (xs[i] + _ONE) * half_columns - _HALF, (ys[i] + _ONE) * half_rows - _HALF
        column, row = int(np.floor(x)), int(np.floor(y))
        right, below = x - np.float32(column), y - np.float32(row)
        plain = column >= 0 and column + 1 < columns and row >= 0 and row + 1 < rows
        if disc and xs[i] * xs[i] + ys[i] * ys[i] > safe:
            plain = False
        if plain and row >= deep and row + 1 < rows - deep:
            index = origins[p] + row * stride + column
            one = _mixed(light, index, index + stride, right, below, 0, red)
            two = _mixed(light, index, index + stride, right, below, 1, green)
            three = _mixed(light, index, index + stride, right, below, 2, blue)
        elif plain and (row + 1 < deep or row >= rows - deep):
            index = row * columns + column
            index = index if row < deep else index - high + low
            one = _mixed(caps, index, index + stride, right, below, 0, red)
            two = _mixed(caps, index, index + stride, right, below, 1, green)
            three = _mixed(caps, index, index + stride, right, below, 2, blue)
        else:
            one, two, three = np.float32(0), np.float32(0), np.float32(0)
            corners = np.empty((4, 3), np.float32)
            for k in range(4):
                index = neighbour(
                    kind, across, down, rows, columns, stride, origins, frames, whole, p, row + k // 2, column + k % 2
                )
                if deep > 0:
                    corners[k, 0] = _single(light, caps, index, low, high, 0, red)
                    corners[k, 1] = _single(light, caps, index, low, high, 1, green)
                    corners[k, 2] = _single(light, caps, index, low, high, 2, blue)
                else:
                    corners[k, 0] = min(light[index, 0], red)
                    corners[k, 1] = min(light[index, 1], green)
                    corners[k, 2] = min(light[index, 2], blue)
            one = _mixed(corners, 0, 2, right, below, 0, red)
            two = _mixed(corners, 0, 2, right, below, 1, green)
            three = _mixed(corners, 0, 2, right, below, 2, blue)
        own = owner[i]
        if inside[own] == 0:
            first[own, 0], first[own, 1], first[own, 2] = one, two, three
        share = weight[i]
        inside[own] += share
        added[own, 0] += share * (one - first[own, 0])
        added[own, 1] += share * (two - first[own, 1])
        added[own, 2] += share * (three - first[own, 2])


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


@kernel
def bright(planes, light, most, peaks, places, flux):
    """Pixels with light above `most`: fills places (K, 3) plane, row, column and flux (K, 3); returns how many."""
    kind, rows, columns = planes.kind, planes.rows, planes.columns
    count = 0
    for line in range(rows * len(planes.origins)):
        if peaks[line, 0] <= most[0] and peaks[line, 1] <= most[1] and peaks[line, 2] <= most[2]:
            continue
        plane, row = line // rows, line % rows
        start = planes.origins[plane] + row * planes.stride
        for column in range(columns):
            index = start + column
            if light[index, 0] <= most[0] and light[index, 1] <= most[1] and light[index, 2] <= most[2]:
                continue
            angle = solid_angle(kind, planes.across, planes.down, rows, columns, row, column)
            if angle == 0:
                continue
            if count < len(places):
                places[count, 0], places[count, 1], places[count, 2] = plane, row, column
                for channel in range(3):
                    flux[count, channel] = max(light[index, channel] - most[channel], np.float32(0)) * angle
            count += 1
    return count


@kernel
def tents(across, down, half_width, half_height, many, many_down, xs, ys, share, owner):
    """Cells over tents round points, with shares that sum to 1 for each."""
    place = 0
    for i in range(len(across)):
        begin, whole = place, 0.0
        for j in range(many_down[i]):
            below = 2 * (j + 0.5) / many_down[i] - 1
            for k in range(many[i]):
                right = 2 * (k + 0.5) / many[i] - 1
                xs[place], ys[place] = across[i] + right * half_width[i], down[i] + below * half_height[i]
                share[place], owner[place] = (1 - abs(right)) * (1 - abs(below)), i
                whole += share[place]
                place += 1
        for k in range(begin, place):
            share[k] /= whole


@kernel
def deposit(target, plane, xs, ys, share, owner, flux, radiance):
    """Shares the owners' flux out among the four pixels round each cell, as a bilinear look-up there would ask them."""
    kind, rows, columns = target.kind, target.rows, target.columns
    for i in range(len(xs)):
        if plane[i] < 0:
            continue
        x, y = (xs[i] + _ONE) * np.float32(columns / 2) - _HALF, (ys[i] + _ONE) * np.float32(rows / 2) - _HALF
        column, row = int(np.floor(x)), int(np.floor(y))
        right, below = x - column, y - row
        for k in range(4):
            if not target.whole and not (0 <= column + k % 2 < columns and 0 <= row + k // 2 < rows):
                continue
            index = neighbour(
                kind, target.across, target.down, rows, columns, target.stride, target.origins, target.frames,
                target.whole, plane[i], row + k // 2, column + k % 2,
            )  # fmt: skip
            # The pixel may have been found on another plane.
            place = index - target.origins[plane[i]]
            for p in range(len(target.origins)):
                other = index - target.origins[p]
                if other >= 0 and other % target.stride < columns and other // target.stride < rows:
                    place = other
            angle = solid_angle(
                kind, target.across, target.down, rows, columns, place // target.stride, place % target.stride
            )
            if angle > 0:
                part = share[i] * (right if k % 2 else 1 - right) * (below if k // 2 else 1 - below) / angle
                for channel in range(3):
                    radiance[index, channel] += flux[owner[i], channel] * part
