"""What renderers give: the picture of a scene (`Render`), and what added objects change of a picture (`Change`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Progress = Callable[[float], None]
"""Called with the share of the work that is done, 0 to 1."""


@dataclass(frozen=True, eq=False)
class Render:
    """The picture of a scene, and planes about what it shows.

    radiance : (H, W, 3) float32, in the light's unit
    variance : (H, W, 3) float32, of the pixel means; 0 for a renderer without noise
    matte : (H, W) float32, the share of each pixel that the scene's objects cover, 0 to 1
    depth : (H, W) float32, metres from the camera along the ray, mean over what was hit; 0 where nothing was
    normal : (H, W, 3) float32, world, mean over the pixel
    albedo : (H, W, 3) float32
    samples : rays a pixel that were traced
    passes : in how many passes
    rays : (H, W) int32, how many rays each pixel needed, or None from a renderer that spends as many on all
    guide_albedo, guide_normal : (H, W, 3) float32, of the first thing that scatters light: what smooth mirrors and
        clear glass show, where `normal` and `albedo` are their own. For a denoiser; None from renderers without them
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
    guide_albedo: np.ndarray | None = None
    guide_normal: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Change:
    """What added objects change of a picture.

    objects : (H, W, 3) float32 radiance of the objects times the share of the pixel that they cover (premultiplied)
    difference : (H, W, 3) float32, signed: what they change of the radiance of the real surfaces beside them, times the
        share that they do not cover; exactly 0 where they change nothing
    matte : (H, W) float32, that share: 0 to 1
    depth : (H, W) float32, metres from the camera along the ray, mean over what was hit; 0 where nothing was
    normal : (H, W, 3) float32, world, mean over the pixel
    albedo : (H, W, 3) float32
    objects_variance, difference_variance : (H, W, 3) float32, of the two planes' means
    samples : rays a pixel that were traced
    passes : in how many passes
    taken : (H, W, 3) float32, 0 or more: the light that the objects take, whose difference to what they add is
        `difference`; premultiplied as that. None where it is not known, and once denoised
    guide_albedo, guide_normal : (H, W, 3) float32, of the first thing that scatters light: what smooth mirrors and
        clear glass show, where `normal` and `albedo` are their own. For a denoiser; None from renderers without them
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
    taken: np.ndarray | None = None
    guide_albedo: np.ndarray | None = None
    guide_normal: np.ndarray | None = None
