"""What a camera sees of shapes: samples for shading, with more of them where a pixel sees an edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.prefiltered.shading_inputs import Samples, grid_corners
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import SurfacePoints, Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.materials.bumps import Bumps
from relume.scene.shapes.shapes import Shape

EDGE = 4
"""Samples along each side of a pixel that sees an edge: sixteen estimate its coverage to three per cent."""
STEEPEST = 10.0
"""Pixels' widths by which one surface may recede from one pixel to the next; more is an edge before itself."""


class Seen(NamedTuple):
    """Samples and the pixels they belong to.

    samples : P of them
    uv : (P, 2) float32 texture coordinates
    pixel : (P,) the pixel of each, in rows
    share : (P,) float32, of its pixel
    distance : (P,) metres from the eye, inf where nothing is seen
    rays : (P, 3) unit directions from the eye, world
    """

    samples: Samples
    uv: np.ndarray
    pixel: np.ndarray
    share: np.ndarray
    distance: np.ndarray
    rays: np.ndarray


@dataclass(frozen=True, eq=False)
class Stage:
    """Shapes ready to be looked at from anywhere.

    bumps : of each shape, or None
    """

    caster: RayCaster
    surfaces: Surfaces
    bumps: tuple[Bumps | None, ...]

    @staticmethod
    def of(shapes: Sequence[Shape]) -> Stage:
        """The stage of these shapes."""
        bumps = tuple(getattr(shape.material, "bumps", None) for shape in shapes)
        return Stage(RayCaster.of(shapes), Surfaces.of(shapes), bumps)

    def seen(self, camera: Camera, turn: np.ndarray, about: np.ndarray, threads: int | None = None) -> Seen:
        """What the camera sees when everything is turned, by a rotation (3, 3) about a point (3,).

        Raises UnsupportedScene for a lens with an aperture and for a rolling shutter.
        """
        if camera.rolling is not None:
            raise UnsupportedScene(
                "reflection maps show what is seen from one point, and this camera's shutter rolls; use rl.Mitsuba "
                "(--renderer mitsuba), or a camera without"
            )
        if camera.aperture > 0:
            raise UnsupportedScene(
                "reflection maps show what a pinhole sees, and this camera's lens has an aperture; use rl.Mitsuba "
                "(--renderer mitsuba), or an aperture of 0"
            )
        height, width = camera.height, camera.width
        x, y = np.meshgrid(np.arange(width + 1.0), np.arange(height + 1.0))
        corners = np.stack([x, y], axis=-1)
        # The shapes stay: the eye goes round them, and what it sees is turned back.
        eye = about + (camera.position - about) @ turn
        whole = self.samples(camera, eye, turn, corners[None], threads)
        edges = _edges(whole, camera)
        fine = np.stack(np.meshgrid(*[np.arange(EDGE + 1.0) / EDGE] * 2), axis=-1)
        detail = self.samples(camera, eye, turn, corners[:-1, :-1][edges][:, None, None] + fine, threads)
        inside = np.flatnonzero(~edges.reshape(-1))
        pixel = np.concatenate([inside, np.repeat(np.flatnonzero(edges.reshape(-1)), EDGE**2)])
        share = np.full(len(pixel), 1 / EDGE**2, np.float32)
        share[: len(inside)] = 1
        # Of the pixels without an edge the middle alone; the corners of the others' samples come behind theirs.
        s, d = whole.samples, detail.samples
        kept = s._replace(**{name: getattr(s, name)[inside] for name in ("normal", "to_eye", "surface", "corners")})
        behind = d._replace(corners=d.corners + np.int32(len(s.corner_surface)))
        samples = Samples(*(np.concatenate(pair) for pair in zip(kept, behind, strict=True)))
        uv, distance, rays = (
            np.concatenate([getattr(whole, name)[inside], getattr(detail, name)]) for name in ("uv", "distance", "rays")
        )
        return Seen(samples, uv, pixel, share, distance, rays)

    def samples(
        self, camera: Camera, eye: np.ndarray, turn: np.ndarray, corners: np.ndarray, threads: int | None
    ) -> Seen:
        """Samples of grids whose corners stand at pixel coordinates (G, R + 1, C + 1, 2), in their order."""
        grids, rows, columns = corners.shape[0], corners.shape[1] - 1, corners.shape[2] - 1
        middles = 0.25 * (corners[:, :-1, :-1] + corners[:, 1:, :-1] + corners[:, :-1, 1:] + corners[:, 1:, 1:])
        rays = camera.rays_through(middles.reshape(-1, 2))
        normal, to_eye, surface, uv, distance = self.look(eye, rays, turn, threads)
        around = self.look(eye, camera.rays_through(corners.reshape(-1, 2)), turn, threads)
        index = grid_corners(rows, columns)
        shift = np.arange(grids)[:, None, None] * (rows + 1) * (columns + 1)
        samples = Samples(normal, to_eye, surface, (index + shift).reshape(-1, 4).astype(np.int32), *around[:3])
        pixel = np.arange(len(rays))
        return Seen(samples, uv, pixel, np.ones(len(rays), np.float32), distance, rays)

    def look(
        self, eye: np.ndarray, rays: np.ndarray, turn: np.ndarray, threads: int | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Normal, direction to the eye, shape, texture coordinates and distance along every ray."""
        directions = rays @ turn
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        hits = self.caster.nearest(eye, directions, threads=threads)
        points = self.surfaces.at(eye, directions, hits, threads=threads)
        normals = self._facing(points, directions, hits.shape)
        return (
            (normals @ turn.T).astype(np.float32), (-rays).astype(np.float32), hits.shape, points.uv, hits.distance
        )  # fmt: skip

    def _facing(self, points: SurfacePoints, directions: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Shading normals on the side of the eye, wrinkled where the material is."""
        normals = points.shading_normal
        for index, bumps in enumerate(self.bumps):
            if bumps is not None and (here := np.flatnonzero(shape == index)).size:
                normals[here] = bumps.turned(
                    normals[here], points.point[here], points.uv[here], points.dp_du[here], points.dp_dv[here]
                )
        behind = np.einsum("ij,ij->i", points.geometric_normal, directions) > 0
        return np.where(behind[:, None], -normals, normals)


def _edges(seen: Seen, camera: Camera) -> np.ndarray:
    """Pixels (H, W) whose middle, corners or neighbours' middles see different shapes, or one behind itself."""
    height, width = camera.height, camera.width
    shape = seen.samples.surface.reshape(height, width)
    corners = seen.samples.corner_surface.reshape(height + 1, width + 1)
    edges = np.zeros((height, width), bool)
    for down in (0, 1):
        for right in (0, 1):
            edges |= corners[down : height + down, right : width + right] != shape
    distance = np.where(shape >= 0, seen.distance.reshape(height, width), 0)
    # From one pixel to the next a surface that is seen at 84° recedes by ten times a pixel's width there.
    step = STEEPEST / camera.focal_length * distance
    across = (shape[:, 1:] != shape[:, :-1]) | (np.abs(np.diff(distance, axis=1)) > step[:, 1:] + step[:, :-1])
    along = (shape[1:] != shape[:-1]) | (np.abs(np.diff(distance, axis=0)) > step[1:] + step[:-1])
    edges[:, 1:] |= across
    edges[:, :-1] |= across
    edges[1:] |= along
    edges[:-1] |= along
    return edges
