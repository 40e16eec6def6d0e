"""The loops of `prefiltered.filters`: each looks a table up for some samples, the three channels of each.

They write to `seen` (Q, 4) in the order of `chosen`; `add_seen` then adds that to the light (P, 4). The fourth
channel means nothing: with it the processor works on all channels at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume.image.kernel import inlined, kernel
from relume.renderers.prefiltered.shading_inputs import by_cosine, key
from relume.sphere.bilinear_kernels import looked_up, polar_point


class Sums(NamedTuple):
    """A table's running sums.

    sums : (H + 1, 2H + 1, 3) float64, radiance × solid angle of all entries above and to the left
    areas : (H + 1,) float64, solid angle of one column above
    table : the padded table itself, for pixels that reflect less than an entry
    """

    sums: np.ndarray
    areas: np.ndarray
    table: np.ndarray


class Pyramid(NamedTuple):
    """A table and its ever smaller means, padded, one behind the other.

    values : float32
    begins : where each level begins
    rows : of each level, without the padding
    """

    values: np.ndarray
    begins: np.ndarray
    rows: np.ndarray


@kernel
def looked_up_at(seen, chosen, points, table):
    """The table at the middles' image points (P, 2)."""
    entries, rows = table.reshape(-1), table.shape[0] - 2
    for place in range(len(chosen)):
        index = np.uint32(chosen[place])
        values = looked_up(entries, 0, rows, points[index, 0], points[index, 1])
        seen[place, 0], seen[place, 1], seen[place, 2], seen[place, 3] = values


@kernel
def add_seen(light, chosen, seen, samples, term):
    """Add what was looked up, weighed as the samples' middles see it."""
    normals, views = samples.normal, samples.to_eye
    weight, grazing, colour, rim = term.weight, term.grazing, term.colour, term.rim
    for place in range(len(chosen)):
        index = np.uint32(chosen[place])
        facing = normals[index, 0] * views[index, 0] + normals[index, 1] * views[index, 1]
        facing += normals[index, 2] * views[index, 2]
        red, green, blue, _ = by_cosine(weight, facing)
        if colour.shape[0] > 0:
            more_red, more_green, more_blue, _ = by_cosine(grazing, facing)
            red = red * colour[index, 0] + more_red * rim[index, 0]
            green = green * colour[index, 1] + more_green * rim[index, 1]
            blue = blue * colour[index, 2] + more_blue * rim[index, 2]
        light[index, 0] += red * seen[place, 0]
        light[index, 1] += green * seen[place, 1]
        light[index, 2] += blue * seen[place, 2]


@kernel
def find_places(places, normals, views, kind, ratio, begin, end):
    """Where the table is looked up for normals and views: directions (M, 3), or their image points (M, 2)."""
    as_points = places.shape[1] == 2
    for index in range(begin, end):
        x, y, z = key(
            kind, ratio, normals[index, 0], normals[index, 1], normals[index, 2],
            views[index, 0], views[index, 1], views[index, 2],
        )  # fmt: skip
        if as_points:
            places[index, 0], places[index, 1] = polar_point(x, y, z)
        else:
            places[index, 0], places[index, 1], places[index, 2] = x, y, z


@kernel
def quadrilaterals(quads, chosen, samples, middles, keys):
    """The corners' directions (Q, 4, 3); a corner on another surface mirrors its opposite about the middle."""
    corners, surface, corner_surface = samples.corners, samples.surface, samples.corner_surface
    for place in range(len(chosen)):
        index = chosen[place]
        for corner in range(4):
            own = corner_surface[corners[index, corner]] == surface[index]
            opposite = corners[index, (corner + 2) % 4]
            mirrored = corner_surface[opposite] == surface[index]
            for axis in range(3):
                if own:
                    quads[place, corner, axis] = keys[corners[index, corner], axis]
                elif mirrored:
                    quads[place, corner, axis] = np.float32(2) * middles[index, axis] - keys[opposite, axis]
                else:
                    quads[place, corner, axis] = middles[index, axis]


@inlined
def _distance(quad, first, second):
    x, y, z = quad[first, 0] - quad[second, 0], quad[first, 1] - quad[second, 1], quad[first, 2] - quad[second, 2]
    return x * x + y * y + z * z


