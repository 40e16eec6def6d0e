"""Black and white point: how a filter of 2001 spends 256 levels on a range of light (Cachelin, HDRExpose)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import decode_srgb
from relume.virtual_camera.protocols import Adaptation, Relative
from relume.virtual_camera.view import View

LEAST = 1 / 255
"""The standard 24 bit black point: the lowest level beside 0."""
_MOST = float(np.log(1e12))
"""ln of the greatest pixel value, as a share of white: its linear value, 5.6e28, is finite in float32."""


@dataclass(frozen=True)
class BlackWhitePoint(Relative):
    """A power that takes the black point to 1/255 and the white point to 1 ("like gamma correction").

    black : the highest level that will be black, as a share of 1/255; 1.0 is the base image's 100 %. Lower ones show
        what lies in the shadows, "using more colours in the darker areas"
    white : the lowest level that will be white. Raised, it "brings detail out of the bright areas at the expense of
        the darker"

    Source: Cachelin's filter HDRExpose, in the SIGGRAPH 2001 course. Pixel values are (L / white)^g, g = ln 255 /
    ln(255 white / black), a channel each. With 1 and 1 radiance becomes pixel value as it is: that filter knew no sRGB,
    and its base image is darker than a plain exposure. The text gives the ends and likens what lies between to gamma;
    the power is the curve that does both and leaves the base image alone. Values stay finite: beyond 1e12 times white
    they are held. Raises ValueError unless 0 < black / 255 < white.
    """

    black: float = 1.0
    white: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.white) and 0 < self.black * LEAST < self.white):
            raise ValueError(
                f"black {self.black:g} (a share of 1/255) and white {self.white:g}; expected 0 < black / 255 < white"
            )

    @property
    def power(self) -> float:
        """The exponent g, 1 for the base image and less for a wider range."""
        return float(np.log(255) / np.log(255 * self.white / self.black))

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Nothing: both points are given, whatever `radiance` and `view` are."""
        return Adaptation(np.zeros(0))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear values that the sRGB curve turns into the filter's pixel values; brighter than `white` exceeds 1.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        from relume.virtual_camera.film.float_table import mapped, tabulated

        # By logarithms: a steep power of a bright light is more than any float holds.
        table = tabulated(lambda share: decode_srgb(np.exp(np.minimum(self.power * np.log(share), _MOST))))
        return mapped(radiance, 1 / self.white, np.stack([table] * 3))
