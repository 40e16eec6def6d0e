"""What a renderer is: something that turns a scene and a camera into a render. `Constant` is the fake for tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene

Progress = Callable[[float], None]
"""Told the share of the work that is done, 0 to 1, while it is done."""


@dataclass(frozen=True, eq=False)
class Render:
    """What a renderer saw.

    radiance : (H, W, 3) float32, in the light's unit
    variance : (H, W, 3) float32, of the pixel means; 0 for a renderer without noise
    matte : (H, W) float32, the share of each pixel that the scene's objects cover, 0 to 1
    depth : (H, W) float32, metres from the camera, mean over what was hit; 0 where nothing was
    normal : (H, W, 3) float32, world, mean over the pixel
    albedo : (H, W, 3) float32
    samples : rays a pixel that were traced
    passes : in how many passes
    rays : (H, W) int32, how many rays each pixel asked for, or None from a renderer that spends as many on all
    """

    radiance: np.ndarray
    variance: np.ndarray
    matte: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    albedo: np.ndarray
    samples: int = 1
    passes: int = 1
    rays: np.ndarray | None = None


class Renderer(Protocol):
    """A frozen value with its settings as fields; pass it to `render`."""

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Render `scene` seen by `camera`; raises UnsupportedScene naming what it cannot shade."""
        ...


def render(
    scene: Scene, camera: Camera, renderer: Renderer, *, seed: int = 0, progress: Progress | None = None
) -> Render:
    """Render a scene; the same seed gives the same pixels, however many threads work."""
    return renderer.render(scene, camera, seed=seed, progress=progress)


@dataclass(frozen=True)
class Constant:
    """The public fake: every pixel has the same radiance, and the matte covers the middle ninth when objects are there.

    radiance : per channel
    """

    radiance: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """A flat picture of the camera's size."""
        shape = (camera.height, camera.width)
        matte = np.zeros(shape, np.float32)
        if scene.objects:
            rows, columns = shape[0] // 3, shape[1] // 3
            matte[rows : shape[0] - rows, columns : shape[1] - columns] = 1
        flat = np.broadcast_to(np.array(self.radiance, np.float32), (*shape, 3)).copy()
        if progress:
            progress(1.0)
        empty = np.zeros((*shape, 3), np.float32)
        return Render(flat, empty, matte, matte, empty, empty)
