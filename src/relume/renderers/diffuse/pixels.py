"""The samples of a camera's pixels, and the picture that they add up to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.renderers.diffuse.scenes import DiffuseScene, Seen
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.sphere.sampling import by_cosine, sequences

Shade = Callable[[Seen, np.random.Generator], np.ndarray]
"""Radiance (N, 3) of what rays met, without their emission; with numbers of that cell's own."""


@dataclass(frozen=True, eq=False)
class PixelSamples:
    """Cells along each side of a pixel, each with one ray through a place by chance in it.

    camera : a pinhole's
    side : cells; their square is the rays of a pixel
    seed : of the places
    """

    camera: Camera
    side: int
    seed: int

    def rays(self, cell: int) -> tuple[np.ndarray, np.ndarray]:
        """Origins and unit directions (H·W, 3) through one cell of every pixel."""
        random = np.random.default_rng([self.seed, 0x70697865, cell])
        x, y = np.meshgrid(np.arange(self.camera.width), np.arange(self.camera.height))
        corner = np.stack([x.ravel(), y.ravel()], axis=-1) + np.array([cell % self.side, cell // self.side]) / self.side
        points = corner + random.random(corner.shape) / self.side
        return np.array(self.camera.eyes(points)), self.camera.rays_through(points)


def gathered(
    scene: DiffuseScene, seen: Seen, rays: int, random: np.random.Generator, arriving: Callable[[Seen], np.ndarray]
) -> np.ndarray:
    """Irradiance (N, 3) that surfaces send to places: a final gathering, `rays` about each normal.

    arriving : irradiance where the rays end
    """
    total = np.zeros((len(seen.point), 3))
    for ray in np.moveaxis(sequences(random, rays, 2, len(total)), 1, 0):
        found = scene.look(seen.point, by_cosine(ray, seen.normal))
        there = np.flatnonzero(found.hit)
        met = found.only(there)
        total[there] += met.reflectance * arriving(met) / rays
    return total


def picture(scene: DiffuseScene, samples: PixelSamples, shade: Shade, progress: Progress | None = None) -> Render:
    """The mean over all samples of the emission and shade of what they met, and of the map where they met nothing."""
    height, width = samples.camera.height, samples.camera.width
    sums = np.zeros((height * width, 11))
    hits, cells = np.zeros(height * width), samples.side**2
    for cell in range(cells):
        origins, directions = samples.rays(cell)
        seen = scene.look(origins, directions, leaving=False)
        sums[:, :3] += seen.emission
        there = np.flatnonzero(seen.hit)
        sums[there, :3] += shade(seen.only(there), np.random.default_rng([samples.seed, 0x73686164, cell]))
        if scene.sky is not None:
            missed = np.flatnonzero(~seen.hit)
            sums[missed, :3] += scene.sky.lookup(directions[missed])
        # The planes about what was hit.
        hits += seen.hit
        sums[:, 3:6] += seen.normal
        sums[:, 6:9] += seen.reflectance
        sums[there, 9] += seen.distance[there]
        sums[:, 10] += seen.shape >= scene.local
        if progress:
            progress((cell + 1) / cells)
    planes = (sums / cells).reshape(height, width, 11).astype(np.float32)
    share = np.maximum(hits / cells, 1e-9).reshape(height, width).astype(np.float32)
    # Nobody has measured the noise of what surfaces share.
    variance = np.full((height, width, 3), np.nan, np.float32)
    return Render(
        planes[..., :3].copy(), variance, planes[..., 10].copy(), planes[..., 9] / share, planes[..., 3:6].copy(),
        planes[..., 6:9].copy(), cells,
    )  # fmt: skip
