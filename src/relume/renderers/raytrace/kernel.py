"""One ray against a tree of shapes: the loop below `RayCaster`, and below every kernel that follows rays on its own.

Triangles are tested so that rays find no crack between two that share an edge or a vertex (Woop, Benthin & Wald 2013,
"Watertight ray/triangle intersection"), in double precision.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

from relume.image.kernel import exact_inlined, exact_kernel, exact_small
from relume.renderers.raytrace.four_boxes import MISSED, cross_boxes, key_of
from relume.renderers.raytrace.patch_kernel import LEVELS, PIECE, meet_leaf
from relume.renderers.raytrace.polygon_kernel import meet_polygon

# A distance to a box's side is off by three roundings of 2⁻⁵³, two such are compared, and the later one is rounded once
# more: a box is left this much later.
_LATER = 1 + 8 * 2.0**-53
_IN_ORDER = (np.uint64(0), np.uint64(1), np.uint64(2))

SPHERE, POLYGON, LEAF = 0, 1, 2
"""Kinds of primitives that are no triangles."""

TIE = 1e-6
"""Hits on two shapes whose distances differ by less than this share are one place, and belong to the first shape: so
surfaces that coincide show no speckle. It is what single precision leaves of a vertex."""


class Geometry(NamedTuple):
    """What a ray meets, as kernels take it: the tree's nodes, its primitives in the leaves' order, and planes.

    boxes, children, root, depth : of the tree (`Tree`)
    corners : (P, 9) float32, the triangles' vertices, metres
    form : (P,) int32, −1 for a triangle; or else its kind, and where its measures begin, a multiple of 4
    shape : (P + Q,) int32, each primitive's shape; planes are last
    measures : (M,) float64, of a sphere its centre and radius, metres; of others what their kernels take
    planes : (Q, 3) float64, height and half the lengths along x and z, metres
    """

    boxes: np.ndarray
    children: np.ndarray
    root: int
    depth: int
    corners: np.ndarray
    form: np.ndarray
    shape: np.ndarray
    measures: np.ndarray
    planes: np.ndarray


def _unowned(typing: Any, held: Any) -> Any:
    """The same array, or tuple of arrays and numbers, not owned: to be taken once, before a loop over rays.

    Numba counts the references to each array that is given to a function, even to one compiled into its caller, and
    counts atomically: ten arrays cost a ray 100 ns. Nothing is counted for an array that nobody owns. It lives as long
    as its owner does, so it has to be, or be part of, an argument of the kernel: that one's caller keeps it.
    """

    def without_owner(context: Any, builder: Any, part: Any, value: Any) -> Any:
        if isinstance(part, types.BaseTuple):
            kinds: Any = part
            for i, inner in enumerate(kinds):
                mine = without_owner(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, mine, i)
        elif isinstance(part, types.Array):
            array = make_array(part)(context, builder, value)
            array.meminfo, array.parent = array.meminfo.type(None), array.parent.type(None)
            value = array._getvalue()
        return value

    return held(held), lambda context, builder, signature, given: without_owner(context, builder, held, given[0])


unowned: Any = intrinsic(_unowned)


@exact_kernel
def scratch(geometry):
    """What `meet` notes while it works: what is yet to be visited, where the ray enters it, and pieces of a patch that
    are yet to be looked at. One for each thread."""
    room = 3 * (geometry.depth + 1)
    return np.empty(room, np.int64), np.empty(room, np.int64), np.empty(LEVELS * PIECE)


@exact_inlined
def meet(
    boxes, children, root, corners, form, shape, measures, planes,
    origin, direction, beyond, limit, footprint, any_will_do, waiting, entry, pieces,
):  # fmt: skip
    """The nearest hit, or any, of one ray between two distances: its distance, the primitive's place in the leaves
    (planes come after them; −1 for none), and the second and third weight of a triangle's vertices or a patch's u, v.

    Compiled into the caller, and given what `Geometry` and `scratch` hold one by one, `unowned` before the loop over
    rays: references to the arrays would be counted for every ray otherwise, which takes half as long again. The caller
    has to be an exact kernel.

    origin, direction : triples, metres; the direction of any length, which then is the distances' unit
    footprint : radians, the width of the cone that the ray stands for
    """
    # Beyond `reach` there is nothing to be found: a little after the best hit, for the sake of shapes that coincide.
    best, reach = limit, limit
    nearest, second, third = -1, 0.0, 0.0
    for k in range(len(planes)):
        # Parallel rays are at ±∞ or NaN, and neither is in between.
        t = (planes[k, 0] - origin[1]) / direction[1]
        if beyond < t < reach and _before(t, best, shape, len(form) + k, nearest):
            x, z = origin[0] + t * direction[0], origin[2] + t * direction[2]
            if abs(x) <= planes[k, 1] and abs(z) <= planes[k, 2]:
                best, reach, nearest = t, t * (1 + TIE), len(form) + k

    # A direction of 0 makes a distance ±∞, or NaN in the very plane of a side, which `cross_boxes` leaves out.
    dx, dy, dz = direction
    ix, iy, iz = 1 / dx, 1 / dy, 1 / dz
    inverse = (ix, iy, iz, _LATER * ix, _LATER * iy, _LATER * iz)
    near = (0 if ix > 0 else 1, 2 if iy > 0 else 3, 4 if iz > 0 else 5)
    # Three divisions that only triangles and polygons need, when the first of them is reached.
    sheared, axes, eye, shear = False, _IN_ORDER, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    reference, top, last = root, 0, key_of(reach)
    while not (any_will_do and nearest >= 0):
        if reference >= 0:
            node = np.uint64(reference)
            first, second_box, third_box, farthest = cross_boxes(boxes, reference, near, origin, inverse, beyond, reach)
            if first < MISSED:
                if second_box < MISSED:
                    # Those that were missed are written too, and written over.
                    at = np.uint64(top)
                    waiting[at], entry[at] = children[node, np.uint64(farthest & 3)], farthest
                    at += np.uint64(farthest < MISSED)
                    waiting[at], entry[at] = children[node, np.uint64(third_box & 3)], third_box
                    at += np.uint64(third_box < MISSED)
                    waiting[at], entry[at] = children[node, np.uint64(second_box & 3)], second_box
                    top = np.int64(at) + 1
                reference = children[node, np.uint64(first & 3)]
                continue
        else:
            first = ~reference >> 3
            for k in range(first, first + (~reference & 7)):
                kind = form[np.uint64(k)]
                if kind < 0 or kind & 3 == POLYGON:
                    if not sheared:
                        axes, eye, shear = _shear_along(origin, direction)
                        sheared = True
                    if kind < 0:
                        t, v, w = _meet_triangle(corners, np.uint64(k), axes, eye, shear)
                    else:
                        begin = kind - POLYGON
                        t, v, w = meet_polygon(measures, begin, axes, eye, shear, origin, direction), 0.0, 0.0
                elif kind & 3 == SPHERE:
                    t, v, w = _meet_sphere(measures, np.uint64(kind - SPHERE), origin, direction, beyond), 0.0, 0.0
                else:
                    t, v, w = meet_leaf(measures, kind - LEAF, origin, direction, beyond, reach, footprint, pieces)
                if beyond < t < reach and _before(t, best, shape, k, nearest):
                    best, reach, nearest, second, third = t, t * (1 + TIE), k, v, w
            last = key_of(reach)
        while top > 0 and entry[np.uint64(top - 1)] >= last:
            top -= 1
        if top == 0:
            break
        top -= 1
        reference = waiting[np.uint64(top)]
    return best, nearest, second, third


@exact_small
def _before(t, best, shape, candidate, nearest):
    """Whether a hit at t comes before the best so far; of two at one place the first shape's does."""
    if nearest < 0 or shape[candidate] == shape[nearest]:
        return t < best
    return t < best * (1 - TIE if shape[candidate] > shape[nearest] else 1 + TIE)


