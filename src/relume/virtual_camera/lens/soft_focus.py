"""Soft focus: a sharp picture with a glow, as of a lens with spherical aberration or a veil before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.blurring import gaussian_taps, mirrored_transfer, scale_waves
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

BAND = 64
"""Rows that are put together at once."""


@dataclass(frozen=True)
class SoftFocus(Relative):
    """A share of the light, blurred, over the rest, which stays sharp: as in *Rendering with Natural Light* (1998).

    share : of the light that is blurred, 0 to 1; a third keeps eyelashes and lets lamps glow (a choice of taste)
    radius : standard deviation of the Gaussian glow, as a fraction of the picture's width, so that a picture looks the
        same at any size; 0.01 is 0.5° of a 50° view

    The same everywhere, whatever the depth. No light is lost: at the border the picture goes on as its mirror image, so
    what glows out of the frame comes back in.
    """

    share: float = 1 / 3
    radius: float = 0.01

    def __post_init__(self) -> None:
        if not 0 <= self.share <= 1:
            raise ValueError(f"the share is {self.share}; expected 0 (sharp) to 1 (all light blurred)")
        if not 0 <= self.radius <= 1:
            raise ValueError(f"the radius is {self.radius}; expected 0 to 1, a fraction of the picture's width")

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 with its glow; the mean of each channel stays.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        height, width = radiance.shape[:2]
        sigma = self.radius * width
        if sigma == 0 or self.share == 0:
            return radiance.copy()
        taps = gaussian_taps(sigma)
        down, across = self.share * mirrored_transfer(taps, height), mirrored_transfer(taps, width)
        out, waves = np.empty_like(radiance), np.empty((height, width))
        for channel in range(radiance.shape[2]):
            # One channel at a time, in place: in double precision, or a sun's rounding would be seen in the shadows.
            waves[:] = radiance[..., channel]
            scale_waves(waves, down, across)
            for top in range(0, height, BAND):
                part = slice(top, top + BAND)
                # Transforms round; a mean of light is not below 0.
                glow = np.maximum(waves[part], 0)
                out[part, :, channel] = glow + (1 - self.share) * radiance[part, :, channel]
        return out
