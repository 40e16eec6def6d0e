"""A renderer held against Mitsuba on the Cornell box, wall by wall."""

from __future__ import annotations

from functools import cache

import numpy as np

import relume as rl
from cornell_box import WALLS, cornell_box, cornell_camera
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.results import Render

SIZE = 64


@cache
def reference() -> Render:
    """Mitsuba's picture: its mean on the dimmest wall has a standard error of 0.3 per cent."""
    return rl.render(cornell_box(), cornell_camera(SIZE), rl.Mitsuba(samples=4096, depth=64), seed=11)


def pixels_of_walls() -> dict[str, np.ndarray]:
    """The pixels (H, W) whose four corners see one wall."""
    shapes = (*cornell_box().local, *cornell_box().objects)
    camera = cornell_camera(SIZE)
    x, y = np.meshgrid(np.arange(SIZE + 1.0), np.arange(SIZE + 1.0))
    rays = camera.rays_through(np.stack([x, y], axis=-1).reshape(-1, 2))
    met = RayCaster.of(shapes).nearest(camera.position, rays).shape.reshape(SIZE + 1, SIZE + 1)
    corners = np.stack([met[1:, 1:], met[:-1, 1:], met[1:, :-1], met[:-1, :-1]])
    names = [getattr(shape, "name", "") for shape in shapes]
    return {name: np.all(corners == names.index(name), axis=0) for name in WALLS}


def differences_by_wall(renderer: rl.Renderer) -> dict[str, float]:
    """The share by which the mean radiance of each wall differs from Mitsuba's: of the channel farthest off."""
    mine = rl.render(cornell_box(), cornell_camera(SIZE), renderer).radiance.astype(np.float64)
    theirs = reference().radiance.astype(np.float64)
    return {
        name: float(np.abs(mine[where].mean(axis=0) / theirs[where].mean(axis=0) - 1).max())
        for name, where in pixels_of_walls().items()
    }
