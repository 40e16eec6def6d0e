"""The seven projections in float32: directions of points, points of directions, solid angles, and neighbours."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel
from relume.sphere.bilinear_kernels import arctangent2
from relume.sphere.mappings.layouts import EQUIDISTANT, EQUISOLID, FLAT, LAT_LONG, OCTAHEDRAL, ORTHOGRAPHIC

_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1), np.float32(2)
_PI, _QUARTER = np.float32(np.pi), np.float32(np.pi / 4)
_TINY = np.float32(1e-30)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_FEW_NODES, _FEW_WEIGHTS = np.polynomial.legendre.leggauss(4)
RIM = 16
"""Pixels from the rim of an orthographic disc within which solid angles grow too fast for a sum of four densities."""
FINE = 1024
"""Columns from which the density at a pixel's middle gives its solid angle to 1e-6."""


@inlined
def sine(angle):
    """sin in float32 to 1e-7, for angles within ±3π/2: folded into ±π/2, then Taylor's series."""
    angle = _PI - angle if angle > np.float32(np.pi / 2) else angle
    angle = -_PI - angle if angle < np.float32(-np.pi / 2) else angle
    square = angle * angle
    series = np.float32(1 / 362880) - square * np.float32(1 / 39916800)
    series = np.float32(-1 / 5040) + square * series
    series = np.float32(1 / 120) + square * series
    series = np.float32(-1 / 6) + square * series
    return angle + angle * square * series


@inlined
def cosine(angle):
    """cos in float32 to 1e-7, for angles within ±3π/2."""
    return sine(np.float32(np.pi / 2) - abs(angle))


@inlined
def _inner(x, y):
    """A point beyond one edge of a square that is folded up: where it lies on the square."""
    outside, above = abs(x) > _ONE, abs(y) > _ONE
    inner_x = (_TWO - abs(x)) * (_ONE if x >= 0 else -_ONE) if outside else x
    inner_y = (_TWO - abs(y)) * (_ONE if y >= 0 else -_ONE) if above else y
    return (-inner_x if above else inner_x), (-inner_y if outside else inner_y)


@kernel
def toward(kind, across, down, xs, ys, x, y, z, density):
    """Directions in a plane's frame (right, down, outward) of its points, and steradians per unit of area there.

    Points may lie a little beyond the plane: directions go on there.
    """
    if kind == LAT_LONG:
        for i in range(len(xs)):
            longitude, polar = _PI * xs[i], _PI * _HALF * (ys[i] + _ONE)
            ring = sine(polar)
            x[i], y[i], z[i] = ring * sine(longitude), -cosine(polar), ring * cosine(longitude)
            density[i] = abs(ring) * np.float32(np.pi * np.pi / 2)
    elif kind == EQUIDISTANT:
        for i in range(len(xs)):
            radius = max(np.sqrt(xs[i] * xs[i] + ys[i] * ys[i]), _TINY)
            ring = sine(across * radius) / radius
            x[i], y[i], z[i] = xs[i] * ring, ys[i] * ring, cosine(across * radius)
            density[i] = abs(ring) * across
    elif kind == EQUISOLID:
        for i in range(len(xs)):
            square = across * across * (xs[i] * xs[i] + ys[i] * ys[i])
            # Beyond the rim of a whole ball the other side of the rim follows.
            beyond = square > _ONE
            square = _TWO - square if beyond else square
            ring = _TWO * across * np.sqrt(max(_ONE - square, np.float32(0)))
            ring = -ring if beyond else ring
            x[i], y[i], z[i] = xs[i] * ring, ys[i] * ring, _ONE - _TWO * square
            density[i] = np.float32(4) * across * across
    elif kind == ORTHOGRAPHIC:
        for i in range(len(xs)):
            square = xs[i] * xs[i] + ys[i] * ys[i]
            # Beyond the rim the other half of the sphere follows.
            beyond = square > _ONE
            shrunk = _ONE / max(square, _ONE)
            x[i], y[i] = xs[i] * shrunk, ys[i] * shrunk
            outward = np.sqrt(max(_ONE - square * shrunk * shrunk, np.float32(1e-8)))
            z[i] = -outward if beyond else outward
            density[i] = _ONE / outward
    elif kind == FLAT:
        for i in range(len(xs)):
            right, below = across * xs[i], down * ys[i]
            depth = _ONE / np.sqrt(right * right + below * below + _ONE)
            x[i], y[i], z[i] = right * depth, below * depth, depth
            density[i] = across * down * depth * depth * depth
    # The octahedron, unfolded onto a square.
    elif kind == OCTAHEDRAL:
        for i in range(len(xs)):
            across_x, down_y = _inner(xs[i], ys[i])
            # Where the point lies on the octahedron.
            height = _ONE - abs(across_x) - abs(down_y)
            below = max(-height, np.float32(0))
            right = across_x - (below if across_x >= 0 else -below)
            near = down_y - (below if down_y >= 0 else -below)
            scale = _ONE / np.sqrt(right * right + near * near + height * height)
            x[i], y[i], z[i] = right * scale, near * scale, height * scale
            density[i] = scale * scale * scale
    else:
        for i in range(len(xs)):
            across_x, down_y = _inner(xs[i], ys[i])
            height = _ONE - abs(across_x) - abs(down_y)
            radius = _ONE - abs(height)
            turn = (abs(down_y) - abs(across_x)) / max(radius, _TINY)
            angle = (turn + _ONE) * _QUARTER
            ring = radius * np.sqrt(max(_TWO - radius * radius, np.float32(0)))
            right, near = ring * cosine(angle), ring * sine(angle)
            pole = _ONE - radius * radius
            x[i] = right if across_x >= 0 else -right
            y[i] = near if down_y >= 0 else -near
            z[i] = pole if height >= 0 else -pole
            density[i] = _PI


