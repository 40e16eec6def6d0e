"""The detail that the eye loses in the dark (Ward Larson et al. 1997, §5.3; Shlaer 1937)."""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.tone.histogram.fovea import adaptation_grid, between, directions, foveal_shape
from relume.virtual_camera.tone.vision import acuity
from relume.virtual_camera.view import View

_COARSEST = 1.0
"""Cycles per degree: below about 2e-4 cd/m² the fit crosses 0, where Shlaer's observers still saw 1 or 2."""


def blurred_by_acuity(
    radiance: np.ndarray,
    view: View,
    adaptation_luminance: np.ndarray | float,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Radiance (H, W, 3) float32, blurred at every place to what the eye resolves there, in its unit.

    adaptation_luminance : cd/m²; one for the picture, or a grid (h, w) that lies evenly over it, as foveal samples do
    out : where it goes, which may be `radiance` itself; None for an array of its own

    A pyramid of halved pictures is read between its levels (Ward Larson et al. 1997, §5.3), each made smooth by a
    quadratic B-spline, at a width of 1/√2 of a period of the finest grating seen (eq. 15): 4 to 8 % of such a grating's
    contrast then remains (21 % where that period is below three pixels), near what is just seen on a screen. Beyond the
    border the picture goes on as it ends. What is brightly lit stays sharp to the bit. The mean is kept, to about 1e-3,
    where the adaptation is one.
    """
    from relume._kernel import in_threads
    from relume.virtual_camera.tone.histogram.kernels import blended, halved

    shape = radiance.shape[:2]
    seen = np.empty(radiance.shape, np.float32) if out is None else out
    width = blur_width(shape, view, adaptation_luminance)
    sizes = [shape]
    while 1 << (len(sizes) - 1) < width.max() and max(sizes[-1]) > 1:
        sizes.append(((sizes[-1][0] + 1) // 2, (sizes[-1][1] + 1) // 2))
    if len(sizes) == 1:
        if seen is not radiance:
            seen[:] = radiance
        return seen
    # All halved levels lie in one array: a kernel takes no list.
    starts = np.cumsum([0] + [rows * columns for rows, columns in sizes[1:]])
    deeper = np.empty((starts[-1], 3), np.float32)
    finer = radiance
    for (rows, columns), start in zip(sizes[1:], starts, strict=False):
        coarser = deeper[start : start + rows * columns].reshape(rows, columns, 3)
        in_threads(lambda b, e, f=finer, c=coarser: halved(f, b, e, c), rows, chunk=32)
        finer = coarser
    places = *between(shape[0], width.shape[0]), *between(shape[1], width.shape[1])
    levels = np.array(sizes)

    def work(begin: int, end: int) -> None:
        blended(radiance, deeper, starts, levels, width, *places, begin, end, seen)

    in_threads(work, shape[0], chunk=32)
    return seen


def blur_width(shape: tuple[int, int], view: View, adaptation_luminance: np.ndarray | float) -> np.ndarray:
    """(h, w) float32, the width in pixels of the sample to which a picture of (H, W) pixels is blurred.

    Pixels off the axis cover less, by the cube of the cosine in solid angle. A sample is as sharp as the sharpest
    beside it: an eye that looks there sees them too, and no blur of the dark may reach a lamp.
    """
    from scipy.ndimage import minimum_filter

    adapted = adaptation_grid(adaptation_luminance)
    if adapted.size == 1:
        adapted = np.broadcast_to(adapted, foveal_shape(shape, view))
    ahead = directions(adapted.shape, shape, view)[..., 2]
    pixels_per_degree = view.focal_length * np.radians(1.0) / ahead**1.5
    width = pixels_per_degree / (np.sqrt(2) * np.maximum(acuity(adapted), _COARSEST))
    return minimum_filter(width, 3, mode="nearest").astype(np.float32)
