"""Kernels that push flux from single pixels of a source to the target's."""

from __future__ import annotations

import numpy as np

from relume._kernel import kernel
from relume.sphere.mappings.kernels import neighbour, solid_angle

_HALF, _ONE = np.float32(0.5), np.float32(1)


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
