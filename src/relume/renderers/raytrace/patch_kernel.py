"""Rays against leaves of bicubic patches: subdivision under bounding spheres (Whitted 1980, §3), and Newton's steps.

A leaf is one piece of a patch, split off ahead of time (`patch_leaves`). Where a ray cannot meet it twice, because none
of its normals is at right angles to the ray, Newton's steps find the one place. Elsewhere, at outlines above all, it is
halved, and its halves again, as long as the ray pierces their bounding spheres, until Newton's steps can decide or the
piece is smaller than the ray's footprint, or seen as narrower. Every hit lies on the patch itself, so that outlines are
exact to half a footprint however near they are looked at.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel
from relume.renderers.raytrace.patch_point import CLOSE, INSIDE, TOUCH, polish

CENTRE, RADIUS, AXIS, BENT, BENT_AROUND, FRAME, LIMITS, SPAN, NET, WIDTH = 0, 3, 4, 7, 8, 9, 18, 24, 28, 76
"""Where a leaf's measures begin; their number.

CENTRE, RADIUS : of its bounding sphere, metres
AXIS : its mean normal
BENT, BENT_AROUND : sine of the greatest angle of its normals to that; the same of a little more than the leaf
FRAME : (3, 3), what turns metres from the centre into its u and v, both −½ … ½ or so, and height
LIMITS : (3, 2), the least and greatest of these
SPAN : where it begins in the patch's u and v, and how long it is
NET : its control points
"""

PIECE = 52
"""Numbers to a piece of a leaf: its control points as the ray sees them, and its span in the leaf."""
LEVELS = 80
"""Pieces that wait at most: halved this often one is too small to matter."""


@kernel
def meet_leaf(measures, i, origin, direction, beyond, reach, footprint, pieces):
    """The nearest distance in (beyond, reach) at which a ray meets a leaf, and the patch's u and v; ∞ if there is none.

    i : where its measures begin
    footprint : radians, the width of the cone that the ray stands for
    pieces : room for LEVELS × PIECE numbers
    """
    dx, dy, dz = direction
    x, y, z = origin[0] - measures[i], origin[1] - measures[i + 1], origin[2] - measures[i + 2]
    squared, radius = dx * dx + dy * dy + dz * dz, measures[i + RADIUS]
    mx, my, mz = dy * z - dz * y, dz * x - dx * z, dx * y - dy * x
    if mx * mx + my * my + mz * mz > squared * radius * radius:
        return np.inf, 0.0, 0.0
    # Its own box, not cut short: where Newton's steps begin, and so the last digits of where they end, must not depend
    # on what is asked.
    enter, leave = -np.inf, np.inf
    u, v, du, dv = 0.5, 0.5, 0.0, 0.0
    for k in range(3):
        f, limits = i + FRAME + 3 * k, i + LIMITS + 2 * k
        here = measures[f] * x + measures[f + 1] * y + measures[f + 2] * z
        step = measures[f] * dx + measures[f + 1] * dy + measures[f + 2] * dz
        first, last = (measures[limits] - here) / step, (measures[limits + 1] - here) / step
        # Along a side both are ±∞ or NaN, which compares as false.
        if first > last:
            first, last = last, first
        enter = first if first > enter else enter
        leave = last if last < leave else leave
        if k == 0:
            u, du = u + here, step
        elif k == 1:
            v, dv = v + here, step
    if not (enter <= leave and enter < reach and leave > beyond):
        return np.inf, 0.0, 0.0
    slope = abs(dx * measures[i + AXIS] + dy * measures[i + AXIS + 1] + dz * measures[i + AXIS + 2])
    slope /= np.sqrt(squared)
    if slope > measures[i + BENT]:
        middle = (enter + leave) / 2
        u, v = min(max(u + middle * du, 0.0), 1.0), min(max(v + middle * dv, 0.0), 1.0)
        end, t, u, v = polish(measures, i + NET, radius, origin, direction, u, v)
        if end == INSIDE:
            return _in_patch(measures, i, t if beyond < t < reach else np.inf, u, v)
        # The one place where the ray meets a little more than the leaf is not in it.
        if end == CLOSE and slope > measures[i + BENT_AROUND]:
            return np.inf, 0.0, 0.0
    return _search(measures, i, origin, direction, beyond, reach, footprint, pieces)


@kernel
def _in_patch(measures, i, t, u, v):
    """The distance, and a leaf's u and v as the patch's."""
    s = i + SPAN
    return t, measures[s] + u * measures[s + 2], measures[s + 1] + v * measures[s + 3]


@kernel
def _search(measures, i, origin, direction, beyond, reach, footprint, pieces):
    """Halve a leaf as often as needed; as `meet_leaf`."""
    length = np.sqrt(direction[0] ** 2 + direction[1] ** 2 + direction[2] ** 2)
    _see_along(measures, i + NET, origin, direction, length, pieces)
    radius = measures[i + RADIUS]
    near, best, best_u, best_v, found = beyond * length, reach * length, 0.0, 0.0, False
    top = 1
    while top > 0:
        top -= 1
        n = PIECE * top
        # The bounding sphere; the ray is the third axis.
        x = (pieces[n] + pieces[n + 9] + pieces[n + 36] + pieces[n + 45]) / 4
        y = (pieces[n + 1] + pieces[n + 10] + pieces[n + 37] + pieces[n + 46]) / 4
        z = (pieces[n + 2] + pieces[n + 11] + pieces[n + 38] + pieces[n + 47]) / 4
        squared = 0.0
        for k in range(n, n + 48, 3):
            px, py, pz = pieces[k] - x, pieces[k + 1] - y, pieces[k + 2] - z
            squared = max(squared, px * px + py * py + pz * pz)
        sphere = np.sqrt(squared) + TOUCH * radius + 1e-15 * abs(z)
        if x * x + y * y > sphere * sphere or z - sphere > best or z + sphere < near:
            continue
        apart, width, folded, longer_u = _look_at(pieces, n, TOUCH * radius + 1e-15 * abs(z))
        if apart:
            continue
        finest = max(footprint * z, TOUCH * radius)
        last = 2 * sphere <= finest or width <= finest or top + 2 > LEVELS
        if last or not folded:
            end, t, u, v = polish(pieces, n, radius, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.5)
            if end == INSIDE:
                if near < t < best:
                    best, found = t, True
                    best_u, best_v = pieces[n + 48] + u * pieces[n + 50], pieces[n + 49] + v * pieces[n + 51]
                continue
        if not last:
            _halve(pieces, n, longer_u)
            top += 2
    return _in_patch(measures, i, best / length if found else np.inf, best_u, best_v)


@kernel
def _see_along(net, i, origin, direction, length, pieces):
    """Write the control points from i on as the first piece, in metres from the origin across the ray and along it."""
    wx, wy, wz = direction[0] / length, direction[1] / length, direction[2] / length
    # Duff et al. 2017, "Building an orthonormal basis, revisited".
    sign = np.copysign(1.0, wz)
    c = -1 / (sign + wz)
    ax, ay, az = 1 + sign * wx * wx * c, sign * wx * wy * c, -sign * wx
    bx, by, bz = wx * wy * c, sign + wy * wy * c, -wy
    for k in range(0, 48, 3):
        x, y, z = net[i + k] - origin[0], net[i + k + 1] - origin[1], net[i + k + 2] - origin[2]
        pieces[k] = ax * x + ay * y + az * z
        pieces[k + 1] = bx * x + by * y + bz * z
        pieces[k + 2] = wx * x + wy * y + wz * z
    pieces[48], pieces[49], pieces[50], pieces[51] = 0.0, 0.0, 1.0, 1.0


@kernel
def _look_at(pieces, n, margin):
    """The piece at n as seen along the ray.

    Whether all of it is on one side, farther than the margin, of the line through the ray along one of its borders; how
    wide it is seen across that border where it is least; whether it may be folded, so that the ray can meet it twice;
    whether it is longer along u than along v.
    """
    ux, uy, vx, vy, along_u, along_v = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        for k in range(4):
            a, b = n + 12 * j + 3 * k, n + 12 * k + 3 * j
            x, y, z = pieces[a + 12] - pieces[a], pieces[a + 13] - pieces[a + 1], pieces[a + 14] - pieces[a + 2]
            ux, uy, along_u = ux + x, uy + y, along_u + (x * x + y * y + z * z)
            x, y, z = pieces[b + 3] - pieces[b], pieces[b + 4] - pieces[b + 1], pieces[b + 5] - pieces[b + 2]
            vx, vy, along_v = vx + x, vy + y, along_v + (x * x + y * y + z * z)
    ux, uy, vx, vy = ux / 12, uy / 12, vx / 12, vy / 12
    mean_u, mean_v = np.sqrt(ux * ux + uy * uy), np.sqrt(vx * vx + vy * vy)
    apart, width = False, np.inf
    for start, end in ((n, n + 36), (n + 9, n + 45), (n, n + 9), (n + 36, n + 45)):
        x, y = pieces[end] - pieces[start], pieces[end + 1] - pieces[start + 1]
        length = np.sqrt(x * x + y * y)
        if length > 0:
            low, high = np.inf, -np.inf
            for k in range(n, n + 48, 3):
                across = x * pieces[k + 1] - y * pieces[k]
                low, high = min(low, across), max(high, across)
            apart |= low > margin * length or -high > margin * length
            width = min(width, (high - low) / length)
    # Differences along u are within `off_u` of their mean, and those along v within `off_v` of theirs. Where the means'
    # product is greater than that can take from it, every such product has its sign: nowhere is the piece folded.
    off_u, off_v = 0.0, 0.0
    for j in range(3):
        for k in range(4):
            a, b = n + 12 * j + 3 * k, n + 12 * k + 3 * j
            x, y = pieces[a + 12] - pieces[a] - ux, pieces[a + 13] - pieces[a + 1] - uy
            off_u = max(off_u, x * x + y * y)
            x, y = pieces[b + 3] - pieces[b] - vx, pieces[b + 4] - pieces[b + 1] - vy
            off_v = max(off_v, x * x + y * y)
    off_u, off_v = np.sqrt(off_u), np.sqrt(off_v)
    folded = abs(ux * vy - uy * vx) <= mean_u * off_v + mean_v * off_u + off_u * off_v
    return apart, width, folded, along_u > along_v


@kernel
def _halve(pieces, n, across_u):
    """Put the two halves of the piece at n in its place and the next, the nearer one last (de Casteljau)."""
    stride, row = (12, 3) if across_u else (3, 12)
    start, end = pieces[n + 2] + pieces[n + 2 + 3 * row], pieces[n + 2 + 3 * stride] + pieces[n + 47]
    first, second = (n + PIECE, n) if start < end else (n, n + PIECE)
    for j in range(4):
        for k in range(3):
            s = row * j + k
            a, b = pieces[n + s], pieces[n + s + stride]
            c, d = pieces[n + s + 2 * stride], pieces[n + s + 3 * stride]
            ab, bc, cd = (a + b) / 2, (b + c) / 2, (c + d) / 2
            abc, bcd = (ab + bc) / 2, (bc + cd) / 2
            middle = (abc + bcd) / 2
            pieces[first + s], pieces[first + s + stride] = a, ab
            pieces[first + s + 2 * stride], pieces[first + s + 3 * stride] = abc, middle
            pieces[second + s], pieces[second + s + stride] = middle, bcd
            pieces[second + s + 2 * stride], pieces[second + s + 3 * stride] = cd, d
    u, v, du, dv = pieces[n + 48], pieces[n + 49], pieces[n + 50], pieces[n + 51]
    half_u, half_v = (du / 2, dv) if across_u else (du, dv / 2)
    for s in (first, second):
        pieces[s + 48], pieces[s + 49], pieces[s + 50], pieces[s + 51] = u, v, half_u, half_v
    pieces[second + 48] += du - half_u
    pieces[second + 49] += dv - half_v
