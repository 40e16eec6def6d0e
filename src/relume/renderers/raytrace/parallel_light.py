"""Which of many points parallel light reaches: the shadow of every triangle, in place of a ray from every point.

Seen along the light, points and triangles lie in a plane. The points are sorted into its cells; each triangle asks
those in the cells it covers whether they lie in its shadow. The last thing asked is the test that rays make, in the
same numbers, so the answers are the rays': what comes before only spares it. A point outside a closed surface is
hidden by a triangle that faces away from the light if it is hidden at all, and those that face it, on one of which it
lies, need not ask it; holes are closed by triangles that only say where that is in doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.renderers.raytrace.closing import alike, closing_triangles, facing_cones
from relume.renderers.raytrace.parallel_kernel import CLUSTER, hide
from relume.renderers.raytrace.raycast import RayCaster, checked_rays
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh

_CLOSED = 0.1
"""Closing triangles, as a share of the others, up to which a surface is taken for one with holes."""

_FEW = 2000
"""Points up to which rays are faster than shadows."""


@dataclass(frozen=True, eq=False)
class Asking:
    """Points that ask for the light from a direction.

    points : (N, 3) float64, metres, world
    numbers : (K,) int64, those of them that ask
    outside : (N,) bool, which points are known to be outside (`Shadows.outside`)
    direction : (3,) float64, unit, world, towards the light
    """

    points: np.ndarray
    numbers: np.ndarray
    outside: np.ndarray
    direction: np.ndarray


@dataclass(frozen=True, eq=False)
class Shadows:
    """Triangles made ready for light from infinity, in clusters of CLUSTER that are near each other and face alike.

    caster : the triangles
    corners : (C · CLUSTER, 9) float32, as rays meet them (`kernel.Geometry`); the last of each kind is repeated
    blocks : (C, 9 · CLUSTER) float32, the same, coordinate by coordinate of each cluster
    boxes : (C, 6) float32, low x, y, z and high x, y, z
    cones : (C, 4) float64, `facing_cones`
    own : how many clusters are of the surface; the others close it
    closing : the triangles that close it; None where that takes too many
    """

    caster: RayCaster
    corners: np.ndarray
    blocks: np.ndarray
    boxes: np.ndarray
    cones: np.ndarray
    own: int
    closing: RayCaster | None

    @staticmethod
    def of(caster: RayCaster) -> Shadows:
        """Raises ValueError for shapes that are no meshes."""
        geometry = caster.geometry
        if len(geometry.planes) or np.any(geometry.form >= 0):
            raise ValueError("shadows are of triangles alone; give meshes, or cast rays")
        surface = _whole_clusters(geometry.corners[alike(geometry.corners, CLUSTER)])
        rims, closing = closing_triangles(geometry.corners), None
        if len(rims) <= _CLOSED * len(geometry.corners):
            closing = _caster_of(rims)
            rims = _whole_clusters(closing.geometry.corners)
        corners = surface if closing is None else np.concatenate([surface, rims])
        begins, ends = np.arange(0, len(corners), CLUSTER), corners.reshape(-1, 3, 3)
        boxes, cones = np.zeros((0, 6), np.float32), np.zeros((0, 4))
        if len(begins):
            low, high = np.minimum.reduceat(ends.min(1), begins), np.maximum.reduceat(ends.max(1), begins)
            boxes, cones = np.concatenate([low, high], axis=1), facing_cones(corners, CLUSTER)
        blocks = corners.reshape(-1, CLUSTER, 9).transpose(0, 2, 1).reshape(-1, 9 * CLUSTER).copy()
        return Shadows(caster, corners, blocks, boxes, cones, len(surface) // CLUSTER, closing)

    def outside(self, points: ArrayLike, eye: ArrayLike, threads: int | None = None) -> np.ndarray:
        """Which points are surely outside the closed surface, (N,) bool: those that see an eye (3,) that is; metres.

        points : (N, 3), off the surface, if by a hair; of one on it what rounds decides, and `over` may then differ
            from rays
        """
        points, eye = np.asarray(points, np.float64), np.asarray(eye, np.float64)
        if self.closing is None or not len(points) or not len(self.boxes):
            return np.zeros(len(points), bool)
        within = (eye > self.boxes[:, :3].min(axis=0) - 1e-6) & (eye < self.boxes[:, 3:].max(axis=0) + 1e-6)
        distances = np.linalg.norm(eye - points, axis=1)
        if within.all() or not distances.min() > 0:
            return np.zeros(len(points), bool)
        towards = (eye - points) / distances[:, None]
        hidden = self.caster.occluded(points, towards, distances, threads=threads)
        return ~(hidden | self.closing.occluded(points, towards, distances, threads=threads))

    def over(self, points: ArrayLike, direction: ArrayLike, outside: np.ndarray | None = None) -> np.ndarray:
        """Whether anything lies between each point and light from a direction, (N,) bool; the point itself does not.

        points : (N, 3), metres, world
        direction : (3,) unit vector, world, towards the light
        outside : (N,) bool, which points are known to be outside (`outside`); they are asked in less time
        Raises ValueError for points that are not finite, a direction that is no unit vector, and another count of
        `outside`.
        """
        _, towards = checked_rays(np.zeros(3), np.reshape(direction, (1, 3)))
        points = np.require(points, np.float64, ["C", "A", "W"])
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)):
            raise ValueError(f"points are {points.shape}; expected (N, 3), finite metres")
        known = np.zeros(len(points), bool) if outside is None else np.asarray(outside, bool)
        if known.shape != (len(points),):
            raise ValueError(f"outside is {known.shape}; expected ({len(points)},), a bool for each point")
        return self.over_each([Asking(points, np.arange(len(points)), known, towards[0])])[0]

    def over_each(self, several: Sequence[Asking]) -> list[np.ndarray]:
        """`over` for several directions, of some points each: (K,) bool of each; what is asked is not checked."""
        answers, left = [], []
        for one in several:
            known = one.outside[one.numbers]
            sided = self.closing is not None and 2 * np.count_nonzero(known) > len(known)
            hidden, doubtful = self._asked(one, one.numbers, int(sided))
            # What the first answer hid is hidden; of the others all triangles are asked.
            others = np.flatnonzero((doubtful | ~known) & ~hidden) if sided else np.zeros(0, np.int64)
            if len(others) > _FEW:
                hidden[others], others = self._asked(one, one.numbers[others], 0)[0], others[:0]
            answers.append(hidden)
            left.append(others)
        points = [one.points[one.numbers[others]] for one, others in zip(several, left, strict=True)]
        ends = np.cumsum([len(others) for others in left])
        if len(ends) and ends[-1]:
            ways = np.repeat([one.direction for one in several], [len(others) for others in left], axis=0)
            found = np.split(self.caster.occluded(np.concatenate(points), ways, threads=1), ends[:-1])
            for hidden, others, by_rays in zip(answers, left, found, strict=True):
                hidden[others] = by_rays
        return answers

    def _asked(self, one: Asking, numbers: np.ndarray, sided: int) -> tuple[np.ndarray, np.ndarray]:
        """Which of the points `numbers` are hidden, and of which that is in doubt."""
        hidden, doubtful = np.zeros(len(numbers), np.bool_), np.zeros(len(numbers), np.bool_)
        ready = self.corners, self.blocks, self.boxes, self.cones, self.own
        hide(*ready, np.float32(sided), one.points, numbers, one.direction, hidden, doubtful)
        return hidden, doubtful


def _whole_clusters(corners: np.ndarray) -> np.ndarray:
    """Triangles (P, 9), the last one repeated until the last cluster is full."""
    return np.concatenate([corners, np.repeat(corners[-1:], -len(corners) % CLUSTER, axis=0)])


def _caster_of(corners: np.ndarray) -> RayCaster:
    """Rays for triangles (P, 9) alone."""
    if not len(corners):
        return RayCaster.of([])
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return RayCaster.of([Mesh(corners.reshape(-1, 3), faces, Diffuse((0.0, 0.0, 0.0)))])
