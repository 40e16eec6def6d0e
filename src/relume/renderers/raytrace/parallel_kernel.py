"""The loop below `parallel_light`: points in cells across the light, and triangles that ask them.

Heights, bounds and planes are of float32 and widened by what that rounds; a point that is neither surely clear of a
triangle nor surely below it is put to the test of `kernel`, in double precision.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel, exact_small
from relume.renderers.raytrace.kernel import _meet_triangle as meet_triangle
from relume.renderers.raytrace.kernel import _shear_along as shear_along

CLUSTER = 16
"""Triangles that are passed over together where no point lies below them."""
IN_CELL = 2
"""Points of a cell, about."""
BLOCK = 16
"""Points that are asked at once, by vector instructions."""
STEEP = np.float32(50)
"""Slope of a plane from which on its triangle's highest corner stands for it."""
MARGIN = np.float32(2e-6)
"""Of the largest coordinate: bounds in float32 are off by a quarter of it."""


@exact_kernel
def hide(corners, blocks, boxes, cones, own, sided, points, asking, direction, hidden, doubtful):
    """Mark which of the points (N, 3) that ask lie in the shadow of a triangle; corners … own as of `Shadows`.

    asking : (K,) int64, numbers of points; `hidden` and `doubtful` (K,) are theirs
    sided : 1 asks only triangles that face away from the light, and marks as doubtful what is not hidden and lies
        below a triangle that closes the surface; 0 asks all triangles of the surface itself
    """
    if len(asking) == 0:
        return
    axes, _, shear = shear_along((0.0, 0.0, 0.0), (direction[0], direction[1], direction[2]))
    x, y, z = axes
    across, along, height, ends, margin = seen_along(points, asking, axes, shear, boxes)
    place, a, b, h, begins, lowest, per, wide = in_cells(across, along, height, ends, margin)
    bounds, reach = np.empty(15 * CLUSTER, np.float32), np.empty(4 * CLUSTER, np.int32)
    for cluster in range(len(boxes) if sided else own):
        once = sided if cluster < own else np.float32(0)
        cosine = cones[cluster, 0] * direction[0] + cones[cluster, 1] * direction[1] + cones[cluster, 2] * direction[2]
        if once and cosine > cones[cluster, 3]:
            continue
        most, deepest = lowest_under(boxes[cluster], axes, shear, ends, margin, lowest, per, wide)
        if deepest >= most:
            continue
        begin = cluster * CLUSTER
        size = min(CLUSTER, len(corners) - begin)
        measure(blocks[cluster], axes, shear, ends, margin, per, once, bounds, reach)
        for i in range(size):
            most = bounds[4 * CLUSTER + i]
            if most <= deepest or reach[i] > reach[1 * CLUSTER + i]:
                continue
            left, right, front, back = (
                bounds[i],
                bounds[1 * CLUSTER + i],
                bounds[2 * CLUSTER + i],
                bounds[3 * CLUSTER + i],
            )
            here_a, here_b, base, pa, pb = (
                bounds[5 * CLUSTER + i],
                bounds[6 * CLUSTER + i],
                bounds[7 * CLUSTER + i],
                bounds[8 * CLUSTER + i],
                bounds[9 * CLUSTER + i],
            )
            ua, ub, va, vb = (
                bounds[10 * CLUSTER + i],
                bounds[11 * CLUSTER + i],
                bounds[12 * CLUSTER + i],
                bounds[13 * CLUSTER + i],
            )
            sure = bounds[14 * CLUSTER + i]
            area, edge = ua * vb - ub * va, 4 * margin * (abs(ua) + abs(ub) + abs(va) + abs(vb))
            turn = np.float32(1 if area > 0 else -1)
            for row in range(reach[2 * CLUSTER + i], reach[3 * CLUSTER + i] + 1):
                for j in range(begins[row * wide + reach[i]], begins[row * wide + reach[1 * CLUSTER + i] + 1], BLOCK):
                    # A bit for each point of a block that lies within the bounds and below the plane.
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
                        k = j + (np.float32(bit).view(np.int32) >> 23) - 127
                        # Outside one of the triangle's sides, seen along the light?
                        ra, rb = a[k] - here_a, b[k] - here_b
                        one, other = (ua * rb - ub * ra) * turn, (ra * vb - rb * va) * turn
                        least = min(one, other, area * turn - one - other)
                        if least < -edge:
                            continue
                        which, distance = place[k], 1.0
                        if not (least > edge and h[k] < base + pa * ra + pb * rb - sure):
                            # Too near for float32: the test that a ray makes.
                            point = asking[which]
                            eye = (points[point, x], points[point, y], points[point, z])
                            distance, _, _ = meet_triangle(corners, begin + i, axes, eye, shear)
                        if 0 < distance < np.inf:
                            hidden[which] |= cluster < own
                            doubtful[which] |= cluster >= own
                            h[k] = np.inf


