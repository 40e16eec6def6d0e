"""Which of many points parallel light reaches: the shadow of every triangle, in place of a ray from every point.

Seen along the light, points and triangles lie in a plane. The points are sorted into its cells; each triangle asks
those in the cells it covers whether they lie in its shadow. The last thing asked is the test that rays make, in the
same numbers, so the answers are the rays': what comes before only spares it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.renderers.raytrace.parallel_kernel import CLUSTER, hide
from relume.renderers.raytrace.raycast import RayCaster, checked_rays


@dataclass(frozen=True, eq=False)
class Shadows:
    """Triangles made ready for light from infinity.

    corners : (P, 9) float32, as rays meet them (`kernel.Geometry`)
    blocks : (C, 9 · CLUSTER) float32, the same, coordinate by coordinate of each CLUSTER triangles; 0 beyond the last
    boxes : (C, 6) float32, low x, y, z and high x, y, z of each CLUSTER triangles, which are neighbours in the tree
    """

    corners: np.ndarray
    blocks: np.ndarray
    boxes: np.ndarray

    @staticmethod
    def of(caster: RayCaster) -> Shadows:
        """Raises ValueError for shapes that are no meshes."""
        geometry = caster.geometry
        if len(geometry.planes) or np.any(geometry.form >= 0):
            raise ValueError("shadows are of triangles alone; give meshes, or cast rays")
        ends, begins = geometry.corners.reshape(-1, 3, 3), np.arange(0, len(geometry.corners), CLUSTER)
        boxes = np.zeros((0, 6), np.float32)
        if len(begins):
            low, high = np.minimum.reduceat(ends.min(1), begins), np.maximum.reduceat(ends.max(1), begins)
            boxes = np.concatenate([low, high], axis=1)
        blocks = np.zeros((len(begins) * CLUSTER, 9), np.float32)
        blocks[: len(geometry.corners)] = geometry.corners
        blocks = blocks.reshape(len(begins), CLUSTER, 9).transpose(0, 2, 1).reshape(len(begins), 9 * CLUSTER)
        return Shadows(geometry.corners, blocks, boxes)

    def over(self, points: ArrayLike, direction: ArrayLike) -> np.ndarray:
        """Whether anything lies between each point and light from a direction, (N,) bool; the point itself does not.

        points : (N, 3), metres, world
        direction : (3,) unit vector, world, towards the light
        Raises ValueError for points that are not finite, and a direction that is no unit vector.
        """
        _, towards = checked_rays(np.zeros(3), np.reshape(direction, (1, 3)))
        points = np.require(points, np.float64, ["C", "A", "W"])
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)):
            raise ValueError(f"points are {points.shape}; expected (N, 3), finite metres")
        hidden = np.zeros(len(points), np.bool_)
        hide(self.corners, self.blocks, self.boxes, points, towards[0], hidden)
        return hidden
