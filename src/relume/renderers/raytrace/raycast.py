"""Where rays meet shapes: the nearest hit, or whether anything is in between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from relume.image.bands import in_threads
from relume.image.kernel import exact_kernel
from relume.renderers.raytrace.bvh import build_tree
from relume.renderers.raytrace.kernel import Geometry, meet, scratch, unowned
from relume.renderers.raytrace.primitives import Primitives
from relume.scene.shapes.shapes import Plane, Shape

FOOTPRINT = 1e-6
"""Radians: a thousandth of a pixel of a photograph, so that nobody sees where the subdivision of patches ended."""


class Hits(NamedTuple):
    """What each ray meets first.

    distance : (N,) float64, in lengths of its direction (metres); ∞ where nothing was met
    shape : (N,) int32, its place in the sequence of shapes; −1 where nothing was met
    primitive : (N,) int32, the number of the triangle in its mesh, or of the patch; 0 for other shapes
    barycentric : (N, 2) float64, the weights of the triangle's second and third vertex, or the patch's u and v; 0 for
        other shapes
    """

    distance: np.ndarray
    shape: np.ndarray
    primitive: np.ndarray
    barycentric: np.ndarray


@dataclass(frozen=True, eq=False)
class RayCaster:
    """Shapes made ready for rays.

    geometry : what `meet` takes
    primitive : (P + Q,) int32, as `Hits` holds it, of the primitives in the order of `geometry`
    """

    geometry: Geometry
    primitive: np.ndarray

    @staticmethod
    def of(shapes: Sequence[Shape]) -> RayCaster:
        """The caster of these shapes, which may be none; triangles without area are left out.

        Raises ValueError for a shape that is not finite and near, and for faces that name no vertex.
        """
        parts = Primitives.of(shapes)
        planes = [(i, shape) for i, shape in enumerate(shapes) if isinstance(shape, Plane)]
        tree = build_tree(parts.boxes[parts.area])
        rows = np.flatnonzero(parts.area)[tree.order]
        rectangles = [(plane.height, plane.extent[0] / 2, plane.extent[1] / 2) for _, plane in planes]
        whose = np.concatenate([parts.shape[rows], np.array([i for i, _ in planes], np.int32)])
        geometry = Geometry(
            tree.boxes, tree.children, tree.root, tree.depth, parts.corners[rows], parts.form[rows], whose,
            parts.measures, np.array(rectangles, np.float64).reshape(-1, 3),
        )  # fmt: skip
        return RayCaster(geometry, np.concatenate([parts.primitive[rows], np.zeros(len(planes), np.int32)]))

    def nearest(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        beyond: float = 0.0,
        footprint: float = FOOTPRINT,
        threads: int | None = None,
    ) -> Hits:
        """What each ray meets first; every surface is met from both sides.

        origins : (N, 3) or (3,), metres, world
        directions : (N, 3) unit vectors, world
        beyond : hits up to this distance are ignored, metres
        footprint : the width of the cone that a ray stands for, radians
        threads : at most this many; as many as there are cores for None
        """
        origins, directions = checked_rays(origins, directions)
        if not 0 <= beyond < np.inf:
            raise ValueError(f"beyond is {beyond}; expected a distance in metres, 0 or more")
        return self._cast(origins, directions, np.array([np.inf]), beyond, footprint, False, threads)

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        distances: ArrayLike | None = None,
        *,
        footprint: float = FOOTPRINT,
        threads: int | None = None,
    ) -> np.ndarray:
        """Whether anything lies on each ray between 0 and its distance, both excluded: (N,) bool.

        origins : (N, 3) or (3,), metres, world
        directions : (N, 3) unit vectors, world
        distances : (N,) or one for all, metres; None for any distance
        footprint : the width of the cone that a ray stands for, radians
        threads : at most this many; as many as there are cores for None
        """
        origins, directions = checked_rays(origins, directions)
        count = len(directions)
        limits = np.asarray(np.inf if distances is None else distances, np.float64)
        if limits.shape not in ((), (count,)):
            raise ValueError(f"distances are {limits.shape}; expected one for all or one for each of {count} rays")
        if not np.all(limits >= 0):
            raise ValueError("some distances are negative or NaN; expected metres, 0 or more")
        return self._cast(origins, directions, np.array(limits, ndmin=1), 0.0, footprint, True, threads).shape >= 0

    def _cast(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        limits: np.ndarray,
        beyond: float,
        footprint: float,
        any_will_do: bool,
        threads: int | None,
    ) -> Hits:
        """The nearest hits, or any, in (beyond, limit) of checked rays; limits (N,) or (1,)."""
        if not 0 <= footprint < np.inf:
            raise ValueError(f"footprint is {footprint}; expected the angle of a cone in radians, 0 or more")
        count = len(directions)
        hits = Hits(np.empty(count), np.empty(count, np.int32), np.empty(count, np.int32), np.empty((count, 2)))
        rays = (origins, directions, limits, float(beyond), float(footprint), any_will_do)

        def work(begin: int, end: int) -> None:
            _meet_all(rays, self.geometry, self.primitive, scratch(self.geometry), begin, end, hits)

        in_threads(work, count, threads)
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


@exact_kernel
def _meet_all(rays, geometry, whose_primitive, notes, begin, end, found):
    """Write the hits of rays begin … end."""
    origins, directions, limits, beyond, footprint, any_will_do = rays
    distance, shape, primitive, barycentric = found
    boxes, children, root, _, corners, form, whose_shape, measures, planes = unowned(geometry)
    waiting, entry, pieces = unowned(notes)
    for i in range(begin, end):
        j = i if len(origins) > 1 else 0
        origin = (origins[j, 0], origins[j, 1], origins[j, 2])
        direction = (directions[i, 0], directions[i, 1], directions[i, 2])
        limit = limits[i] if len(limits) > 1 else limits[0]
        best, nearest, second, third = meet(
            boxes, children, root, corners, form, whose_shape, measures, planes,
            origin, direction, beyond, limit, footprint, any_will_do, waiting, entry, pieces,
        )  # fmt: skip
        distance[i], shape[i], primitive[i] = np.inf, -1, 0
        barycentric[i, 0], barycentric[i, 1] = second, third
        if nearest >= 0:
            distance[i], shape[i], primitive[i] = best, whose_shape[nearest], whose_primitive[nearest]