@exact_small
def _shear_along(origin, direction):
    """The axes in an order that ends with the ray's longest; the origin in that order; the shear that turns the ray
    along the last axis, and its length along that axis of one."""
    dx, dy, dz = abs(direction[0]), abs(direction[1]), abs(direction[2])
    # Unsigned, so that no index is asked whether it counts from the end.
    first, second, third = _IN_ORDER
    x, y, z = first, second, third
    if dx > dy and dx > dz:
        x, y, z = second, third, first
    elif dy > dz:
        x, y, z = third, first, second
    shear = (direction[x] / direction[z], direction[y] / direction[z], 1 / direction[z])
    return (x, y, z), (origin[x], origin[y], origin[z]), shear


@exact_small
def _meet_triangle(corners, i, axes, eye, shear):
    """The distance of a triangle's plane along the ray and its second and third weight; ∞ outside the triangle.

    eye : the ray's origin in the order of `axes`
    shear : what moves x and y as z grows by one, and the ray's length along z of one
    """
    x, y, z = axes
    b, c = np.uint64(3), np.uint64(6)
    az, bz, cz = corners[i, z] - eye[2], corners[i, z + b] - eye[2], corners[i, z + c] - eye[2]
    ax, ay = corners[i, x] - eye[0] - shear[0] * az, corners[i, y] - eye[1] - shear[1] * az
    bx, by = corners[i, x + b] - eye[0] - shear[0] * bz, corners[i, y + b] - eye[1] - shear[1] * bz
    cx, cy = corners[i, x + c] - eye[0] - shear[0] * cz, corners[i, y + c] - eye[1] - shear[1] * cz
    # A neighbour computes the same two products for the edge they share, in the other order.
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0):
        return np.inf, 0.0, 0.0
    # All three are 0 for a triangle seen edge-on; the distance is then NaN, which is before and after nothing.
    share = 1 / (u + v + w)
    return (u * az + v * bz + w * cz) * shear[2] * share, v * share, w * share


@exact_kernel
def _meet_sphere(measures, i, origin, direction, beyond):
    """The first distance after `beyond` at which the ray passes through the sphere's surface; ∞ if there is none."""
    dx, dy, dz = direction
    one, two, three = _IN_ORDER[1], _IN_ORDER[2], np.uint64(3)
    x, y, z = origin[0] - measures[i], origin[1] - measures[i + one], origin[2] - measures[i + two]
    radius = measures[i + three]
    squared = dx * dx + dy * dy + dz * dz
    closest = -(x * dx + y * dy + z * dz) / squared
    # From the point nearest to the centre, for the usual discriminant loses a small sphere's digits far away
    # (Haines et al. 2019, "Precision improvements for ray/sphere intersection").
    px, py, pz = x + closest * dx, y + closest * dy, z + closest * dz
    # Without a branch, which rays take either way: a miss is NaN from the root on, and comes neither first nor last.
    half_chord = np.sqrt((radius**2 - (px * px + py * py + pz * pz)) / squared)
    far = closest + np.copysign(half_chord, closest)
    near = (x * x + y * y + z * z - radius**2) / (squared * far)
    near = near if far != 0 else 0.0
    first = near if near < far else far
    last = far if near < far else near
    last = last if last > beyond else np.inf
    return first if first > beyond else last