@kernel
def turned(turn, x, y, z):
    """Directions turned in place."""
    a, b, c = turn[0, 0], turn[0, 1], turn[0, 2]
    d, e, f = turn[1, 0], turn[1, 1], turn[1, 2]
    g, h, k = turn[2, 0], turn[2, 1], turn[2, 2]
    for i in range(len(x)):
        right, down, outward = x[i], y[i], z[i]
        x[i] = a * right + b * down + c * outward
        y[i] = d * right + e * down + f * outward
        z[i] = g * right + h * down + k * outward


@kernel
def found(kind, across, down, frames, whole, x, y, z, plane, xs, ys):
    """Plane and point of directions in the first plane's frame; plane −1 where none shows it, and some point then."""
    plane[:] = 0
    if kind == LAT_LONG:
        for i in range(len(x)):
            xs[i] = arctangent2(x[i], z[i]) * np.float32(1 / np.pi)
            ys[i] = arctangent2(np.sqrt(x[i] * x[i] + z[i] * z[i]), -y[i]) * np.float32(2 / np.pi) - _ONE
    elif kind == EQUIDISTANT:
        for i in range(len(x)):
            ring = np.sqrt(x[i] * x[i] + y[i] * y[i])
            radius = arctangent2(ring, z[i]) / across
            scale = radius / max(ring, _TINY)
            xs[i], ys[i] = x[i] * scale, y[i] * scale
    elif kind == EQUISOLID:
        for i in range(len(x)):
            ring = np.sqrt(x[i] * x[i] + y[i] * y[i])
            # sin(θ/2), by whichever half-angle formula keeps its digits.
            near = ring / np.sqrt(_TWO * max(_ONE + z[i], _ONE))
            far = np.sqrt(_HALF * max(_ONE - z[i], np.float32(0)))
            scale = (near if z[i] > 0 else far) / (across * max(ring, _TINY))
            xs[i], ys[i] = x[i] * scale, y[i] * scale
    elif kind == ORTHOGRAPHIC:
        for i in range(len(x)):
            plane[i] = 1 if z[i] < 0 else 0
            xs[i], ys[i] = x[i], y[i]
    elif kind == FLAT:
        for i in range(len(x)):
            # The plane that the direction points at most.
            best, depth = -1, np.float32(0)
            for p in range(len(frames)):
                outward = frames[p, 2, 0] * x[i] + frames[p, 2, 1] * y[i] + frames[p, 2, 2] * z[i]
                if outward > depth:
                    best, depth = p, outward
            plane[i] = best
            # Numbers, also for directions that no plane shows.
            xs[i], ys[i] = np.float32(0), np.float32(0)
            if best >= 0:
                right = frames[best, 0, 0] * x[i] + frames[best, 0, 1] * y[i] + frames[best, 0, 2] * z[i]
                below = frames[best, 1, 0] * x[i] + frames[best, 1, 1] * y[i] + frames[best, 1, 2] * z[i]
                xs[i], ys[i] = right / (depth * across), below / (depth * down)
    elif kind == OCTAHEDRAL:
        for i in range(len(x)):
            scale = _ONE / (abs(x[i]) + abs(y[i]) + abs(z[i]))
            right, near = x[i] * scale, y[i] * scale
            outer, outer_near = _ONE - abs(near), _ONE - abs(right)
            outer = outer if x[i] >= 0 else -outer
            outer_near = outer_near if y[i] >= 0 else -outer_near
            xs[i], ys[i] = (outer if z[i] < 0 else right), (outer_near if z[i] < 0 else near)
    else:
        for i in range(len(x)):
            # √(1 − |z|), by a formula that keeps its digits.
            radius = np.sqrt((x[i] * x[i] + y[i] * y[i]) / (_ONE + abs(z[i])))
            along = radius * arctangent2(abs(y[i]), abs(x[i])) * np.float32(2 / np.pi)
            right = _ONE - along if z[i] < 0 else radius - along
            near = _ONE - (radius - along) if z[i] < 0 else along
            xs[i] = right if x[i] >= 0 else -right
            ys[i] = near if y[i] >= 0 else -near
    if not whole:
        # Beyond the planes' edges nothing is shown.
        disc = kind != FLAT
        for i in range(len(x)):
            if disc and xs[i] * xs[i] + ys[i] * ys[i] > _ONE:
                plane[i] = -1
            elif abs(xs[i]) > _ONE or abs(ys[i]) > _ONE:
                plane[i] = -1


