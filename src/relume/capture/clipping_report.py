"""What a radiance map does not hold: what was clipped, over which solid angle, and how bright it is at least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap


@dataclass(frozen=True)
class ClippingReport:
    """What was measured and what was not.

    saturated, black, outside : pixels saturated in every photograph, black in every one, and in none of them
    pixels : of the whole picture
    solid_angle : steradians that are saturated; None where the focal length is unknown
    brightest : the largest luminance among the saturated pixels' lower bounds, in the map's unit; 0 without any
    irradiance : (3,) what the saturated pixels bring at least through a plane that faces them, ∫ L dω of their lower
        bounds; None where the focal length is unknown. What they bring beyond it no photograph shows
    share : the same lower bounds as a share of all the light in the picture (luminance); the true share is larger
    orders : orders of magnitude between the 0.1st and the 99.99th percentile of measured luminance
    """

    saturated: int
    black: int
    outside: int
    pixels: int
    solid_angle: float | None
    brightest: float
    irradiance: tuple[float, float, float] | None
    share: float
    orders: float


def solid_angles(width: int, height: int, focal_length: float) -> np.ndarray:
    """(H, W) steradians of each pixel of a distortion-free lens: f / (x² + y² + f²)^{3/2} a pixel.

    focal_length : pixels; the optical axis meets the picture in its middle
    """
    x = np.arange(width) + 0.5 - width / 2
    y = np.arange(height)[:, None] + 0.5 - height / 2
    return focal_length / (x * x + y * y + focal_length**2) ** 1.5


def clipping_report(picture: RadianceMap, *, focal_length: float | None = None) -> ClippingReport:
    """Count what `picture` does not hold.

    focal_length : pixels; without it solid angles are not known and pixels count alike
    Raises ValueError for a map without a clipped mask.
    """
    if picture.clipped is None:
        raise ValueError("the radiance map has no clipped mask, so what it lacks is not known; merge a bracket")
    width, height = picture.size
    cells = solid_angles(width, height, focal_length) if focal_length else np.ones((height, width))
    saturated = picture.clipped == SATURATED
    light = luminance(picture.radiance)
    measured = light[(picture.clipped == 0) & (light > 0)]
    low, high = np.percentile(measured, (0.1, 99.99)) if measured.size else (1.0, 1.0)
    total = float((light * cells).sum(dtype=np.float64))
    bounds = picture.radiance[saturated].astype(np.float64)
    irradiance = (bounds * cells[saturated][:, None]).sum(0)
    return ClippingReport(
        saturated=int(saturated.sum()),
        black=int((picture.clipped == BLACK).sum()),
        outside=int((picture.clipped == OUTSIDE).sum()),
        pixels=width * height,
        solid_angle=float(cells[saturated].sum()) if focal_length else None,
        brightest=float(light[saturated].max(initial=0.0)),
        irradiance=(float(irradiance[0]), float(irradiance[1]), float(irradiance[2])) if focal_length else None,
        share=float((light * cells)[saturated].sum(dtype=np.float64)) / total if total > 0 else 0.0,
        orders=float(np.log10(high / low)),
    )
