"""One place of a bicubic Bézier patch: its point, tangents and normal, and Newton's steps to where a ray meets it.

A patch's control points are the 48 numbers of a (4, 4, 3) array, in a table that may hold more.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel

ELSEWHERE, CLOSE, INSIDE = 0, 1, 2
"""Where Newton's steps end: nowhere, or far outside the patch; outside it, but within BEYOND of it; inside."""

BEYOND = 1 / 8
"""How far outside, in the patch's lengths, is close."""

TOUCH = 1e-9
"""A ray that passes a patch by less than this share of its radius meets it, so that none slips between neighbours."""

EDGE_ON = 1e-13
"""Cosine between a ray and a normal below which the ray lies in the surface, as far as rounding can say."""

STEPS = 12
"""Of Newton's at most; four are usual."""


@kernel
def point_and_tangents(net, i, u, v):
    """P, ∂P/∂u and ∂P/∂v at (u, v) of the patch whose control points begin at i: three triples."""
    p, q = 1 - u, 1 - v
    b0, b1, b2, b3 = q * q * q, 3 * q * q * v, 3 * q * v * v, v * v * v
    d0, d1, d2, d3 = -3 * q * q, 3 * q * (q - 2 * v), 3 * v * (2 * q - v), 3 * v * v
    weights = (p * p * p, 3 * p * p * u, 3 * p * u * u, u * u * u)
    slopes = (-3 * p * p, 3 * p * (p - 2 * u), 3 * u * (2 * p - u), 3 * u * u)
    x, y, z, ux, uy, uz, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(4):
        k, weight, slope = i + 12 * j, weights[j], slopes[j]
        rx = b0 * net[k] + b1 * net[k + 3] + b2 * net[k + 6] + b3 * net[k + 9]
        ry = b0 * net[k + 1] + b1 * net[k + 4] + b2 * net[k + 7] + b3 * net[k + 10]
        rz = b0 * net[k + 2] + b1 * net[k + 5] + b2 * net[k + 8] + b3 * net[k + 11]
        x, y, z = x + weight * rx, y + weight * ry, z + weight * rz
        ux, uy, uz = ux + slope * rx, uy + slope * ry, uz + slope * rz
        vx += weight * (d0 * net[k] + d1 * net[k + 3] + d2 * net[k + 6] + d3 * net[k + 9])
        vy += weight * (d0 * net[k + 1] + d1 * net[k + 4] + d2 * net[k + 7] + d3 * net[k + 10])
        vz += weight * (d0 * net[k + 2] + d1 * net[k + 5] + d2 * net[k + 8] + d3 * net[k + 11])
    return (x, y, z), (ux, uy, uz), (vx, vy, vz)


@kernel
def tangents_and_normal(net, i, u, v):
    """∂P/∂u, ∂P/∂v and the unit normal along their product, at (u, v) of the patch whose control points begin at i.

    Where the product vanishes, as at the poles of a teapot's lid, the normal is its limit from inside.
    """
    _, along_u, along_v = point_and_tangents(net, i, u, v)
    normal, found = _across(along_u, along_v)
    inwards = 1e-6
    while not found and inwards < 0.1:
        _, inner_u, inner_v = point_and_tangents(net, i, u + inwards * (0.5 - u), v + inwards * (0.5 - v))
        normal, found = _across(inner_u, inner_v)
        inwards *= 4
    return along_u, along_v, normal


@kernel
def _across(a, b):
    """The unit vector along a × b, and whether rounding leaves enough digits of it."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    length = np.sqrt(x * x + y * y + z * z)
    scale = a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    share = 1 / length if length > 0 else 0.0
    return (x * share, y * share, z * share), length > 1e-9 * scale


@kernel
def polish(net, i, radius, origin, direction, u, v):
    """Newton's steps from (u, v) to where a ray meets a patch: where they end, the distance, u and v.

    radius : of a sphere round the patch, the measure of what is near
    """
    dx, dy, dz = direction
    squared = dx * dx + dy * dy + dz * dz
    reached, t = False, 0.0
    for _ in range(STEPS):
        p, a, b = point_and_tangents(net, i, u, v)
        x, y, z = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
        # d × (P − o), the offset from the ray: P + ∂P/∂u Δu + ∂P/∂v Δv − t d = o by Cramer's rule.
        mx, my, mz = dy * z - dz * y, dz * x - dx * z, dx * y - dy * x
        nx, ny, nz = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        facing, area = nx * dx + ny * dy + nz * dz, nx * nx + ny * ny + nz * nz
        # Seen edge-on: what is left of `facing` is rounding, which differs from one processor to another. At a pole,
        # where the normal vanishes, it says nothing.
        spanned = a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
        if facing * facing <= EDGE_ON**2 * area * squared and area > 1e-18 * spanned * spanned:
            break
        # At a pole it is the only end: v is any there.
        if mx * mx + my * my + mz * mz <= squared * (1e-3 * TOUCH * radius) ** 2:
            reached, t = True, (x * dx + y * dy + z * dz) / squared
            break
        share = 1 / facing
        step_u = -(b[0] * mx + b[1] * my + b[2] * mz) * share
        step_v = (a[0] * mx + a[1] * my + a[2] * mz) * share
        if not (abs(step_u) < 1e3 and abs(step_v) < 1e3):  # the surface is seen edge-on here
            break
        u, v = u + step_u, v + step_v
        if abs(step_u) < 1e-6 and abs(step_v) < 1e-6:  # squared, the next is below rounding
            reached, t = True, (nx * x + ny * y + nz * z) * share
            break
        u, v = min(max(u, -2 * BEYOND), 1 + 2 * BEYOND), min(max(v, -2 * BEYOND), 1 + 2 * BEYOND)
    if not reached:
        return ELSEWHERE, t, u, v
    if 0 <= u <= 1 and 0 <= v <= 1:
        return INSIDE, t, u, v
    edge_u, edge_v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    p, _, _ = point_and_tangents(net, i, edge_u, edge_v)
    x, y, z = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
    mx, my, mz = dy * z - dz * y, dz * x - dx * z, dx * y - dy * x
    touch = TOUCH * radius + 1e-15 * (abs(x) + abs(y) + abs(z))
    if mx * mx + my * my + mz * mz <= squared * touch * touch:
        return INSIDE, (x * dx + y * dy + z * dz) / squared, edge_u, edge_v
    close = -BEYOND <= u <= 1 + BEYOND and -BEYOND <= v <= 1 + BEYOND
    return (CLOSE if close else ELSEWHERE), t, u, v
