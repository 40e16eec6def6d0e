"""Where rays meet shapes: the nearest hit, or whether anything is in between.

Triangles are tested so that rays find no crack between two that share an edge or a vertex (Woop, Benthin & Wald 2013,
"Watertight ray/triangle intersection"), in double precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume._kernel import exact_inlined, exact_kernel, in_threads
from relume.render.raycast_tree import Tree, build_tree
from relume.scene.shapes import Mesh, Plane, Shape, Sphere

FARTHEST = 1e15
"""Metres from the origin within which every shape has to lie, so that areas stay finite."""

# A distance to a box's side is off by three roundings of 2⁻⁵³ and two such are compared: a box is left this much later.
_LATER = 1 + 8 * 2.0**-53


@dataclass(frozen=True, eq=False)
class Hits:
    """What each ray meets first.

    distance : (N,) float64, in lengths of its direction (metres); ∞ where nothing was met
    shape : (N,) int32, its place in the sequence of shapes; −1 where nothing was met
    primitive : (N,) int32, the triangle's number in its mesh; 0 for other shapes
    barycentric : (N, 2) float32, the weights of the triangle's second and third vertex; 0 for other shapes
    """

    distance: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    barycentric: np.ndarray


@dataclass(frozen=True, eq=False)
class RayCaster:
    """Shapes made ready for rays.

    tree : over the P triangles and spheres; the next three hold them in the order of its leaves
    corners : (P, 9) float32, the triangles' vertices, metres
    ball : (P,) int32, the row in `spheres`; −1 for a triangle
    shape, primitive : (P + Q,) int32, as `Hits` tells them; planes are last
    spheres : (S, 4) float64, centre and radius, metres
    planes : (Q, 3) float64, height and half the lengths along x and z, metres
    """

    tree: Tree
    corners: np.ndarray
    ball: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    spheres: np.ndarray
    planes: np.ndarray

    @staticmethod
    def of(shapes: Sequence[Shape]) -> RayCaster:
        """The caster of these shapes, which may be none; triangles without area are left out.

        Raises ValueError for a mesh or sphere that is not finite and near, and for faces that name no vertex.
        """
        meshes = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Mesh)]
        balls = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Sphere)]
        planes = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Plane)]
        spheres = np.array([(*ball.centre, ball.radius) for _, ball in balls], np.float64).reshape(-1, 4)
        if np.any(np.abs(spheres) > FARTHEST):
            raise ValueError(f"a sphere reaches beyond {FARTHEST:g} m; scale the scene to metres")

        none = np.zeros((0, 9), np.float32)
        triangles = np.concatenate([none, *(_corners_of(mesh) for _, mesh in meshes)])
        corners = np.concatenate([triangles, np.zeros((len(balls), 9), np.float32)])
        ball = np.concatenate([np.full(len(triangles), -1), np.arange(len(balls))]).astype(np.int32)
        counts = [len(mesh.faces) for _, mesh in meshes] + [1] * (len(balls) + len(planes))
        shape = np.repeat(np.array([i for i, _ in meshes + balls + planes], np.int32), counts)
        primitive = np.concatenate([np.zeros(0, np.int32), *(np.arange(count, dtype=np.int32) for count in counts)])

        boxes = np.empty((len(corners), 6), np.float32)
        area = np.empty(len(corners), bool)
        _enclose(corners, ball, spheres, boxes, area)
        tree = build_tree(boxes[area])
        rows = np.flatnonzero(area)[tree.order]
        with_planes = np.concatenate([rows, np.arange(len(corners), len(shape))])
        rectangles = [(plane.height, plane.extent[0] / 2, plane.extent[1] / 2) for _, plane in planes]
        return RayCaster(
            tree,
            corners[rows],
            ball[rows],
            shape[with_planes],
            primitive[with_planes],
            spheres,
            np.array(rectangles, np.float64).reshape(-1, 3),
        )

    def nearest(
        self, origins: ArrayLike, directions: ArrayLike, *, beyond: float = 0.0, threads: int | None = None
    ) -> Hits:
        """What each ray meets first; every surface is met from both sides.

        origins : (N, 3) or (3,), metres, world
        directions : (N, 3) unit vectors, world
        beyond : hits up to this distance are ignored, metres
        threads : at most this many; as many as there are cores for None
        """
        origins, directions = checked_rays(origins, directions)
        if not 0 <= beyond < np.inf:
            raise ValueError(f"beyond is {beyond}; expected a distance in metres, 0 or more")
        return self._cast(origins, directions, np.array([np.inf]), beyond, False, threads)

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distances: ArrayLike | None = None,
        *,
        threads: int | None = None,
    ) -> np.ndarray:
        """Whether anything lies on each ray between 0 and its distance, both excluded: (N,) bool.

        origins : (N, 3) or (3,), metres, world
        directions : (N, 3) unit vectors, world
        distances : (N,) or one for all, metres; None for any distance
        threads : at most this many; as many as there are cores for None
        """
        origins, directions = checked_rays(origins, directions)
        count = len(directions)
        limits = np.asarray(np.inf if distances is None else distances, np.float64)
        if limits.shape not in ((), (count,)):
            raise ValueError(f"distances are {limits.shape}; expected one for all or one for each of {count} rays")
        if not np.all(limits >= 0):
            raise ValueError("some distances are negative or NaN; expected metres, 0 or more")
        return self._cast(origins, directions, np.array(limits, ndmin=1), 0.0, True, threads).shape >= 0

    def _cast(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        limits: np.ndarray,
        beyond: float,
        any_will_do: bool,
        threads: int | None,
    ) -> Hits:
        """The nearest hits, or any, in (beyond, limit) of checked rays; limits (N,) or (1,)."""
        count, tree = len(directions), self.tree
        hits = Hits(np.empty(count), np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 2), "f4"))
        rays = (origins, directions, limits, float(beyond), any_will_do)
        nodes = (tree.boxes, tree.children, tree.root, tree.depth)
        leaves = (self.corners, self.ball, self.shape, self.primitive)
        others = (self.spheres, self.planes)
        told = (hits.distance, hits.shape, hits.primitive, hits.barycentric)
        in_threads(lambda begin, end: _meet(rays, nodes, leaves, others, begin, end, told), count, threads)
        return hits


def checked_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Origins (N, 3), or (1, 3) where all rays share one, and directions (N, 3), as the kernels need them.

    Raises ValueError unless they have these shapes, are finite, and the directions have unit length.
    """
    # Writable, because a kernel is compiled anew for arrays that are not.
    origins = np.require(origins, np.float64, ["C", "A", "W"])
    directions = np.require(directions, np.float64, ["C", "A", "W"])
    if directions.ndim != 2 or directions.shape[1] != 3:
        raise ValueError(f"directions are {directions.shape}; expected (N, 3)")
    if origins.shape not in ((3,), directions.shape):
        raise ValueError(f"origins are {origins.shape}; expected (3,) or {directions.shape}, one for each direction")
    if not np.all(np.isfinite(origins)):
        raise ValueError("some origins are not finite; expected metres")
    # Directions kept as float32 are off by 1e-7. A NaN compares as false.
    unit = np.abs(np.einsum("ij,ij->i", directions, directions) - 1) < 1e-5
    if not np.all(unit):
        first = int(np.argmin(unit))
        raise ValueError(f"direction {first} is {directions[first]}; expected unit length, as `normalised` gives it")
    return origins.reshape(-1, 3), directions


