"""A region of a radiance map whose light was also known otherwise, and the mean radiance that the map holds there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS, luminance
from relume.image.radiance import RadianceMap


@dataclass(frozen=True, eq=False)
class Patch:
    """The mean of a region of a radiance map.

    radiance : (3,) in the map's unit
    deviation : (3,) standard deviation of that mean by the pixels' own noise; 0 for a map without variance
    unevenness : relative standard deviation of luminance over the region beyond its noise. In a region of even
        slope it is the error of a reading whose spot lay half the region's radius beside ours
    pixels : counted
    """

    radiance: np.ndarray
    deviation: np.ndarray
    unevenness: float
    pixels: int

    @property
    def luminance(self) -> float:
        """In the map's unit."""
        return float(luminance(self.radiance))

    @property
    def uncertainty(self) -> float:
        """Relative standard deviation of the luminance as a measure of the region: its noise and its unevenness."""
        noise = float(np.linalg.norm(LUMINANCE_WEIGHTS * self.deviation)) / self.luminance
        return float(np.hypot(noise, self.unevenness))


def disc(size: tuple[int, int], x: int, y: int, radius: float) -> np.ndarray:
    """The pixels (H, W) bool whose centres lie within `radius` of the centre of the pixel in column x and row y.

    size : (width, height)
    x, y : from 0 at the top left
    Raises ValueError for a pixel outside the picture.
    """
    width, height = size
    if not (0 <= x < width and 0 <= y < height):
        raise ValueError(f"pixel {x}, {y} is not in a picture of {width}×{height}; columns and rows count from 0")
    across, down = np.arange(width) - x, np.arange(height) - y
    return across**2 + down[:, None] ** 2 <= radius**2


def rectangle(size: tuple[int, int], left: int, top: int, width: int, height: int) -> np.ndarray:
    """The pixels (H, W) bool of `width` columns from `left` and `height` rows from `top`.

    size : (width, height) of the picture
    Raises ValueError for a rectangle that is empty or reaches out of the picture.
    """
    if not (0 <= left < left + width <= size[0] and 0 <= top < top + height <= size[1]):
        raise ValueError(
            f"the rectangle {left}, {top}, {width}×{height} is not in a picture of {size[0]}×{size[1]}; "
            "give left, top, width and height in pixels"
        )
    region = np.zeros((size[1], size[0]), bool)
    region[top : top + height, left : left + width] = True
    return region


def spot_radius(focal_length: float) -> float:
    """Radius in pixels of what a spot meter measures at the picture's middle: 1° across, as of all held in the hand.

    focal_length : pixels
    """
    return focal_length * float(np.tan(np.radians(1.0) / 2))


def measured_patch(picture: RadianceMap, region: np.ndarray) -> Patch:
    """The mean of a region whose every pixel is measured.

    region : (H, W) bool
    Raises ValueError for a region that is empty, dark, or holds a pixel that no photograph measured: its mean would
    be a bound.
    """
    shape = picture.radiance.shape[:2]
    if region.shape != shape or region.dtype != bool:
        raise ValueError(f"the region is {region.shape} {region.dtype}; expected {shape} bool")
    pixels = picture.radiance[region].astype(np.float64)
    if len(pixels) == 0:
        raise ValueError("the region is empty; mark at least one pixel")
    _require_measured(picture, region)
    mean = pixels.mean(0)
    light = float(luminance(mean))
    if not light > 0:
        raise ValueError(f"the region's mean luminance is {light:.4g}; choose one that is lit")
    variance = np.zeros(3) if picture.variance is None else picture.variance[region].astype(np.float64).mean(0)
    scatter = float(luminance(pixels).var()) - float(LUMINANCE_WEIGHTS**2 @ variance)
    unevenness = np.sqrt(max(scatter, 0.0)) / light
    return Patch(mean, np.sqrt(variance / len(pixels)), float(unevenness), len(pixels))


def _require_measured(picture: RadianceMap, region: np.ndarray) -> None:
    lost = np.zeros(region.shape, bool) if picture.clipped is None else (picture.clipped != 0) & region
    if picture.variance is not None:
        lost |= ~np.isfinite(picture.variance).all(-1) & region
    if lost.any():
        row, column = np.argwhere(lost)[0]
        raise ValueError(
            f"{int(lost.sum())} of the region's {int(region.sum())} pixels are clipped or outside, the first in "
            f"column {column}, row {row}; choose a region that the bracket measured, or add exposures"
        )
