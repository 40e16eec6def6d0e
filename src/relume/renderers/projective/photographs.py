"""Photographs that are projected onto a place, and how far each of their pixels is to be trusted.

A photograph shows a point of a mesh where nothing stands between the two. Beside an edge that hides something, and
towards the border of the picture, its say falls smoothly to almost nothing, so that no seam shows where it ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from relume.image.bilinear import bilinear
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera

FEATHER = 0.2
"""Of the picture's shorter side, over which a photograph's say falls towards its border."""
EDGE_FEATHER = 4.0
"""Pixels beside an edge that hides something: a lens and half a pixel's error of the model blur what lies there."""
LEAST = 1e-4
"""Of its say that a pixel keeps at an edge: it speaks where no other photograph does."""
LEAP = 0.02
"""Share of the distance by which neighbouring pixels differ at such an edge, beyond what slopes explain."""
SATURATED_SAY = 1e-9
"""Of a pixel that is a lower bound alone: less than any other photograph has anywhere."""
MOST_LOOKED = 1_000_000
"""Pixels of a photograph whose distances are found: a falloff is smooth, so that fewer than it has serve."""
REACHED = 1e-4
"""Share of its distance by which a point may lie behind what a ray meets there: rounding, no shadow."""


@dataclass(frozen=True, eq=False)
class ProjectedPhotograph:
    """A photograph with the camera that took it.

    camera : where it was taken, world, metres
    radiance : what it shows, of the camera's size; pixels outside of every photograph are not used, and saturated ones
        only where nothing else shows the place
    name : for messages
    """

    camera: Camera
    radiance: RadianceMap
    name: str = "photograph"

    def __post_init__(self) -> None:
        if self.radiance.size != (self.camera.width, self.camera.height):
            raise ValueError(
                f"{self.name}: {self.radiance.size[0]}×{self.radiance.size[1]} pixels, of a camera of "
                f"{self.camera.width}×{self.camera.height}; give the camera that took it, or resize one of the two"
            )


