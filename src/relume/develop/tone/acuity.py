"""The detail that the eye loses in the dark (Ward Larson et al. 1997, §5.3; Shlaer 1937)."""

from __future__ import annotations

import numpy as np

from relume.develop.tone.histogram_fovea import adaptation_grid, between, directions, foveal_shape
from relume.develop.view import View
from relume.develop.vision import acuity

_COARSEST = 1.0
"""Cycles per degree: below about 2e-4 cd/m² the fit crosses 0, where Shlaer's observers still saw 1 or 2."""


def blurred_by_acuity(radiance: np.ndarray, view: View, adaptation_luminance: np.ndarray | float) -> np.ndarray:
    """Radiance (H, W, 3) float32, blurred at every place to what the eye resolves there, in its unit.

    adaptation_luminance : cd/m²; one for the picture, or a grid (h, w) that lies evenly over it, as foveal samples do

    A pyramid of halved pictures is read between its levels (Ward Larson et al. 1997, §5.3), each made smooth by a
    quadratic B-spline, at a width of 1/√2 of a period of the finest grating seen (eq. 15): 1.6 % of such a grating's
    contrast then remains, about what is just seen on a screen. Beyond the border the picture goes on as it ends.
    What is brightly lit stays sharp to the bit. The mean is kept where the adaptation is one.
    """
    from relume._kernel import in_threads
    from relume.develop.tone.histogram_kernels import blended, halved

    shape = radiance.shape[:2]
    width = blur_width(shape, view, adaptation_luminance)
    levels = int(np.ceil(np.log2(max(1.0, float(width.max())))))
    levels = min(levels, int(np.log2(max(shape))))
    if levels == 0:
        return radiance.copy()
    pyramid = [radiance]
    for _ in range(levels):
        finer = pyramid[-1]
        coarser = np.empty(((finer.shape[0] + 1) // 2, (finer.shape[1] + 1) // 2, 3), np.float32)
        in_threads(lambda b, e, f=finer, c=coarser: halved(f, b, e, c), len(coarser), chunk=32)
        pyramid.append(coarser)
    # The deeper levels lie in one array: a kernel takes no list.
    starts = np.cumsum([0] + [level.size // 3 for level in pyramid[1:]])
    sizes = np.array([level.shape[:2] for level in pyramid])
    deeper = np.concatenate([level.reshape(-1, 3) for level in pyramid[1:]])
    across, down = between(shape[1], width.shape[1]), between(shape[0], width.shape[0])
    seen = np.empty(radiance.shape, np.float32)
    in_threads(
        lambda b, e: blended(radiance, deeper, starts, sizes, width, *down, *across, b, e, seen), shape[0], chunk=32
    )
    return seen


def blur_width(shape: tuple[int, int], view: View, adaptation_luminance: np.ndarray | float) -> np.ndarray:
    """(h, w) float32, the width in pixels of the sample to which a picture of (H, W) pixels is blurred.

    Pixels off the axis cover less, by the cube of the cosine in solid angle.
    """
    adapted = adaptation_grid(adaptation_luminance)
    if adapted.size == 1:
        adapted = np.broadcast_to(adapted, foveal_shape(shape, view))
    ahead = directions(adapted.shape, shape, view)[..., 2]
    pixels_per_degree = view.focal_length * np.radians(1.0) / ahead**1.5
    return (pixels_per_degree / (np.sqrt(2) * np.maximum(acuity(adapted), _COARSEST))).astype(np.float32)