def _corners_of(mesh: Mesh) -> np.ndarray:
    """The vertices of every triangle, (M, 9) float32."""
    vertices = np.asarray(mesh.vertices, np.float32)
    if not np.all(np.abs(vertices) <= FARTHEST):
        raise ValueError(f"vertices of {mesh.name!r} are not all finite and within {FARTHEST:g} m; mend the mesh")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(vertices):
        raise ValueError(
            f"faces of {mesh.name!r} name vertices {mesh.faces.min()} to {mesh.faces.max()}; "
            f"expected 0 to {len(vertices) - 1}"
        )
    return vertices[mesh.faces].reshape(-1, 9)


@exact_kernel
def _enclose(corners, ball, spheres, boxes, area):
    """Write the box round each primitive, a little wider than it is, and whether it is one that has an area."""
    for i in range(len(corners)):
        area[i] = True
        a = (np.float64(corners[i, 0]), np.float64(corners[i, 1]), np.float64(corners[i, 2]))
        b = (np.float64(corners[i, 3]), np.float64(corners[i, 4]), np.float64(corners[i, 5]))
        c = (np.float64(corners[i, 6]), np.float64(corners[i, 7]), np.float64(corners[i, 8]))
        low = (min(a[0], b[0], c[0]), min(a[1], b[1], c[1]), min(a[2], b[2], c[2]))
        high = (max(a[0], b[0], c[0]), max(a[1], b[1], c[1]), max(a[2], b[2], c[2]))
        if ball[i] >= 0:
            x, y, z, radius = spheres[ball[i]]
            low, high = (x - radius, y - radius, z - radius), (x + radius, y + radius, z + radius)
        else:
            px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            qx, qy, qz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            area[i] = py * qz != pz * qy or pz * qx != px * qz or px * qy != py * qx
        # Wider by more than a triangle test can err to the side, and by what rounding to single precision may take.
        margin = 1e-6 * max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
        for j in range(3):
            boxes[i, j] = low[j] - margin - 1.2e-7 * abs(low[j])
            boxes[i, j + 3] = high[j] + margin + 1.2e-7 * abs(high[j])


