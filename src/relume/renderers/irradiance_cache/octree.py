"""Records of irradiance in an octree (Ward et al. 1988, §3): those that may be used at a place are found at once.

A record is kept in the smallest cube that is at least as large as the disc in which it may be used, and is looked for
in every cube that is not farther away than its own half side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import exact_kernel
from relume.renderers.raytrace.kernel import unowned

LEVELS = 24
"""Cubes within cubes, at most."""
MOST_FOUND = 512
"""Records that are used at one place, at most."""
BEHIND = 0.05
"""Share of its distance by which a place may lie below a record's surface: what lies deeper is another surface."""


class Tree(NamedTuple):
    """Cubes and what they keep; M cubes, R records.

    cube : (4,) the root's middle and half side, metres
    children : (M, 8) int32, −1 for none; head : (M,) int32, the first record that is kept here, −1 for none
    following : (R,) int32, the record after each in the same cube, −1 for none
    place, normal : (R, 3); reach : (R,) metres, the harmonic mean distance R_i
    """

    cube: np.ndarray
    children: np.ndarray
    head: np.ndarray
    following: np.ndarray
    place: np.ndarray
    normal: np.ndarray
    reach: np.ndarray


class Octree:
    """A tree that grows: the one thing here that is changed in place."""

    def __init__(self, low: np.ndarray, high: np.ndarray, most_reach: float) -> None:
        """An empty tree over a box, metres, for records that are used up to `most_reach` away."""
        half = max(float((high - low).max()) / 2, most_reach) * 1.001
        self.tree = Tree(
            np.array([*((low + high) / 2), half]), np.full((64, 8), -1, np.int32), np.full(64, -1, np.int32),
            np.full(64, -1, np.int32), np.zeros((64, 3)), np.zeros((64, 3)), np.zeros(64),
        )  # fmt: skip
        self.cubes, self.records = 1, 0

    def insert(self, place: np.ndarray, normal: np.ndarray, reach: float, radius: float) -> None:
        """A record that may be used up to `radius` away, metres."""
        tree = self.tree
        if self.cubes + LEVELS > len(tree.head) or self.records + 1 > len(tree.reach):
            more = {name: getattr(tree, name) for name in tree._fields[1:]}
            more = {n: np.concatenate([v, np.full_like(v, -1 if v.dtype == np.int32 else 0)]) for n, v in more.items()}
            tree = self.tree = tree._replace(**more)
        index = self.records
        tree.place[index], tree.normal[index], tree.reach[index] = place, normal, reach
        self.cubes = _insert(tree, index, radius, self.cubes)
        self.records += 1

    def first_bare(self, places: np.ndarray, normals: np.ndarray, begin: int, error: float) -> int:
        """The first of the places from `begin` on where no record has an error below `error`; N where none is bare."""
        return _first_bare(self.tree, places, normals, begin, error)

    def weights(
        self, places: np.ndarray, normals: np.ndarray, error: float, threads: int | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The records that may be used at N places, and how much each counts; the weights of a place add up to 1.

        first, record, weight : a sparse matrix; place i has those from `first[i]` to `first[i + 1]`
        """
        count = np.zeros(len(places), np.int64)

        def weigh(first: np.ndarray, *found: np.ndarray) -> None:
            at = (self.tree, places, normals, error)
            in_threads(lambda b, e: _weigh(*at, b, e, count, first, *found), len(places), threads)

        weigh(count, np.zeros(0, np.int32), np.zeros(0))
        first = np.concatenate([[0], np.cumsum(count)])
        found = np.empty(first[-1], np.int32), np.empty(first[-1])
        weigh(first, *found)
        return first, *found


@exact_kernel
def _insert(tree, index, radius, cubes):
    """Hang a record into its cube, which is made where it is not there; the number of cubes then."""
    cube, children, head, following, place, _, _ = tree
    x, y, z, half = cube[0], cube[1], cube[2], cube[3]
    node = 0
    for _ in range(LEVELS - 1):
        if half / 2 < radius:
            break
        half /= 2
        octant = 0
        if place[index, 0] > x:
            octant += 1
        if place[index, 1] > y:
            octant += 2
        if place[index, 2] > z:
            octant += 4
        x += half if octant & 1 else -half
        y += half if octant & 2 else -half
        z += half if octant & 4 else -half
        if children[node, octant] < 0:
            children[node, octant] = cubes
            cubes += 1
        node = children[node, octant]
    following[index] = head[node]
    head[node] = index
    return cubes


@exact_kernel
def _find(cube, children, head, following, place, normal, reach, at, facing, error, found, errors, waiting, middles):
    """Write the records whose error at a place is below `error`, and these errors; how many there are.

    ε = |x − x_i| / R_i + √(1 − n·n_i)      (Ward et al. 1988, eq. 9)
    """
    count, top = 0, 1
    waiting[0] = 0
    middles[0, 0], middles[0, 1], middles[0, 2], middles[0, 3] = cube[0], cube[1], cube[2], cube[3]
    while top > 0:
        top -= 1
        node = waiting[top]
        x, y, z, half = middles[top, 0], middles[top, 1], middles[top, 2], middles[top, 3]
        record = head[node]
        while record >= 0:
            dx, dy, dz = at[0] - place[record, 0], at[1] - place[record, 1], at[2] - place[record, 2]
            near = np.sqrt(dx * dx + dy * dy + dz * dz) / reach[record]
            if near < error and count < MOST_FOUND:
                nx, ny, nz = normal[record, 0], normal[record, 1], normal[record, 2]
                turned = 1 - (nx * facing[0] + ny * facing[1] + nz * facing[2])
                deep = (dx * (nx + facing[0]) + dy * (ny + facing[1]) + dz * (nz + facing[2])) / 2
                here = near + np.sqrt(max(turned, 0.0))
                if here < error and deep > -BEHIND * reach[record]:
                    found[count], errors[count] = record, here
                    count += 1
            record = following[record]
        half /= 2
        for octant in range(8):
            child = children[node, octant]
            if child >= 0:
                cx = x + (half if octant & 1 else -half)
                cy = y + (half if octant & 2 else -half)
                cz = z + (half if octant & 4 else -half)
                if max(abs(at[0] - cx), abs(at[1] - cy), abs(at[2] - cz)) <= 2 * half:
                    waiting[top] = child
                    middles[top, 0], middles[top, 1], middles[top, 2], middles[top, 3] = cx, cy, cz, half
                    top += 1
    return count


@exact_kernel
def _first_bare(tree, places, normals, begin, error):
    """The first place without a record, or the number of places."""
    cube, children, head, following, place, normal, reach = unowned(tree)
    found, errors = np.empty(MOST_FOUND, np.int32), np.empty(MOST_FOUND)
    waiting, middles = np.empty(8 * LEVELS, np.int32), np.empty((8 * LEVELS, 4))
    for i in range(begin, len(places)):
        at, facing = (places[i, 0], places[i, 1], places[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        if not _find(
            cube, children, head, following, place, normal, reach, at, facing, error, found, errors, waiting, middles
        ):
            return i
    return len(places)


@exact_kernel
def _weigh(tree, places, normals, error, begin, end, count, first, record, weight):
    """Write how many records each place has; and, where there is room for them, which, with weights that add up to 1.

    1/ε − 1/a instead of Ward's 1/ε, so that a record's light fades in where its disc begins.
    """
    cube, children, head, following, place, normal, reach = unowned(tree)
    found, errors = np.empty(MOST_FOUND, np.int32), np.empty(MOST_FOUND)
    waiting, middles = np.empty(8 * LEVELS, np.int32), np.empty((8 * LEVELS, 4))
    for i in range(begin, end):
        at, facing = (places[i, 0], places[i, 1], places[i, 2]), (normals[i, 0], normals[i, 1], normals[i, 2])
        many = _find(
            cube, children, head, following, place, normal, reach, at, facing, error, found, errors, waiting, middles
        )
        count[i] = many
        if len(record):
            total = 0.0
            for k in range(many):
                errors[k] = 1 / max(errors[k], 1e-9) - 1 / error
                total += errors[k]
            for k in range(many):
                record[first[i] + k], weight[first[i] + k] = found[k], errors[k] / total