@exact_kernel
def seen_along(points, asking, axes, shear, boxes):
    """Asking points across the light, twice, and towards it; their ends across it; and how far bounds are widened."""
    x, y, z = axes
    count, up = len(asking), 1 if shear[2] > 0 else -1
    across, along, height = np.empty(count, np.float32), np.empty(count, np.float32), np.empty(count, np.float32)
    low_a, low_b, high_a, high_b = np.float32(np.inf), np.float32(np.inf), np.float32(-np.inf), np.float32(-np.inf)
    largest = np.float32(1e-30)
    for i in range(count):
        point = asking[i]
        across[i] = points[point, x] - shear[0] * points[point, z]
        along[i] = points[point, y] - shear[1] * points[point, z]
        height[i] = up * points[point, z]
        low_a, high_a = min(low_a, across[i]), max(high_a, across[i])
        low_b, high_b = min(low_b, along[i]), max(high_b, along[i])
        largest = max(largest, abs(height[i]))
    for i in range(len(boxes)):
        for k in range(6):
            largest = max(largest, abs(boxes[i, k]))
    margin = MARGIN * max(largest, -low_a, high_a, -low_b, high_b)
    return across, along, height, (low_a, high_a, low_b, high_b), margin


@exact_kernel
def in_cells(across, along, height, ends, margin):
    """The points sorted into cells, so that a row of cells is one stretch of them.

    returns : their numbers, (a, b, height) with a block of none behind; where each cell begins and its lowest height;
        cells a metre, and how many are in a row
    """
    low_a, high_a, low_b, high_b = ends
    count, width, depth = len(across), high_a - low_a, high_b - low_b
    share = np.float32(IN_CELL) / np.float32(count)
    per = np.float32(1) / max(np.sqrt(width * depth * share), max(width, depth) * share, margin)
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
    a, b = np.zeros(count + BLOCK, np.float32), np.zeros(count + BLOCK, np.float32)
    h = np.full(count + BLOCK, np.float32(np.inf))
    for i in range(count):
        j = begins[cells[i] + 1]
        begins[cells[i] + 1] = j + 1
        place[j], a[j], b[j], h[j] = i, across[i], along[i], height[i]
    return place, a, b, h, begins, lowest, per, wide


@exact_kernel
def lowest_under(box, axes, shear, ends, margin, lowest, per, wide):
    """How high a box reaches, and the lowest point in the cells it covers; ∞ where it covers none."""
    x, y, z = axes
    low_a, high_a, low_b, high_b = ends
    sx, sy, lz, hz = np.float32(shear[0]), np.float32(shear[1]), box[z], box[z + 3]
    left, right = box[x] - max(sx * lz, sx * hz) - margin, box[x + 3] - min(sx * lz, sx * hz) + margin
    front, back = box[y] - max(sy * lz, sy * hz) - margin, box[y + 3] - min(sy * lz, sy * hz) + margin
    most, deepest = (hz if shear[2] > 0 else -lz) + margin, np.float32(np.inf)
    if right < low_a or left > high_a or back < low_b or front > high_b:
        return most, deepest
    first, last = cell_of(max(left, low_a), low_a, per), cell_of(min(right, high_a), low_a, per)
    for row in range(cell_of(max(front, low_b), low_b, per), cell_of(min(back, high_b), low_b, per) + 1):
        for cell in range(row * wide + first, row * wide + last + 1):
            deepest = min(deepest, lowest[cell])
    return most, deepest