@kernel
def subdivided(seen, quads, table, depth):
    """§8.1: halve the quadrilateral until its corners index the same or adjacent entries."""
    entries, rows = table.reshape(-1), table.shape[0] - 2
    entry = np.float32((np.pi / rows) ** 2)
    stack = np.empty((depth + 2, 4, 3), np.float32)
    levels = np.empty(depth + 2, np.int64)
    quad = np.empty((4, 3), np.float32)
    for place in range(len(quads)):
        stack[0] = quads[place]
        levels[0] = 0
        height = 1
        red = green = blue = 0.0
        while height > 0:
            height -= 1
            quad[:] = stack[height]
            level = levels[height]
            across = max(_distance(quad, 0, 1), _distance(quad, 3, 2))
            along = max(_distance(quad, 0, 3), _distance(quad, 1, 2))
            # Step 2. Adjacency is an angle here, so that it means the same at the poles.
            if level >= depth or (across <= entry and along <= entry):
                share = 0.25 * 0.5**level
                for corner in range(4):
                    u, v = polar_point(quad[corner, 0], quad[corner, 1], quad[corner, 2])
                    part = looked_up(entries, 0, rows, u, v)
                    red, green, blue = red + share * part[0], green + share * part[1], blue + share * part[2]
                continue
            # Steps 3 and 4: halve the longer way, with interpolated directions.
            second, third = (1, 3) if across >= along else (3, 1)
            for half in range(2):
                stack[height + half] = quad
                levels[height + half] = level + 1
            for near, far in ((0, second), (third, 2)):
                x, y, z = quad[near, 0] + quad[far, 0], quad[near, 1] + quad[far, 1], quad[near, 2] + quad[far, 2]
                scale = np.float32(1) / max(np.sqrt(x * x + y * y + z * z), np.float32(1e-12))
                for half, corner in ((0, far), (1, near)):
                    stack[height + half, corner, 0] = x * scale
                    stack[height + half, corner, 1] = y * scale
                    stack[height + half, corner, 2] = z * scale
            height += 2
        seen[place, 0], seen[place, 1], seen[place, 2] = red, green, blue


@inlined
def _short_way(turn):
    """A difference of longitudes, in turns, the short way round."""
    return turn - np.floor(turn + 0.5)


