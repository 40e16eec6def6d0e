"""Glare by a measured point spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.image.radiance import RadianceMap
from relume.virtual_camera.lens.glare.convolution import NEAR, Canvas, Transfer, general_transfer, spread_out
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

SUM = 1e-3
"""By which a point spread's sum may differ from 1 without a word: the rounding of files in half floats."""


@dataclass(frozen=True, eq=False)
class MeasuredGlare(Relative):
    """Glare by a point spread that somebody measured.

    kernel : (h, w) or (h, w, 3), odd sizes, where the light of a point in its middle goes. Its sum is made 1, with a
        warning where it is far from it
    mirrored : whether the world goes on beside the picture as its mirror image; else it is black there
    Raises ValueError for another shape, for negative or infinite values, and for a sum of 0.
    """

    kernel: np.ndarray
    mirrored: bool = False

    def __post_init__(self) -> None:
        shape = self.kernel.shape
        if len(shape) not in (2, 3) or shape[2:] not in ((), (3,)) or shape[0] % 2 == 0 or shape[1] % 2 == 0:
            raise ValueError(f"the point spread is {shape}; expected (h, w) or (h, w, 3) with odd h and w")
        if not (np.all(np.isfinite(self.kernel)) and np.all(self.kernel >= 0)):
            raise ValueError("the point spread has negative or infinite values; expected light, 0 or more")
        sums = self.kernel.sum((0, 1), dtype=np.float64)
        if not np.all(sums > 0):
            raise ValueError("the point spread sums to 0 in a channel; expected where a point's light goes")
        if np.any(np.abs(sums - 1) > SUM):
            warn(f"the point spread sums to {np.round(sums, 4)} and is made to sum to 1, so that no light is lost")

    @staticmethod
    def of_lamp(picture: RadianceMap, *, mirrored: bool = False) -> MeasuredGlare:
        """The point spread that a picture of one small lamp in the dark shows, about its brightest pixel.

        picture : of one small lamp in the dark
        mirrored : as of the glare itself
        Raises ValueError for a picture in which nothing shines, or in which the lamp stands at the border.
        """
        light = picture.radiance.sum(2)
        y, x = np.unravel_index(int(np.argmax(light)), light.shape)
        down, right = min(y, light.shape[0] - 1 - y), min(x, light.shape[1] - 1 - x)
        if not light[y, x] > 0 or min(down, right) == 0:
            raise ValueError(f"the brightest pixel, x {x}, y {y}, is black or at the border; expected a lamp inside")
        around = picture.radiance[y - down : y + down + 1, x - right : x + right + 1].astype(np.float64)
        sums = around.sum((0, 1))
        if not np.all(sums > 0):
            raise ValueError("the lamp has a channel without light; photograph a white one")
        return MeasuredGlare(around / sums, mirrored)

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it arrives, in its unit.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        kernel = self.kernel.astype(np.float64)
        kernel = kernel / kernel.sum((0, 1))
        if kernel.ndim == 2:
            kernel = np.repeat(kernel[:, :, None], 3, axis=2)
        return spread_out(radiance, _ArraySpread(kernel), mirrored=self.mirrored)


@dataclass(frozen=True, eq=False)
class _ArraySpread:
    """A point spread (h, w, 3) about its middle."""

    kernel: np.ndarray

    @property
    def kept(self) -> np.ndarray:
        return self.kernel[self.kernel.shape[0] // 2, self.kernel.shape[1] // 2]

    def nearby(self) -> np.ndarray:
        square = np.zeros((2 * NEAR + 1, 2 * NEAR + 1, 3))
        y, x = self.kernel.shape[0] // 2, self.kernel.shape[1] // 2
        down, right = min(y, NEAR), min(x, NEAR)
        inner = self.kernel[y - down : y + down + 1, x - right : x + right + 1]
        square[NEAR - down : NEAR + down + 1, NEAR - right : NEAR + right + 1] = inner
        square[NEAR, NEAR] = 0
        return square

    def transfer(self, channel: int, canvas: Canvas) -> Transfer | None:
        y, x = self.kernel.shape[0] // 2, self.kernel.shape[1] // 2
        if max(y, x) <= NEAR:
            return None
        rest = self.kernel[:, :, channel].astype(np.float32)
        rest[max(y - NEAR, 0) : y + NEAR + 1, max(x - NEAR, 0) : x + NEAR + 1] = 0
        return general_transfer(rest, canvas)