@exact_kernel
def _meet(rays, nodes, leaves, others, begin, end, told):
    """Tell the hits of rays begin … end."""
    # Arrays are taken out of their tuples here, once: each time costs more than to test a triangle.
    origins, directions, limits, beyond, any_will_do = rays
    boxes, children, root, depth = nodes
    corners, ball, whose_shape, whose_primitive = leaves
    spheres, planes = others
    distance, shape, primitive, barycentric = told
    # What is yet to be visited, and where the ray enters it.
    waiting, entry = np.empty(depth + 1, np.int64), np.empty(depth + 1)
    for i in range(begin, end):
        j = i if len(origins) > 1 else 0
        origin = (origins[j, 0], origins[j, 1], origins[j, 2])
        direction = (directions[i, 0], directions[i, 1], directions[i, 2])
        best = limits[i] if len(limits) > 1 else limits[0]
        nearest, second, third = -1, 0.0, 0.0
        for k in range(len(planes)):
            # Parallel rays are at ±∞ or NaN, and neither is in between.
            t = (planes[k, 0] - origin[1]) / direction[1]
            x, z = origin[0] + t * direction[0], origin[2] + t * direction[2]
            if beyond < t < best and abs(x) <= planes[k, 1] and abs(z) <= planes[k, 2]:
                best, nearest = t, len(ball) + k

        # A direction of 0 makes a distance ±∞, or NaN in the very plane of a side, which `_cross_box` leaves out.
        dx, dy, dz = direction
        inverse = (1 / dx, 1 / dy, 1 / dz, _LATER / dx, _LATER / dy, _LATER / dz)
        near = (0 if inverse[0] > 0 else 1, 2 if inverse[1] > 0 else 3, 4 if inverse[2] > 0 else 5)
        axes, eye, shear = _shear_along(origin, direction)
        reference, top = root, 0
        while not (any_will_do and nearest >= 0):
            if reference >= 0:
                enter, leave = _cross_box(boxes, reference, 0, near, origin, inverse, beyond, best)
                other_enter, other_leave = _cross_box(boxes, reference, 6, near, origin, inverse, beyond, best)
                one, other = children[reference, 0], children[reference, 1]
                if enter <= leave:
                    reference = one
                    if other_enter <= other_leave:
                        if other_enter < enter:
                            reference, other, other_enter = other, one, enter
                        waiting[top], entry[top] = other, other_enter
                        top += 1
                    continue
                if other_enter <= other_leave:
                    reference = other
                    continue
            else:
                first = ~reference >> 3
                for k in range(first, first + (~reference & 7)):
                    if ball[k] < 0:
                        t, v, w = _meet_triangle(corners, k, axes, eye, shear)
                    else:
                        t, v, w = _meet_sphere(spheres, ball[k], origin, direction, beyond), 0.0, 0.0
                    if beyond < t < best:
                        best, nearest, second, third = t, k, v, w
            while top > 0 and entry[top - 1] >= best:
                top -= 1
            if top == 0:
                break
            top -= 1
            reference = waiting[top]

        distance[i], shape[i], primitive[i] = np.inf, -1, 0
        barycentric[i, 0], barycentric[i, 1] = second, third
        if nearest >= 0:
            distance[i], shape[i], primitive[i] = best, whose_shape[nearest], whose_primitive[nearest]


