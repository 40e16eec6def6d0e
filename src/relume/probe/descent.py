"""The two sums by which a ball's rim is placed, brought to their least: compiled loops, since each is looked at some
hundred times for every circle that is tried.

Ellipses are moved by three numbers: to the right, down and outward, pixels. The descent is Nelder & Mead's simplex
(1965) with the usual steps: 1, 2 and a half.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_inlined, exact_kernel, exact_small

NOWHERE = (np.inf, -np.inf, np.inf)
"""Limits that hold nothing."""
GRAIN = 1 / 32
"""Pixels to which places are rounded that are looked up in a picture: finer ones let the descent go on along curves of
chance texture, and two of 57 pictures without a ball were then taken for one, with a doubt."""
PENALTY = 1e3
"""Of a pixel beyond the limits."""


def least_along(
    starts: np.ndarray,
    costs: np.ndarray,
    steps: np.ndarray,
    normals: np.ndarray,
    first: float,
    tolerances: tuple[float, float],
    *,
    tried: int = 1,
    limits: tuple[float, float, float] = NOWHERE,
) -> tuple[np.ndarray, float]:
    """The move (3,) of an ellipse to where the sum of a cost along it is least, and that sum.

    starts : (S, 3) moves, of which the best `tried` are followed down
    costs : (N, K) at even `steps` (K,), pixels, along `normals` (N, 2)
    first : pixels, the first steps
    tolerances : of the move, pixels, and of the sum, at which it ends
    limits : how far it is moved aside at most, and how far outward at least and at most, pixels
    """
    spacing = float(steps[1] - steps[0])
    data = np.ascontiguousarray(costs, np.float64), float(steps[0]), spacing, np.ascontiguousarray(normals), limits
    sums = _sums_along(np.ascontiguousarray(starts, np.float64), *data)
    best: tuple[np.ndarray, float] | None = None
    for start in starts[np.argsort(sums, kind="stable")[:tried]]:
        found, value = _down_along(start + first * np.vstack([np.zeros(3), np.eye(3)]), *tolerances, *data)
        if best is None or value < best[1]:
            best = found, float(value)
    assert best is not None
    return best


@exact_inlined
def _descended(cost, data, simplex, near, alike, most):
    """The best corner (D,) of a simplex (D + 1, D) that has crept down a cost, and its cost. The simplex is changed."""
    last = len(simplex) - 1
    values = np.empty(last + 1)
    for corner in range(last + 1):
        values[corner] = cost(simplex[corner], data)
    moved, other = np.empty(last), np.empty(last)
    for _ in range(most):
        _sort(simplex, values)
        if _spread(simplex) <= near and values[last] - values[0] <= alike:
            break
        _step(simplex, 1.0, moved)
        value = cost(moved, data)
        if value < values[0]:
            _step(simplex, 2.0, other)
            there = cost(other, data)
            if there < value:
                moved[:], value = other, there
        elif value >= values[last - 1]:
            outside = value < values[last]
            _step(simplex, 0.5 if outside else -0.5, other)
            there = cost(other, data)
            if there < values[last] and (not outside or there <= value):
                moved[:], value = other, there
            else:
                for corner in range(1, last + 1):
                    for axis in range(last):
                        simplex[corner, axis] = (simplex[0, axis] + simplex[corner, axis]) / 2
                    values[corner] = cost(simplex[corner], data)
                continue
        simplex[last, :] = moved
        values[last] = value
    _sort(simplex, values)
    return simplex[0].copy(), values[0]


@exact_small
def _sort(simplex, values):
    """Put the best corner first and the worst last."""
    for corner in range(1, len(values)):
        place = corner
        while place > 0 and values[place] < values[place - 1]:
            values[place], values[place - 1] = values[place - 1], values[place]
            for axis in range(simplex.shape[1]):
                kept = simplex[place, axis]
                simplex[place, axis] = simplex[place - 1, axis]
                simplex[place - 1, axis] = kept
            place -= 1


@exact_small
def _spread(simplex):
    """The most by which a corner is off the first, along any axis."""
    most = 0.0
    for corner in range(1, len(simplex)):
        for axis in range(simplex.shape[1]):
            most = max(most, abs(simplex[corner, axis] - simplex[0, axis]))
    return most


@exact_small
def _step(simplex, beyond, out):
    """From the worst corner through the middle of the others and, by so much of that way, beyond."""
    last = len(simplex) - 1
    for axis in range(last):
        middle = 0.0
        for corner in range(last):
            middle += simplex[corner, axis] / last
        out[axis] = middle + beyond * (middle - simplex[last, axis])


@exact_small
def _along(by, data):
    """The sum of a cost (N, K) along an ellipse moved right, down and outward, pixels."""
    costs, low, spacing, normals, limits = data
    total, last = 0.0, costs.shape[1] - 1
    for ray in range(len(costs)):
        place = (by[2] + normals[ray, 0] * by[0] + normals[ray, 1] * by[1] - low) / spacing
        place = min(max(place, 0.0), float(last))
        index = min(int(place), last - 1)
        part = place - index
        total += (1 - part) * costs[ray, index] + part * costs[ray, index + 1]
    aside, least, most = limits
    beyond = max(0.0, np.hypot(by[0], by[1]) - aside) + max(0.0, least - by[2]) + max(0.0, by[2] - most)
    return total + PENALTY * beyond


@exact_kernel
def _sums_along(moves, costs, low, spacing, normals, limits):
    found = np.empty(len(moves))
    for move in range(len(moves)):
        found[move] = _along(moves[move], (costs, low, spacing, normals, limits))
    return found


@exact_kernel
def _down_along(simplex, near, alike, costs, low, spacing, normals, limits):
    return _descended(_along, (costs, low, spacing, normals, limits), simplex, near, alike, 600)


@exact_small
def _unseen(circle, data):
    """Minus how much a picture changes across an ellipse (x, y, radius): the mean of ln(1 + change²)."""
    right, down, ring, focal_length, principal, least = data
    height, width = right.shape
    # A ball aside of the middle is longer towards it.
    aside_x, aside_y = circle[0] - principal[0], circle[1] - principal[1]
    aside = np.hypot(aside_x, aside_y)
    longer = np.hypot(1.0, aside / focal_length) - 1
    way_x, way_y = aside_x / max(aside, 1e-9), aside_y / max(aside, 1e-9)
    total, within = 0.0, 0
    for point in range(len(ring)):
        towards = longer * (ring[point, 0] * way_x + ring[point, 1] * way_y)
        x = circle[0] + circle[2] * (ring[point, 0] + towards * way_x)
        y = circle[1] + circle[2] * (ring[point, 1] + towards * way_y)
        if not (0 < x < width and 0 < y < height):
            continue
        within += 1
        x, y = np.rint((x - 0.5) / GRAIN) * GRAIN, np.rint((y - 0.5) / GRAIN) * GRAIN
        x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
        column, row = min(int(x), width - 2), min(int(y), height - 2)
        x, y = x - column, y - row
        above = (1 - x) * right[row, column] + x * right[row, column + 1]
        below = (1 - x) * right[row + 1, column] + x * right[row + 1, column + 1]
        change = ((1 - y) * above + y * below) * ring[point, 0]
        above = (1 - x) * down[row, column] + x * down[row, column + 1]
        below = (1 - x) * down[row + 1, column] + x * down[row + 1, column + 1]
        change += ((1 - y) * above + y * below) * ring[point, 1]
        # The logarithm lets a long weak edge outweigh a short strong one.
        total += np.log1p(change * change)
    return -total / max(float(within), least * len(ring))


@exact_kernel
def down_across(right, down, ring, focal_length, principal, least, simplex, near, alike, most):
    """The circle (x, y, radius) at which a picture changes most across it, near a simplex (4, 3), and minus how much.

    right, down : (H, W) float32, how the picture changes that way, against its noise
    ring : (N, 2) unit vectors out of the circle
    focal_length, principal : pixels, the principal point (x, y); a circle aside of it is drawn longer towards it
    least : share of the circle in the picture of which the mean is taken at least
    near, alike : of the circle, pixels, and of the mean, at which the descent ends; after `most` steps at the latest
    """
    return _descended(_unseen, (right, down, ring, focal_length, principal, least), simplex, near, alike, most)