@kernel
def spanned(seen, quads, table):
    """§8.2: the mean of the entries inside the quadrilateral."""
    entries, rows, columns = table.reshape(-1), table.shape[0] - 2, table.shape[1] - 2
    u, v = np.empty(4), np.empty(4)
    for place in range(len(quads)):
        # The corners in the table, and the rows between them.
        for corner in range(4):
            x, y = polar_point(quads[place, corner, 0], quads[place, corner, 1], quads[place, corner, 2])
            u[corner] = x if corner == 0 else u[corner - 1] + _short_way(x - u[corner - 1])
            v[corner] = y * rows - 0.5
        around = u[3] + _short_way(u[0] - u[3]) - u[0]
        for corner in range(4):
            u[corner] = u[corner] * columns - 0.5
        low, high = max(int(np.ceil(v.min())), 0), min(int(np.floor(v.max())), rows - 1)
        if abs(around) > 0.5:
            # The quadrilateral goes round a pole: all rows from there to its edge are in it.
            low, high = (0, high) if v.mean() < rows / 2 else (low, rows - 1)
        # The sum over the entries whose middles are inside, row by row, by solid angle.
        total = red = green = blue = 0.0
        count = 0
        for row in range(low, high + 1):
            # From where to where the row is inside.
            left, right = (0.0, columns - 1.0) if abs(around) > 0.5 else (np.inf, -np.inf)
            if abs(around) <= 0.5:
                for corner in range(4):
                    after = (corner + 1) % 4
                    if (v[corner] <= row) != (v[after] <= row):
                        crossing = u[corner] + (u[after] - u[corner]) * (row - v[corner]) / (v[after] - v[corner])
                        left, right = min(left, crossing), max(right, crossing)
                if left > right:
                    continue
            area = np.sin(np.pi * (row + 0.5) / rows)
            for step in range(int(np.ceil(left)), int(np.floor(right)) + 1):
                column = step % columns + 1
                red += area * table[row + 1, column, 0]
                green += area * table[row + 1, column, 1]
                blue += area * table[row + 1, column, 2]
                total += area
                count += 1
        quad = quads[place]
        across = max(_distance(quad, 0, 1), _distance(quad, 3, 2))
        along = max(_distance(quad, 0, 3), _distance(quad, 1, 2))
        if count < 4 or min(across, along) < (2 * np.pi / rows) ** 2:
            # Of a piece so small or so thin few entries' middles are inside: it is sampled an entry apart.
            wide = min(max(int(np.ceil(np.sqrt(across) * rows / np.pi)), 2), columns)
            tall = min(max(int(np.ceil(np.sqrt(along) * rows / np.pi)), 2), columns)
            red = green = blue = 0.0
            total = wide * tall
            for step in range(wide * tall):
                right, down = np.float32((step % wide + 0.5) / wide), np.float32((step // wide + 0.5) / tall)
                a, b = (np.float32(1) - right) * (np.float32(1) - down), right * (np.float32(1) - down)
                c, d = right * down, (np.float32(1) - right) * down
                x = quad[0, 0] * a + quad[1, 0] * b + quad[2, 0] * c + quad[3, 0] * d
                y = quad[0, 1] * a + quad[1, 1] * b + quad[2, 1] * c + quad[3, 1] * d
                z = quad[0, 2] * a + quad[1, 2] * b + quad[2, 2] * c + quad[3, 2] * d
                here, there = polar_point(x, y, z)
                part = looked_up(entries, 0, rows, here, there)
                red, green, blue = red + part[0], green + part[1], blue + part[2]
        seen[place, 0], seen[place, 1], seen[place, 2] = red / total, green / total, blue / total


@inlined
def _sum_at(sums, x, y):
    """The running sums at a place between entries; x may lie turns away, the table goes on round the seam."""
    columns = sums.shape[1] - 1
    turns = np.floor(x / columns)
    x -= turns * columns
    column, row = min(int(x), columns - 1), min(int(y), sums.shape[0] - 2)
    right, down = x - column, y - row
    a, b, c, d = (1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down
    e, f = turns * (1 - down), turns * down
    red = a * sums[row, column, 0] + b * sums[row, column + 1, 0]
    red += c * sums[row + 1, column, 0] + d * sums[row + 1, column + 1, 0]
    green = a * sums[row, column, 1] + b * sums[row, column + 1, 1]
    green += c * sums[row + 1, column, 1] + d * sums[row + 1, column + 1, 1]
    blue = a * sums[row, column, 2] + b * sums[row, column + 1, 2]
    blue += c * sums[row + 1, column, 2] + d * sums[row + 1, column + 1, 2]
    if turns != 0:
        red += e * sums[row, columns, 0] + f * sums[row + 1, columns, 0]
        green += e * sums[row, columns, 1] + f * sums[row + 1, columns, 1]
        blue += e * sums[row, columns, 2] + f * sums[row + 1, columns, 2]
    return red, green, blue


@inlined
def _area_at(areas, y):
    row = min(int(y), len(areas) - 2)
    return areas[row] + (areas[row + 1] - areas[row]) * (y - row)


@kernel
def _mirror_corners(u, v, own, x, y, z):
    """Put a corner that lies on another surface opposite its opposite, about the middle's direction."""
    middle_u, middle_v = polar_point(x, y, z)
    for corner in range(4):
        if not own[corner]:
            opposite = (corner + 2) % 4
            u[corner], v[corner] = middle_u, middle_v
            if own[opposite]:
                u[corner] -= _short_way(u[opposite] - middle_u)
                v[corner] -= v[opposite] - middle_v


@kernel
def preintegrated(seen, chosen, samples, kind, ratio, points, prepared):
    """§8.3: the mean over a rectangle that has the quadrilateral's mean place and its second moments.

    points : (M, 2) image points of the corners
    """
    sums, areas, entries = prepared.sums, prepared.areas, prepared.table.reshape(-1)
    normals, views = samples.normal, samples.to_eye
    corners, surface, corner_surface = samples.corners, samples.surface, samples.corner_surface
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    u, v, own = np.empty(4), np.empty(4), np.empty(4, np.bool_)
    for place in range(len(chosen)):
        index = chosen[place]
        whole = True
        for corner in range(4):
            point = corners[index, corner]
            own[corner] = corner_surface[point] == surface[index]
            whole &= own[corner]
            u[corner], v[corner] = points[point, 0], points[point, 1]
        if not whole:
            x, y, z = key(
                kind, ratio, normals[index, 0], normals[index, 1], normals[index, 2],
                views[index, 0], views[index, 1], views[index, 2],
            )  # fmt: skip
            _mirror_corners(u, v, own, x, y, z)
        top, right_side = _short_way(u[1] - u[0]), _short_way(u[2] - u[1])
        bottom, left_side = _short_way(u[3] - u[2]), _short_way(u[0] - u[3])
        left = 0.0
        if abs(top + right_side + bottom + left_side) > 0.5:
            # The quadrilateral goes round a pole: the rectangle is the cap down to its edge.
            width = columns * 1.0
            upper, lower = (0.0, v.max() * rows) if v[0] < 0.5 else (v.min() * rows, rows * 1.0)
        else:
            # As wide as both pairs of opposite sides together, by Pythagoras.
            width = np.sqrt((0.5 * (top - bottom)) ** 2 + (0.5 * (right_side - left_side)) ** 2) * columns
            along, across = 0.5 * (v[1] - v[0] + v[2] - v[3]), 0.5 * (v[3] - v[0] + v[2] - v[1])
            height = np.sqrt(along * along + across * across) * rows
            middle_u = u[0] + 0.25 * (3 * top + 2 * right_side + bottom)
            middle_v = 0.25 * (v[0] + v[1] + v[2] + v[3])
            if width <= 1 and height <= 1:
                middle_u -= np.floor(middle_u)
                part = looked_up(entries, 0, rows, np.float32(middle_u), np.float32(middle_v))
                seen[place, 0], seen[place, 1], seen[place, 2], seen[place, 3] = part
                continue
            # One entry wide at least: a box of one entry over entries is their interpolation.
            width, height = min(max(width, 1.0), columns * 1.0), max(height, 1.0)
            left = middle_u * columns - 0.5 * width
            upper, lower = middle_v * rows - 0.5 * height, middle_v * rows + 0.5 * height
        upper = min(max(upper, 0.0), rows - 0.5)
        lower = min(max(lower, upper + 0.5), rows * 1.0)
        area = width * (_area_at(areas, lower) - _area_at(areas, upper))
        first, second = _sum_at(sums, left + width, lower), _sum_at(sums, left, lower)
        third, fourth = _sum_at(sums, left + width, upper), _sum_at(sums, left, upper)
        seen[place, 0] = max(first[0] - second[0] - third[0] + fourth[0], 0.0) / area
        seen[place, 1] = max(first[1] - second[1] - third[1] + fourth[1], 0.0) / area
        seen[place, 2] = max(first[2] - second[2] - third[2] + fourth[2], 0.0) / area


@kernel
def from_pyramid(seen, quads, points, pyramid):
    """Williams 1983: between the two levels whose entries are as large as what the pixel reflects.

    points : (Q, 2) image points of the middles
    """
    values, begins, rows = pyramid.values, pyramid.begins, pyramid.rows
    last, one = len(rows) - 1, np.float32(1)
    for place in range(len(quads)):
        quad = quads[place]
        across = max(_distance(quad, 0, 1), _distance(quad, 3, 2))
        along = max(_distance(quad, 0, 3), _distance(quad, 1, 2))
        spread = max(np.sqrt(max(across, along)) * np.float32(rows[0] / np.pi), one)
        level = min(np.log2(spread), np.float32(last))
        lower = min(int(level), last)
        share = level - np.float32(lower)
        u, v = points[place, 0], points[place, 1]
        red, green, blue, _ = looked_up(values, begins[lower], rows[lower], u, v)
        if share > 0:
            upper = looked_up(values, begins[lower + 1], rows[lower + 1], u, v)
            red = red * (one - share) + upper[0] * share
            green = green * (one - share) + upper[1] * share
            blue = blue * (one - share) + upper[2] * share
        seen[place, 0], seen[place, 1], seen[place, 2] = red, green, blue
