"""What the eye loses of a picture (Ward Larson et al. 1997, §5): contrast by the light that it scatters (Moon & Spencer
1945), and in the dark detail (Shlaer 1937) and colour."""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.image.primaries import REC709
from relume.virtual_camera.tone.histogram.fovea import (
    FOVEA,
    adaptation_grid,
    between,
    directions,
    foveal_samples,
    foveal_shape,
)
from relume.virtual_camera.tone.histogram.kernels import added, blended, greyed, halved, scattered
from relume.virtual_camera.tone.vision import acuity, cone_share, scotopic_luminance
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


def colours_in_the_dark(
    radiance: np.ndarray,
    adaptation_luminance: np.ndarray | float,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Radiance (H, W, 3) float32 as seen by cones and rods, in its unit.

    adaptation_luminance : cd/m²; one for the picture, or a grid (h, w) that lies evenly over it, as foveal samples do
    out : where it goes, which may be `radiance` itself; None for an array of its own

    Above 5.62 cd/m² colours are kept, below 5.6e-3 they are greys of the scotopic luminance, and between them they are
    mixed in proportion to the luminance (Ward Larson et al. 1997, §5.2 and eq. 13). The rods' luminance is given in the
    unit in which white is as bright to rods as to cones: greys stay as they are, reds darken and blues brighten. What
    the picture loses in brightness in the dark is the tone operator's to say.
    """
    height, width = radiance.shape[:2]
    cones = cone_share(adaptation_grid(adaptation_luminance)).astype(np.float32)
    to_xyz = REC709.to_xyz()
    scale = float(1 / scotopic_luminance(to_xyz.sum(1)))
    places = *between(height, cones.shape[0]), *between(width, cones.shape[1])
    seen = np.empty(radiance.shape, np.float32) if out is None else out

    def work(begin: int, end: int) -> None:
        greyed(radiance, to_xyz, scale, cones, *places, begin, end, seen)

    in_threads(work, height, chunk=32)
    return seen