@kernel
def spread(kind, across, down, rows, x, y):
    """Radians that a step of one along x, and one along y, crosses at a point of a plane of so many rows.

    Where that grows without bound towards a rim it is taken half a pixel within, as for the pixel's own middle.
    """
    if kind == LAT_LONG:
        return np.pi * np.cos(np.pi / 2 * y), np.pi / 2
    if kind == FLAT:
        right, below = across * x, down * y
        depth = 1 / (right * right + below * below + 1)
        return across * np.sqrt(1 + below * below) * depth, down * np.sqrt(1 + right * right) * depth
    if kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC:
        radius = max(np.sqrt(x * x + y * y), 1e-9)
        inner = min(radius, 1.0)
        if kind == EQUIDISTANT:
            radial, tangential = across, np.sin(across * inner) / inner
        elif kind == EQUISOLID:
            slope = np.sqrt(max(1 - (across * inner) ** 2, min(2 / rows, 1.0)))
            radial, tangential = 2 * across / slope, 2 * across * slope
        else:
            radial, tangential = 1 / np.sqrt(max(1 - inner * inner, min(2 / rows, 1.0))), 1.0
        cosine, sine = x / radius, y / radius
        return np.hypot(radial * cosine, tangential * sine), np.hypot(radial * sine, tangential * cosine)
    if kind == OCTAHEDRAL:
        height = 1 - abs(x) - abs(y)
        below = max(-height, 0.0)
        right, near = abs(x) - below, abs(y) - below
        longest = np.sqrt(2 / (right * right + near * near + height * height))
        return longest, longest
    return np.pi * 0.8, np.pi * 0.8


@kernel
def spreads(kind, across, down, rows, xs, ys, wide, high):
    """`spread` at many points."""
    for i in range(len(xs)):
        wide[i], high[i] = spread(kind, across, down, rows, np.float64(xs[i]), np.float64(ys[i]))