@dataclass(frozen=True, eq=False)
class Projector:
    """A photograph made ready to be projected onto shapes.

    trust : (h, w) float32, 0 to 1, over the whole picture: its say by hiding edges
    """

    photograph: ProjectedPhotograph
    caster: RayCaster
    trust: np.ndarray

    @staticmethod
    def of(photograph: ProjectedPhotograph, caster: RayCaster) -> Projector:
        """The projector of a photograph onto the shapes of a caster."""
        camera = photograph.camera
        scale = min(1.0, (MOST_LOOKED / (camera.width * camera.height)) ** 0.5)
        width, height = max(1, round(scale * camera.width)), max(1, round(scale * camera.height))
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        rays = camera.rays_through(np.stack([x * camera.width, y * camera.height], axis=-1))
        hits = caster.nearest(camera.position, rays.reshape(-1, 3))
        away = hiding_edges(hits.distance.reshape(height, width)) * camera.width / width
        trust = np.maximum(smooth(away / EDGE_FEATHER), LEAST)
        return Projector(photograph, caster, trust.astype(np.float32))

    def sees(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel coordinates (N, 2) of points (N, 3) of the shapes' surfaces, and the photograph's say there, 0 to 1.

        0 where the point lies outside of the picture, behind the camera or behind something.
        """
        camera = self.photograph.camera
        at = camera.project(points)
        with np.errstate(invalid="ignore"):
            inside = (at[:, 0] >= 0) & (at[:, 0] <= camera.width) & (at[:, 1] >= 0) & (at[:, 1] <= camera.height)
        say, there = np.zeros(len(points)), np.flatnonzero(inside)
        if not there.size:
            return at, say
        # From the camera outwards, short of the point itself.
        away = points[there] - camera.position
        distance = np.linalg.norm(away, axis=-1)
        near = distance < 1e-9
        directions = away / np.where(near, 1, distance)[:, None]
        directions[near] = [0, 0, 1]
        hidden = self.caster.occluded(camera.position, directions, distance * (1 - REACHED))
        there = there[~hidden]
        height, width = self.trust.shape
        x, y = at[there, 0], at[there, 1]
        known = bilinear(self.trust, x * width / camera.width, y * height / camera.height)
        border = np.minimum(np.minimum(x, camera.width - x), np.minimum(y, camera.height - y))
        say[there] = known * np.maximum(smooth(border / (FEATHER * min(camera.width, camera.height))), LEAST)
        say[there] *= self._known(x, y)
        return at, say

    def _known(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The share (N,) of its say that a place of the picture keeps, by the worst of the pixels that blend there.

        Of the whole picture: a lamp may be two pixels wide.
        """
        clipped = self.photograph.radiance.clipped
        if clipped is None:
            return np.ones(len(x))
        rows, columns = (
            [np.clip(np.floor(at - 0.5).astype(int) + beside, 0, size - 1) for beside in (0, 1)]
            for at, size in zip((y, x), clipped.shape, strict=True)
        )
        blended = np.stack([clipped[row, column] for row in rows for column in columns])
        share = np.where((blended == SATURATED).any(axis=0), SATURATED_SAY, 1.0)
        return np.where((blended == OUTSIDE).any(axis=0), 0.0, share)

    def shown(self, at: np.ndarray) -> np.ndarray:
        """The radiance (N, 3) at pixel coordinates (N, 2), bilinear."""
        return bilinear(self.photograph.radiance.radiance, at[:, 0], at[:, 1])

    def footprints(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """The width (N,) of a pixel of this photograph on the surface, metres: √ of its area there."""
        return footprints(self.photograph.camera, points, normals)


def footprints(camera: Camera, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The width (N,) of a pixel of a camera on surfaces at points of unit normals, metres: √ of its area there."""
    away = points - camera.position
    distance = np.linalg.norm(away, axis=-1)
    facing = np.abs(np.einsum("ij,ij->i", away, normals)) / np.maximum(distance, 1e-12)
    return distance / camera.focal_length / np.sqrt(np.maximum(facing, 1e-3))


def hiding_edges(distance: np.ndarray) -> np.ndarray:
    """How far each pixel is from the nearest edge that hides something, in pixels; distances (h, w), ∞ for nothing.

    Across a plane 1/distance is linear, however steep the plane, and across a crease its slope changes from one to
    another. Beside an edge that hides something it leaps by more than either slope.
    """
    nearness = np.where(np.isfinite(distance), 1 / np.maximum(distance, 1e-12), 0.0)
    edge = np.zeros(distance.shape, bool)
    for axis in (0, 1):
        along, marks = np.moveaxis(nearness, axis, 0), np.moveaxis(edge, axis, 0)
        step = np.pad(np.diff(along, axis=0), ((1, 1), (0, 0)), mode="edge")
        low, high = np.minimum(step[:-2], step[2:]), np.maximum(step[:-2], step[2:])
        beyond = np.maximum(low - step[1:-1], step[1:-1] - high)
        leaps = beyond > LEAP * np.maximum(along[:-1], along[1:])
        marks[:-1] |= leaps
        marks[1:] |= leaps
    if not edge.any():
        return np.full(distance.shape, np.inf)
    return np.asarray(distance_transform_edt(~edge))


def smooth(share: np.ndarray) -> np.ndarray:
    """From 0 at 0 to 1 at 1 and beyond, level at both ends."""
    held = np.clip(share, 0, 1)
    return held * held * (3 - 2 * held)


def projectors(photographs: Sequence[ProjectedPhotograph], caster: RayCaster) -> tuple[Projector, ...]:
    """Each photograph ready to be projected onto the caster's shapes; raises ValueError for none."""
    if not photographs:
        raise ValueError("there are no photographs to project; give one or more")
    return tuple(Projector.of(photograph, caster) for photograph in photographs)
