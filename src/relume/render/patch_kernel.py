"""Rays against bicubic Bézier patches: subdivision under bounding spheres (Whitted 1980, §3), and Newton's steps."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_kernel


@exact_kernel
def patch_tangents(net, i, u, v):
    """∂P/∂u, ∂P/∂v and the unit normal along their product at (u, v) of the patch whose points begin at i.

    Where the product vanishes, as at the poles of a teapot's lid, the normal is its limit from just inside.
    """
    along_u, along_v = _tangents(net, i, u, v)
    normal, found = _direction_across(along_u, along_v)
    inwards = 1e-6
    while not found and inwards < 0.1:
        inwards *= 4
        inner_u, inner_v = _tangents(net, i, u + inwards * (0.5 - u), v + inwards * (0.5 - v))
        normal, found = _direction_across(inner_u, inner_v)
    return along_u, along_v, normal


@exact_kernel
def _direction_across(a, b):
    """The unit vector along a × b, and whether rounding leaves enough digits of it."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    length = np.sqrt(x * x + y * y + z * z)
    scale = a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    share = 1 / length if length > 0 else 0.0
    return (x * share, y * share, z * share), length > 1e-9 * scale


@exact_kernel
def _tangents(net, i, u, v):
    """∂P/∂u and ∂P/∂v at (u, v) of the patch whose sixteen points begin at i."""
    p, q = 1 - u, 1 - v
    weights_u, weights_v = (p * p * p, 3 * p * p * u, 3 * p * u * u, u * u * u), (q * q, 2 * q * v, v * v)
    slopes_u, weights = (p * p, 2 * p * u, u * u), (q * q * q, 3 * q * q * v, 3 * q * v * v, v * v * v)
    ux, uy, uz, vx, vy, vz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        for k in range(4):
            at, share = i + 12 * j + 3 * k, 3 * slopes_u[j] * weights[k]
            ux += share * (net[at + 12] - net[at])
            uy += share * (net[at + 13] - net[at + 1])
            uz += share * (net[at + 14] - net[at + 2])
    for j in range(4):
        for k in range(3):
            at, share = i + 12 * j + 3 * k, 3 * weights_u[j] * weights_v[k]
            vx += share * (net[at + 3] - net[at])
            vy += share * (net[at + 4] - net[at + 1])
            vz += share * (net[at + 5] - net[at + 2])
    return (ux, uy, uz), (vx, vy, vz)