@kernel
def grain(kind, across, down, rows, columns):
    """Radians across a source's pixel, nearly its smallest: look-ups no farther apart miss none."""
    if kind == LAT_LONG:
        return np.pi / rows
    if kind == EQUIDISTANT:
        return 0.6 * across * 2 / rows
    if kind == EQUISOLID:
        return 0.7 * across * 4 / rows
    if kind == FLAT:
        return 0.6 * min(across * 2 / columns, down * 2 / rows)
    return 2 / rows


@kernel
def _cap(kind, across, squared):
    """1 − cos θ of r², on discs."""
    squared = min(squared, 1.0)
    if kind == EQUIDISTANT:
        return 1 - np.cos(across * np.sqrt(squared))
    if kind == EQUISOLID:
        return 2 * across * across * squared
    return 1 - np.sqrt(1 - squared)


@kernel
def _rim_solid_angle(kind, across, rows, row, column):
    """Steradians of a pixel near the rim of a disc, by Green's theorem: ∮ (1 − cos θ) dψ round the pixel."""
    left, top, step = 2 * column / rows - 1, 2 * row / rows - 1, 2 / rows
    total = 0.0
    for upright in range(2):
        first, other = (left, top) if upright else (top, left)
        for side in range(2):
            edge = first + side * step
            # Where the rim does not cross an edge of a small pixel, a few nodes are as good as many.
            near, far = abs(other + 0.5 * step) - 0.5 * step, abs(other + 0.5 * step) + 0.5 * step
            crossed = edge * edge + max(near, 0.0) ** 2 < 1 < edge * edge + far * far
            many = crossed or rows < 64 or kind == ORTHOGRAPHIC
            nodes, weights = (_NODES, _WEIGHTS) if many else (_FEW_NODES, _FEW_WEIGHTS)
            for node in range(len(nodes)):
                along = other + (nodes[node] + 1) / rows
                squared = edge * edge + along * along
                cap = _cap(kind, across, squared)
                total += (2 * side - 1) * weights[node] / rows * cap * edge / max(squared, 1e-300)
    return max(total, 0.0)


@kernel
def _density(kind, across, down, x, y):
    """Steradians per unit of area at a point of a plane, as `toward`, in float64 and within the plane."""
    if kind == LAT_LONG:
        return np.cos(np.pi / 2 * y) * np.pi * np.pi / 2
    if kind == FLAT:
        square = across * across * x * x + down * down * y * y + 1
        return across * down / (square * np.sqrt(square))
    if kind == EQUIDISTANT:
        radius = max(np.sqrt(x * x + y * y), 1e-9)
        return across * np.sin(across * radius) / radius
    if kind == EQUISOLID:
        return 4.0 * across * across
    if kind == ORTHOGRAPHIC:
        return 1 / np.sqrt(max(1 - x * x - y * y, 1e-9))
    if kind == OCTAHEDRAL:
        height = 1 - abs(x) - abs(y)
        below = max(-height, 0.0)
        right, near = abs(x) - below, abs(y) - below
        square = right * right + near * near + height * height
        return 1 / (square * np.sqrt(square))
    return np.pi


