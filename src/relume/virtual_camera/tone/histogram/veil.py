"""The veil that light scattered in the eye lays over what it looks at (Ward Larson et al. 1997, §5.1; Moon & Spencer
1945)."""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.tone.histogram.fovea import FOVEA, between, directions, foveal_samples, foveal_shape
from relume.virtual_camera.view import View

SHARE = 0.087
"""Of the light that adapts the fovea, scattered from outside it; 0.913 is the fovea's own (Moon & Spencer 1945)."""

_MOST = 16384
"""Samples at most: every pair counts, so that four times as many take sixteen times as long. More than these has a
picture wider than 100°, whose outer samples are far below a degree anyway."""


def veil_luminance(foveal: np.ndarray, view: View, picture: tuple[int, int]) -> np.ndarray:
    """The veiling luminance at every foveal sample, in the samples' unit and of their shape.

    foveal : (h, w) luminances, or (h, w, 3) radiances, of samples that lie evenly over the picture
    picture : its rows and columns of pixels

    The sum over all other samples p of 0.087·L(p)·w(p)/Σw with w = cos θ/θ², θ the angle between the two, and
    θ² ≈ 2 − 2·cos θ (Ward Larson et al. 1997, eqs. 9–10); a sample weighs as much as its solid angle. Where everything
    has one luminance, the veil is 0.087 of it. Light from outside the picture is not known, and is taken to be like it.
    """
    from relume._kernel import in_threads
    from relume.virtual_camera.tone.histogram.kernels import scattered

    rows, columns = foveal.shape[:2]
    rays = directions((rows, columns), picture, view).reshape(-1, 3)
    light = np.ascontiguousarray(foveal.reshape(rows * columns, -1), np.float64)
    if len(rays) == 1:
        return np.asarray(SHARE * foveal, foveal.dtype)
    # Solid angles in units of a sample's in the middle. One wider than the fovea scatters light into its middle too,
    # from the ring between the two: ∫ cos θ/θ² over it is 2π·ln of the ratio of their widths.
    middle = picture[0] / rows * picture[1] / columns / view.focal_length**2
    solid_angle = rays[:, 2] ** 3
    own = np.pi * np.maximum(np.log(solid_angle * middle / FOVEA**2), 0) / middle
    veil = np.empty_like(light)
    in_threads(lambda begin, end: scattered(rays, solid_angle, own, light, begin, end, veil), len(rays), chunk=256)
    return (SHARE * veil).reshape(foveal.shape).astype(foveal.dtype)


def veiled(radiance: np.ndarray, view: View) -> np.ndarray:
    """Radiance (H, W, 3) float32 with the veil over it, 0.913·L + Lv (Ward Larson et al. 1997, eq. 11), in its unit.

    The veil, in colours, is interpolated bilinearly between the samples. Even light stays as it is.
    """
    from relume._kernel import in_threads
    from relume.virtual_camera.tone.histogram.kernels import added

    height, width = radiance.shape[:2]
    rows, columns = foveal_shape((height, width), view)
    fewer = max(1.0, np.sqrt(rows * columns / _MOST))
    shape = max(1, int(rows / fewer)), max(1, int(columns / fewer))
    veil = veil_luminance(foveal_samples(radiance, view, shape), view, (height, width))
    places = *between(height, shape[0]), *between(width, shape[1])
    seen = np.empty(radiance.shape, np.float32)
    kept = np.float32(1 - SHARE)
    in_threads(lambda begin, end: added(radiance, kept, veil, *places, begin, end, seen), height, chunk=32)
    return seen
