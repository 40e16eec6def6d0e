"""The colours that the eye loses in the dark (Ward Larson et al. 1997, §5.2)."""

from __future__ import annotations

import numpy as np

from relume.image.primaries import REC709
from relume.virtual_camera.tone.histogram.fovea import adaptation_grid, between
from relume.virtual_camera.tone.vision import cone_share, scotopic_luminance
from relume.virtual_camera.view import View


def colours_in_the_dark(
    radiance: np.ndarray,
    view: View,
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
    from relume._kernel import in_threads
    from relume.virtual_camera.tone.histogram.kernels import greyed

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