@kernel
def solid_angle(kind, across, down, rows, columns, row, column):
    """Steradians of a pixel of a plane, to 1e-6 of it."""
    if kind == LAT_LONG:
        return (np.cos(np.pi * row / rows) - np.cos(np.pi * (row + 1) / rows)) * 2 * np.pi / columns
    if kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC:
        x, y, half = abs(2 * (column + 0.5) / columns - 1), abs(2 * (row + 0.5) / rows - 1), 1 / rows
        if max(x - half, 0.0) ** 2 + max(y - half, 0.0) ** 2 >= 1:
            return 0.0
        fine = (x + half) ** 2 + (y + half) ** 2 <= 1
        if kind == ORTHOGRAPHIC:
            fine = np.hypot(x, y) <= 1 - RIM * 2 / rows
        if not fine:
            return _rim_solid_angle(kind, across, rows, row, column)
    # Gauss's rule of two points a side, in as many parts as make a coarse image fine.
    parts = 1 if columns >= 64 else (127 // columns + 1) // 2 * 2
    if kind == OCTAHEDRAL and columns < FINE:
        # The density has a crease along the folds.
        x, y = abs(2 * (column + 0.5) / columns - 1), abs(2 * (row + 0.5) / rows - 1)
        parts = max(parts, 16) if abs(x + y - 1) < 2 / columns else parts
    node = 0.0 if columns >= FINE else 0.5 / np.sqrt(3.0)
    points = 1 if columns >= FINE else 2
    total = 0.0
    for i in range(parts):
        for j in range(parts):
            for k in range(points):
                for m in range(points):
                    y = 2 * (row + (i + 0.5 + (2 * k - 1) * node) / parts) / rows - 1
                    x = 2 * (column + (j + 0.5 + (2 * m - 1) * node) / parts) / columns - 1
                    total += _density(kind, across, down, x, y)
    return total * 4 / (rows * columns * parts * parts * points * points)


@kernel
def neighbour(kind, across, down, rows, columns, stride, origins, frames, whole, plane, row, column):
    """The image's pixel that continues a plane at a pixel of it or just beyond: over seams, poles, edges and rims."""
    if kind == LAT_LONG:
        if row < 0 or row >= rows:
            row = -1 - row if row < 0 else 2 * rows - 1 - row
            column += columns // 2
        column = (column + columns) % columns
    elif kind == FLAT:
        if row < 0 or row >= rows or column < 0 or column >= columns:
            if whole:
                x, y = 2 * (column + 0.5) / columns - 1, 2 * (row + 0.5) / rows - 1
                own = frames[plane]
                right = x * own[0, 0] + y * own[1, 0] + own[2, 0]
                below = x * own[0, 1] + y * own[1, 1] + own[2, 1]
                ahead = x * own[0, 2] + y * own[1, 2] + own[2, 2]
                depth = 0.0
                for p in range(len(frames)):
                    outward = frames[p, 2, 0] * right + frames[p, 2, 1] * below + frames[p, 2, 2] * ahead
                    if outward > depth:
                        depth, plane = outward, p
                other = frames[plane]
                x = (other[0, 0] * right + other[0, 1] * below + other[0, 2] * ahead) / depth
                y = (other[1, 0] * right + other[1, 1] * below + other[1, 2] * ahead) / depth
                column, row = int((x + 1) * columns / 2), int((y + 1) * rows / 2)
            column, row = min(max(column, 0), columns - 1), min(max(row, 0), rows - 1)
    elif kind == EQUIDISTANT or kind == EQUISOLID or kind == ORTHOGRAPHIC:
        x, y = 2 * (column + 0.5) / columns - 1, 2 * (row + 0.5) / rows - 1
        radius = np.hypot(x, y)
        corner = radius
        if kind == ORTHOGRAPHIC:
            # A hemisphere's last pixels hold so much of it that they count wherever a corner of them is on the disc.
            corner = np.hypot(max(abs(x) - 1 / columns, 0.0), max(abs(y) - 1 / rows, 0.0)) * (1 + 1e-9)
        if corner > 1:
            # A pixel's middle as far within the rim, on the far side of a sphere or where the plane itself ends.
            scale = (2 - radius - 1.5 / rows) / radius
            if kind == ORTHOGRAPHIC:
                plane = 1 - plane
            elif whole:
                scale = -scale
            column, row = int((x * scale + 1) * columns / 2), int((y * scale + 1) * rows / 2)
            column, row = min(max(column, 0), columns - 1), min(max(row, 0), rows - 1)
    else:
        if row < 0 or row >= rows:
            row, column = (-1 - row if row < 0 else 2 * rows - 1 - row), columns - 1 - column
        if column < 0 or column >= columns:
            row, column = rows - 1 - row, (-1 - column if column < 0 else 2 * columns - 1 - column)
    return origins[plane] + row * stride + column
