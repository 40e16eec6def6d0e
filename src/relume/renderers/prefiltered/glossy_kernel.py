"""The loop that looks glossy maps up: once at a sample's middle, or several times over what it reflects."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel
from relume.light.reflection.glossy_lookup import glossy


@kernel
def lookup_glossy(seen, chosen, samples, tables, tilts, most):
    """Fill `seen` (Q, 4) for the chosen samples, with up to `most`² look-ups where normals turn within a sample."""
    entry = np.float32(np.pi / (tables.shape[1] - 2))
    normals, views = np.empty((4, 3), np.float32), np.empty((4, 3), np.float32)
    middle_normals, middle_views, surface, corners = samples.normal, samples.to_eye, samples.surface, samples.corners
    corner_normals, corner_views, corner_surface = samples.corner_normal, samples.corner_to_eye, samples.corner_surface
    for place in range(len(chosen)):
        index = chosen[place]
        nx, ny, nz = middle_normals[index, 0], middle_normals[index, 1], middle_normals[index, 2]
        ex, ey, ez = middle_views[index, 0], middle_views[index, 1], middle_views[index, 2]
        whole = True
        spread = np.float32(0)
        for corner in range(4):
            other = corners[index, corner]
            whole = whole and corner_surface[other] == surface[index]
            turn = np.float32(0)
            for axis in range(3):
                normals[corner, axis] = corner_normals[other, axis]
                views[corner, axis] = corner_views[other, axis]
                turn += (normals[corner, axis] - middle_normals[index, axis]) ** 2
            spread = max(spread, turn)
        # A normal that turns by an angle turns the reflected direction by twice that, to either side of the middle.
        side = min(int(np.ceil(4 * np.sqrt(spread) / entry)), most) if whole else 1
        red = green = blue = np.float32(0)
        if side <= 1:
            red, green, blue = glossy(tables, tilts, nx, ny, nz, ex, ey, ez)
        else:
            for step in range(side * side):
                right = (np.float32(step % side) + np.float32(0.5)) / np.float32(side)
                down = (np.float32(step // side) + np.float32(0.5)) / np.float32(side)
                left, above = np.float32(1) - right, np.float32(1) - down
                nx, ny, nz, length = _between(normals, left, right, above, down)
                ex, ey, ez, distance = _between(views, left, right, above, down)
                part = glossy(
                    tables, tilts, nx / length, ny / length, nz / length, ex / distance, ey / distance, ez / distance
                )
                red, green, blue = red + part[0], green + part[1], blue + part[2]
            share = np.float32(1) / np.float32(side * side)
            red, green, blue = red * share, green * share, blue * share
        seen[place, 0], seen[place, 1], seen[place, 2] = red, green, blue


@kernel
def _between(corners, left, right, above, down):
    """The vector at a place inside the quadrilateral, and its length."""
    upper, lower = above * left, down * left
    x = corners[0, 0] * upper + corners[1, 0] * above * right + corners[2, 0] * down * right + corners[3, 0] * lower
    y = corners[0, 1] * upper + corners[1, 1] * above * right + corners[2, 1] * down * right + corners[3, 1] * lower
    z = corners[0, 2] * upper + corners[1, 2] * above * right + corners[2, 2] * down * right + corners[3, 2] * lower
    return x, y, z, max(np.sqrt(x * x + y * y + z * z), np.float32(1e-12))