@exact_kernel
def measure(block, axes, shear, ends, margin, per, sided, bounds, reach):
    """What each triangle of a cluster covers, as seen along the light.

    block : (9 · CLUSTER,) the corners' x, y, z, each of all triangles
    sided : 1 leaves out triangles that surely face the light
    bounds : (15 · CLUSTER,) to fill: ends across the light, highest corner, first corner, the plane's height there and
        its slopes, two sides, and how far below that plane a point is surely below the triangle's
    reach : (4 · CLUSTER,) to fill: first and last column of cells, first and last row; none where last is before first
    """
    x, y, z = axes
    low_a, high_a, low_b, high_b = ends
    sx, sy, up = np.float32(shear[0]), np.float32(shear[1]), np.float32(1 if shear[2] > 0 else -1)
    at_x, at_y, at_z = np.uint64(CLUSTER * x), np.uint64(CLUSTER * y), np.uint64(CLUSTER * z)
    # By vector instructions: so many triangles in every cluster, and no more arrays than are seen to be apart.
    for k in range(CLUSTER):
        i = np.uint64(k)
        second, third = i + np.uint64(3 * CLUSTER), i + np.uint64(6 * CLUSTER)
        z1, z2, z3 = block[at_z + i], block[at_z + second], block[at_z + third]
        a1, a2, a3 = block[at_x + i] - sx * z1, block[at_x + second] - sx * z2, block[at_x + third] - sx * z3
        b1, b2, b3 = block[at_y + i] - sy * z1, block[at_y + second] - sy * z2, block[at_y + third] - sy * z3
        h1, h2, h3 = up * z1, up * z2, up * z3
        left, right = min(a1, a2, a3) - margin, max(a1, a2, a3) + margin
        front, back = min(b1, b2, b3) - margin, max(b1, b2, b3) + margin
        ua, ub, va, vb, rise, other = a2 - a1, b2 - b1, a3 - a1, b3 - b1, h2 - h1, h3 - h1
        area = ua * vb - ub * va
        beside = right < low_a or left > high_a or back < low_b or front > high_b
        beside |= sided * up * area > 4 * margin * (abs(ua) + abs(ub) + abs(va) + abs(vb))
        reach[i] = np.int32(1) if beside else cell_of(max(left, low_a), low_a, per)
        reach[np.uint64(1 * CLUSTER) + i] = np.int32(0) if beside else cell_of(min(right, high_a), low_a, per)
        reach[np.uint64(2 * CLUSTER) + i] = np.int32(0) if beside else cell_of(max(front, low_b), low_b, per)
        reach[np.uint64(3 * CLUSTER) + i] = np.int32(0) if beside else cell_of(min(back, high_b), low_b, per)
        # The plane, raised by what differences round, as slopes and area make that grow.
        inverse, highest = 1 / area, max(h1, h2, h3) + margin
        pa, pb = (rise * vb - ub * other) * inverse, (ua * other - rise * va) * inverse
        spread = max(right - left, back - front)
        off = margin * (1 + 4 * spread * (spread + abs(rise) + abs(other)) * abs(inverse))
        # Of a triangle that is seen nearly edge-on the highest corner stands for it.
        flat = abs(pa) + abs(pb) < STEEP and off < np.float32(0.1) * spread
        (
            bounds[i],
            bounds[np.uint64(1 * CLUSTER) + i],
            bounds[np.uint64(2 * CLUSTER) + i],
            bounds[np.uint64(3 * CLUSTER) + i],
            bounds[np.uint64(4 * CLUSTER) + i],
        ) = left, right, front, back, highest
        bounds[np.uint64(5 * CLUSTER) + i], bounds[np.uint64(6 * CLUSTER) + i], bounds[np.uint64(7 * CLUSTER) + i] = (
            a1,
            b1,
            h1 + off if flat else highest,
        )
        bounds[np.uint64(8 * CLUSTER) + i], bounds[np.uint64(9 * CLUSTER) + i] = (
            pa if flat else np.float32(0),
            pb if flat else np.float32(0),
        )
        (
            bounds[np.uint64(10 * CLUSTER) + i],
            bounds[np.uint64(11 * CLUSTER) + i],
            bounds[np.uint64(12 * CLUSTER) + i],
            bounds[np.uint64(13 * CLUSTER) + i],
            bounds[np.uint64(14 * CLUSTER) + i],
        ) = ua, ub, va, vb, 2 * off if flat else np.float32(np.inf)


@exact_small
def cell_of(value, low, per):
    """The cell of a coordinate, counted from the lowest."""
    return np.int32((value - low) * per)
