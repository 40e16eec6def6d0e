"""What added objects change of a picture, estimated itself and not as the difference of two pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.renderers.renderer import Progress, Renderer
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Change:
    """What a differential renderer saw.

    objects : (H, W, 3) float32 radiance of the objects times the share of the pixel that they cover (premultiplied)
    difference : (H, W, 3) float32, signed: what they change of the radiance of the real surfaces beside them, times the
        share that they do not cover; exactly 0 where they change nothing
    matte : (H, W) float32, that share: 0 to 1
    depth : (H, W) float32, metres from the camera, mean over what was hit; 0 where nothing was
    normal : (H, W, 3) float32, world, mean over the pixel
    albedo : (H, W, 3) float32
    objects_variance, difference_variance : (H, W, 3) float32, of the two planes' means
    samples : rays a pixel that were traced
    passes : in how many passes
    """

    objects: np.ndarray
    difference: np.ndarray
    matte: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    albedo: np.ndarray
    objects_variance: np.ndarray
    difference_variance: np.ndarray
    samples: int = 1
    passes: int = 1


def subtracted(
    renderer: Renderer, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None
) -> Change:
    """The change as the difference of two pictures with the same random numbers (Debevec 1998, §6).

    What the objects leave alone cancels to the bit where a renderer's paths are the same in both.
    """
    tell = progress or (lambda share: None)
    with_ = renderer.render(scene, camera, seed=seed, progress=lambda share: tell(share / 2))
    without = renderer.render(scene.without_objects(), camera, seed=seed, progress=lambda share: tell(0.5 + share / 2))
    cover = with_.matte[..., None]
    return Change(
        objects=cover * with_.radiance,
        difference=(1 - cover) * (with_.radiance - without.radiance),
        matte=with_.matte,
        depth=with_.depth,
        normal=with_.normal,
        albedo=with_.albedo,
        objects_variance=cover**2 * with_.variance,
        difference_variance=(1 - cover) ** 2 * (with_.variance + without.variance),
        samples=with_.samples,
        passes=with_.passes,
    )