@exact_inlined
def _cross_box(boxes, node, first, near, origin, inverse, enter, leave):
    """Where in [enter, leave] a ray enters the box whose sides begin at `first`, and where it leaves it at the latest.

    near : the side of each axis that the ray comes to first
    inverse : of the direction, and of the same a little shorter
    """
    x, y, z = first + near[0], first + near[1], first + near[2]
    t = (boxes[node, x] - origin[0]) * inverse[0]
    enter = t if t > enter else enter
    t = (boxes[node, y] - origin[1]) * inverse[1]
    enter = t if t > enter else enter
    t = (boxes[node, z] - origin[2]) * inverse[2]
    enter = t if t > enter else enter
    t = (boxes[node, x ^ 1] - origin[0]) * inverse[3]
    leave = t if t < leave else leave
    t = (boxes[node, y ^ 1] - origin[1]) * inverse[4]
    leave = t if t < leave else leave
    t = (boxes[node, z ^ 1] - origin[2]) * inverse[5]
    leave = t if t < leave else leave
    return enter, leave


@exact_inlined
def _shear_along(origin, direction):
    """The axes in an order that ends with the ray's longest; the origin in that order; the shear that turns the ray
    along the last axis, and its length along that axis of one."""
    dx, dy, dz = abs(direction[0]), abs(direction[1]), abs(direction[2])
    z = 2
    if dx > dy and dx > dz:
        z = 0
    elif dy > dz:
        z = 1
    x, y = (z + 1) % 3, (z + 2) % 3
    shear = (direction[x] / direction[z], direction[y] / direction[z], 1 / direction[z])
    return (x, y, z), (origin[x], origin[y], origin[z]), shear


@exact_inlined
def _meet_triangle(corners, i, axes, eye, shear):
    """The distance of a triangle's plane along the ray and its second and third weight; ∞ outside the triangle.

    eye : the ray's origin in the order of `axes`
    shear : what moves x and y as z grows by one, and the ray's length along z of one
    """
    x, y, z = axes
    az, bz, cz = corners[i, z] - eye[2], corners[i, z + 3] - eye[2], corners[i, z + 6] - eye[2]
    ax, ay = corners[i, x] - eye[0] - shear[0] * az, corners[i, y] - eye[1] - shear[1] * az
    bx, by = corners[i, x + 3] - eye[0] - shear[0] * bz, corners[i, y + 3] - eye[1] - shear[1] * bz
    cx, cy = corners[i, x + 6] - eye[0] - shear[0] * cz, corners[i, y + 6] - eye[1] - shear[1] * cz
    # A neighbour computes the same two products for the edge they share, in the other order.
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    if (u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0):
        return np.inf, 0.0, 0.0
    # All three are 0 for a triangle seen edge-on; the distance is then NaN, which is before and after nothing.
    share = 1 / (u + v + w)
    return (u * az + v * bz + w * cz) * shear[2] * share, v * share, w * share


@exact_kernel
def _meet_sphere(spheres, i, origin, direction, beyond):
    """The first distance after `beyond` at which the ray passes through the sphere's surface; ∞ if there is none."""
    dx, dy, dz = direction
    x, y, z = origin[0] - spheres[i, 0], origin[1] - spheres[i, 1], origin[2] - spheres[i, 2]
    squared = dx * dx + dy * dy + dz * dz
    closest = -(x * dx + y * dy + z * dz) / squared
    # From the point nearest to the centre, for the usual discriminant loses a small sphere's digits far away
    # (Haines et al. 2019, "Precision improvements for ray/sphere intersection").
    px, py, pz = x + closest * dx, y + closest * dy, z + closest * dz
    half_chord_squared = (spheres[i, 3] ** 2 - (px * px + py * py + pz * pz)) / squared
    if half_chord_squared < 0:
        return np.inf
    far = closest + np.copysign(np.sqrt(half_chord_squared), closest)
    outside = x * x + y * y + z * z - spheres[i, 3] ** 2
    near = outside / (squared * far) if far != 0 else 0.0
    first, last = min(near, far), max(near, far)
    if first > beyond:
        return first
    return last if last > beyond else np.inf
