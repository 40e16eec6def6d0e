"""Look-up in a glossy map: between two views, four entries and the azimuth of the viewer."""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import inlined, kernel
from relume.sphere.bilinear_kernels import cell, polar_point


def lookup(padded: np.ndarray, tilts: np.ndarray, normals: np.ndarray, views: np.ndarray) -> np.ndarray:
    """Reflected radiance (…, 3) float32 for unit normals and unit directions to the eye (…, 3).

    padded, tilts : of a `GlossyMap`
    """
    shape = np.broadcast_shapes(np.shape(normals), np.shape(views))
    facing, towards = (
        np.ascontiguousarray(np.broadcast_to(vectors, shape).reshape(-1, 3), np.float32) for vectors in (normals, views)
    )
    seen, leans = np.empty_like(facing), tilts.astype(np.float32)
    in_threads(lambda begin, end: _look_up(padded, leans, facing, towards, seen, begin, end), len(seen))
    return seen.reshape(shape)


@kernel
def _look_up(tables, tilts, normals, views, seen, begin, end):
    for i in range(begin, end):
        seen[i] = glossy(
            tables, tilts, normals[i, 0], normals[i, 1], normals[i, 2], views[i, 0], views[i, 1], views[i, 2]
        )


@inlined
def glossy(tables, tilts, nx, ny, nz, ex, ey, ez):
    """The three channels reflected by a surface of normal N to the eye E."""
    one = np.float32(1)
    facing = min(max(nx * ex + ny * ey + nz * ez, np.float32(0)), one)
    place = np.float32(np.arccos(facing) * (2 / np.pi)) * np.float32(len(tilts) - 1)
    view = min(int(place), len(tilts) - 2)
    nearer = place - np.float32(view)
    tilt = tilts[view] * (one - nearer) + tilts[view + 1] * nearer
    sine, cosine = np.float32(np.sin(tilt)), np.float32(np.cos(tilt))
    # The viewer's side along the surface; seen from the normal every side is the same.
    ax, ay, az = ex - facing * nx, ey - facing * ny, ez - facing * nz
    length = np.sqrt(ax * ax + ay * ay + az * az)
    scale = one / length if length > np.float32(1e-6) else np.float32(0)
    ax, ay, az = ax * scale, ay * scale, az * scale
    cx, cy, cz = cosine * nx - sine * ax, cosine * ny - sine * ay, cosine * nz - sine * az
    tx, ty, tz = cosine * ax + sine * nx, cosine * ay + sine * ny, cosine * az + sine * nz
    u, v = polar_point(cx, cy, cz)
    row, column, down, right = cell(tables[0, :, :, 0], u, v)
    # The azimuth τ of that side about the lobe's centre, from the south towards growing longitude.
    ring = max(np.sqrt(cx * cx + cz * cz), np.float32(1e-9))
    south = cy * (cx * tx + cz * tz) / ring - ring * ty
    east = (cx * tz - cz * tx) / ring
    azimuth = np.arctan2(east, south)
    # An entry's own south differs from the point's by the turn of the meridians between them.
    turn = cy * np.float32(2 * np.pi / (tables.shape[2] - 2))
    red = green = blue = np.float32(0)
    for corner in range(4):
        lower, farther = corner // 2, corner % 2
        share = (down if lower else one - down) * (right if farther else one - right)
        tau = azimuth - turn * ((one - right) if farther else -right)
        first, second = np.float32(np.cos(tau)), np.float32(np.sin(tau))
        for after in range(2):
            weight = share * (nearer if after else one - nearer)
            entry = tables[view + after, row + lower, column + farther]
            phase_cosine, phase_sine = one, np.float32(0)
            red += weight * entry[0, 0]
            green += weight * entry[0, 1]
            blue += weight * entry[0, 2]
            for k in range(1, tables.shape[3] // 2 + 1):
                phase_cosine, phase_sine = (
                    phase_cosine * first - phase_sine * second,
                    phase_sine * first + phase_cosine * second,
                )
                red += weight * (entry[2 * k - 1, 0] * phase_cosine + entry[2 * k, 0] * phase_sine)
                green += weight * (entry[2 * k - 1, 1] * phase_cosine + entry[2 * k, 1] * phase_sine)
                blue += weight * (entry[2 * k - 1, 2] * phase_cosine + entry[2 * k, 2] * phase_sine)
    # A series cut short may swing below zero beside a bright light.
    return max(red, np.float32(0)), max(green, np.float32(0)), max(blue, np.float32(0))
