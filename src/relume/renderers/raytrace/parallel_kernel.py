"""The loop below `parallel_light`: points in cells across the light, and triangles that ask them.

Heights, bounds and planes are of float32 and widened by what that rounds; a point that none of them clears is put to
the test of `kernel`, in double precision.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, exact_small
from relume.renderers.raytrace.kernel import _meet_triangle as meet_triangle
from relume.renderers.raytrace.kernel import _shear_along as shear_along

CLUSTER = 64
"""Triangles that are passed over together where no point lies below them."""
IN_CELL = 2
"""Points of a cell, about."""
BLOCK = 16
"""Points that are asked at once, by vector instructions."""
STEEP = 50.0
"""Slope of a plane from which on its highest corner stands for it."""
MARGIN = np.float32(2e-6)
"""Of the largest coordinate: bounds in float32 are off by a quarter of it."""


@exact_kernel
def hide(corners, columns, boxes, points, direction, hidden):
    """Mark the points that lie in the shadow of a triangle."""
    count = len(points)
    if count == 0:
        return
    axes, _, shear = shear_along((0.0, 0.0, 0.0), (direction[0], direction[1], direction[2]))
    x, y, z = axes
    sx, sy, up = np.float32(shear[0]), np.float32(shear[1]), np.float32(1 if shear[2] > 0 else -1)
    # The points along the light: across it (a, b), and how far towards it.
    across, along, height = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    low_a, low_b, high_a, high_b = np.float32(np.inf), np.float32(np.inf), np.float32(-np.inf), np.float32(-np.inf)
    largest = np.float32(1e-30)
    for i in range(count):
        across[i] = points[i, x] - shear[0] * points[i, z]
        along[i] = points[i, y] - shear[1] * points[i, z]
        height[i] = up * points[i, z]
        low_a, high_a = min(low_a, across[i]), max(high_a, across[i])
        low_b, high_b = min(low_b, along[i]), max(high_b, along[i])
        largest = max(largest, abs(height[i]))
    for i in range(len(boxes)):
        for k in range(6):
            largest = max(largest, abs(boxes[i, k]))
    margin = MARGIN * max(largest, -low_a, high_a, -low_b, high_b)
    # Sorted into cells, a row of cells is one stretch of them.
    width, depth, share = high_a - low_a, high_b - low_b, np.float32(IN_CELL) / np.float32(count)
    per = 1 / max(np.sqrt(width * depth * share), max(width, depth) * share, margin)
    wide, tall = cell_of(high_a, low_a, per) + 1, cell_of(high_b, low_b, per) + 1
    begins, lowest = np.zeros(wide * tall + 2, np.int32), np.full(wide * tall, np.float32(np.inf))
    cells, place = np.empty(count, np.int32), np.empty(count, np.int32)
    for i in range(count):
        cell = cell_of(along[i], low_b, per) * wide + cell_of(across[i], low_a, per)
        cells[i] = cell
        begins[cell + 2] += 1
        lowest[cell] = min(lowest[cell], height[i])
    for cell in range(2, len(begins)):
        begins[cell] += begins[cell - 1]
    a, b = np.empty(count + BLOCK, np.float32), np.empty(count + BLOCK, np.float32)
    h = np.full(count + BLOCK, np.float32(np.inf))
    for i in range(count):
        j = begins[cells[i] + 1]
        begins[cells[i] + 1] = j + 1
        place[j], a[j], b[j], h[j] = i, across[i], along[i], height[i]
    a[count:], b[count:] = 0, 0
    # Of a cluster's triangles: bounds across the light, the highest corner, the plane through it, and cells.
    bounds = np.empty((14, CLUSTER), np.float32)
    a0, a1, b0, b1, top, at_a, at_b, slope_a, slope_b, side_ua, side_ub, side_va, side_vb, sense = bounds
    slack = np.empty(CLUSTER, np.float32)
    first, last = np.empty(CLUSTER, np.int32), np.empty(CLUSTER, np.int32)
    upper, lower = np.empty(CLUSTER, np.int32), np.empty(CLUSTER, np.int32)
    ax, ay, az, bx, by, bz = columns[x], columns[y], columns[z], columns[x + 3], columns[y + 3], columns[z + 3]
    cx, cy, cz = columns[x + 6], columns[y + 6], columns[z + 6]
    steep = np.float32(STEEP)
    for cluster in range(len(boxes)):
        # Whether any point lies below the cluster.
        lz, hz = boxes[cluster, z], boxes[cluster, z + 3]
        left = boxes[cluster, x] - max(sx * lz, sx * hz) - margin
        right = boxes[cluster, x + 3] - min(sx * lz, sx * hz) + margin
        front = boxes[cluster, y] - max(sy * lz, sy * hz) - margin
        back = boxes[cluster, y + 3] - min(sy * lz, sy * hz) + margin
        if right < low_a or left > high_a or back < low_b or front > high_b:
            continue
        most, deepest = (hz if up > 0 else -lz) + margin, np.float32(np.inf)
        begin_a, end_a = cell_of(max(left, low_a), low_a, per), cell_of(min(right, high_a), low_a, per)
        begin_b, end_b = cell_of(max(front, low_b), low_b, per), cell_of(min(back, high_b), low_b, per)
        for row in range(begin_b, end_b + 1):
            for cell in range(row * wide + begin_a, row * wide + end_a + 1):
                deepest = min(deepest, lowest[cell])
        if deepest >= most:
            continue
        begin = cluster * CLUSTER
        size = min(CLUSTER, len(corners) - begin)
        for i in range(size):
            k = begin + i
            a1_, a2_, a3_ = ax[k] - sx * az[k], bx[k] - sx * bz[k], cx[k] - sx * cz[k]
            b1_, b2_, b3_ = ay[k] - sy * az[k], by[k] - sy * bz[k], cy[k] - sy * cz[k]
            h1_, h2_, h3_ = up * az[k], up * bz[k], up * cz[k]
            a0[i], a1[i] = min(a1_, a2_, a3_) - margin, max(a1_, a2_, a3_) + margin
            b0[i], b1[i] = min(b1_, b2_, b3_) - margin, max(b1_, b2_, b3_) + margin
            first[i] = cell_of(max(a0[i], low_a), low_a, per)
            last[i] = cell_of(min(a1[i], high_a), low_a, per)
            upper[i] = cell_of(max(b0[i], low_b), low_b, per)
            lower[i] = cell_of(min(b1[i], high_b), low_b, per)
            # The plane; of one that is seen nearly edge-on its highest corner.
            highest = max(h1_, h2_, h3_) + margin
            u, v, w, q = a2_ - a1_, b2_ - b1_, a3_ - a1_, b3_ - b1_
            rise, other = h2_ - h1_, h3_ - h1_
            area = u * q - v * w
            inverse = 1 / area
            pa, pb = (rise * q - v * other) * inverse, (u * other - rise * w) * inverse
            # Rounding of the differences, as slopes and area make it grow.
            spread = max(a1[i] - a0[i], b1[i] - b0[i])
            off = margin * (1 + 4 * spread * (spread + abs(rise) + abs(other)) * abs(inverse))
            flat = abs(pa) + abs(pb) < steep and off < np.float32(0.1) * spread
            at_a[i], at_b[i] = a1_, b1_
            side_ua[i], side_ub[i], side_va[i], side_vb[i] = u, v, w, q
            sense[i] = 1 if area > 0 else -1
            slope_a[i], slope_b[i] = pa if flat else np.float32(0), pb if flat else np.float32(0)
            slack[i] = h1_ + off if flat else highest
            top[i] = highest
        for i in range(size):
            if top[i] <= deepest or first[i] > last[i]:
                continue
            left, right, front, back, most, base = a0[i], a1[i], b0[i], b1[i], top[i], slack[i]
            here_a, here_b, pa, pb = at_a[i], at_b[i], slope_a[i], slope_b[i]
            ua, ub, va, vb, turn = side_ua[i], side_ub[i], side_va[i], side_vb[i], sense[i]
            edge = 4 * margin * (abs(ua) + abs(ub) + abs(va) + abs(vb))
            for row in range(upper[i], lower[i] + 1):
                for j in range(begins[row * wide + first[i]], begins[row * wide + last[i] + 1], BLOCK):
                    near, start = np.uint32(0), np.uint64(j)
                    for k in range(BLOCK):
                        at = start + np.uint64(k)
                        inside = (a[at] >= left) & (a[at] <= right) & (b[at] >= front) & (b[at] <= back)
                        plane = base + pa * (a[at] - here_a) + pb * (b[at] - here_b)
                        inside &= (h[at] < most) & (h[at] < plane)
                        near |= np.uint32(inside) << np.uint32(k)
                    while near:
                        bit = near & (~near + np.uint32(1))
                        near ^= bit
                        k = (np.float32(bit).view(np.int32) >> 23) - 127
                        # Outside one of its sides, seen along the light.
                        ra, rb = a[j + k] - here_a, b[j + k] - here_b
                        one, two = (ua * rb - ub * ra) * turn, (ra * vb - rb * va) * turn
                        if one < -edge or two < -edge or (ua * vb - ub * va) * turn - one - two < -edge:
                            continue
                        point = place[j + k]
                        eye = (points[point, x], points[point, y], points[point, z])
                        distance, _, _ = meet_triangle(corners, begin + i, axes, eye, shear)
                        if 0 < distance < np.inf:
                            hidden[point] = True
                            h[j + k] = np.inf


@exact_small
def cell_of(value, low, per):
    """The cell of a coordinate, counted from the lowest."""
    return np.int32((value - low) * per)
