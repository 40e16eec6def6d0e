"""What a lens sees past the edge of a near thing and a pinhole does not: background continued behind it."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel

STEP = 1.0
"""Pixels of radius between neighbours from which one hides the other; slanted surfaces differ by less."""


def unmixed(radius: np.ndarray) -> np.ndarray:
    """Radii (H, W) float32 of which none is between those of the two sides of an edge: such pixels go to the near side.

    A pixel that the edge crosses has the mean of both depths, at which there is nothing: its light would be blurred as
    neither side is, and a sharp thing before a blurred background would have a staircase for an edge.
    """
    result = np.empty_like(radius)
    _to_near_side(radius, result)
    return result


def hidden_background(radiance: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What stands for the background behind each pixel, and where the lens can look past an edge at all.

    radiance : (H, W, 3) float32
    radius : (H, W) float32, of the disc of confusion, pixels, below 0 before the focus: it grows with the distance

    The first is (H, W) int32: the pixel, counted along the rows, whose light is taken; −1 where nothing hidden can come
    to be seen, farther from an edge than the discs on both its sides reach. Behind a near thing the background goes on
    as if mirrored in its edge; of three places there the one of middle luminance counts, so that no lamp beside the
    edge is seen twice. The second is (H, W) bool: whether an edge to what is behind lies within a pixel's own disc.
    """
    behind = np.full(radius.shape, -1, np.int32)
    _find_edges(radius, behind)
    chosen, opening = np.full(radius.shape, -1, np.int32), np.zeros(radius.shape, bool)
    _choose(radiance, radius, behind, chosen, opening)
    return chosen, opening


@exact_kernel
def _to_near_side(radius, result):
    height, width = radius.shape
    for y in range(height):
        for x in range(width):
            own = radius[y, x]
            near, far = own, own
            for v in range(max(y - 1, 0), min(y + 2, height)):
                for u in range(max(x - 1, 0), min(x + 2, width)):
                    near, far = min(near, radius[v, u]), max(far, radius[v, u])
            result[y, x] = near if own > near + STEP and own < far - STEP else own


@exact_kernel
def _find_edges(radius, behind):
    """The nearest pixel of the background, passed on from neighbour to neighbour (Danielsson 1980), in two sweeps."""
    height, width = radius.shape
    for sweep in range(2):
        way = 1 if sweep == 0 else -1
        for i in range(height):
            y = i if way > 0 else height - 1 - i
            for j in range(width):
                x = j if way > 0 else width - 1 - j
                _ask(radius, behind, y, x, y, x - way)
                _ask(radius, behind, y, x, y - way, x - way)
                _ask(radius, behind, y, x, y - way, x)
                _ask(radius, behind, y, x, y - way, x + way)
            for j in range(width - 1, -1, -1):
                x = j if way > 0 else width - 1 - j
                _ask(radius, behind, y, x, y, x + way)


@exact_kernel
def _ask(radius, behind, y, x, v, u):
    """Take over a neighbour, or what is behind it, if that is background here too and nearer than what is known."""
    height, width = radius.shape
    if v < 0 or v >= height or u < 0 or u >= width:
        return
    own = radius[y, x]
    found = v * width + u if radius[v, u] > own + STEP else behind[v, u]
    if found < 0:
        return
    row, column = found // width, found % width
    if radius[row, column] <= own + STEP:
        return
    distance = (row - y) ** 2 + (column - x) ** 2
    limit = abs(own) + abs(radius[row, column]) + 1
    if distance > limit * limit:
        return
    known = behind[y, x]
    if known < 0 or distance < (known // width - y) ** 2 + (known % width - x) ** 2:
        behind[y, x] = found


@exact_kernel
def _choose(radiance, radius, behind, chosen, opening):
    """Of three places beyond the edge the one whose luminance is in the middle, in place of the nearest one."""
    height, width = radius.shape
    for y in range(height):
        for x in range(width):
            nearest = behind[y, x]
            if nearest < 0:
                continue
            row, column = nearest // width, nearest % width
            distance = np.sqrt(float((row - y) ** 2 + (column - x) ** 2))
            opening[y, x] = distance <= abs(radius[y, x]) + 1
            down, right = (row - y) / distance, (column - x) / distance
            # The edge's own pixel is often a mixture of both sides.
            a = _beyond(radius, y, x, nearest, down, right, 1 + distance / 3)
            b = _beyond(radius, y, x, nearest, down, right, 2 + 2 * distance / 3)
            c = _beyond(radius, y, x, nearest, down, right, 3 + distance)
            light_a, light_b, light_c = _luminance(radiance, a), _luminance(radiance, b), _luminance(radiance, c)
            middle = a
            if min(light_a, light_c) <= light_b <= max(light_a, light_c):
                middle = b
            elif min(light_a, light_b) <= light_c <= max(light_a, light_b):
                middle = c
            chosen[y, x] = middle


@exact_kernel
def _beyond(radius, y, x, nearest, down, right, distance):
    """The pixel that far beyond the edge, or the edge's own where that one is no background."""
    height, width = radius.shape
    row = int(np.rint(nearest // width + down * distance))
    column = int(np.rint(nearest % width + right * distance))
    if row < 0 or row >= height or column < 0 or column >= width or radius[row, column] <= radius[y, x] + STEP:
        return nearest
    return row * width + column


@exact_kernel
def _luminance(radiance, pixel):
    row, column = pixel // radiance.shape[1], pixel % radiance.shape[1]
    return 0.2126 * radiance[row, column, 0] + 0.7152 * radiance[row, column, 1] + 0.0722 * radiance[row, column, 2]
