"""What a pixel value of a film counts for: the light it stands for, how far it is believed, and its noise.

Takes of the same light with the gains g, a share of the brightest take's exposure, are merged as
L = Σ c(z) E(z) / Σ c(z) g: all the light that was collected over all the exposure it was collected in, which is the
estimate of least variance where noise is that of photons. c(z) is 1 but near white, so that noise never chooses its own
weight; a dark take counts little beside a bright one by its exposure alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from relume.capture.merging import InverseVariance
from relume.image.colour import decode_srgb
from relume.image.response import Response

UNKNOWN_NOISE = 1.0
"""Pixel values that a value of an unknown camera is off by: rounding, and what a fair compression leaves."""


@dataclass(frozen=True, eq=False)
class LightTables:
    """Tables over the 256 pixel values of a film, all float32.

    exposure : (256, 3) of the sensor, 1 at white
    belief : (256,) c(z), 1, falling to 0 before white: in saturated patches compression leaves 250 where 255 was
    variance : (256, 3) of the exposure
    """

    exposure: np.ndarray
    belief: np.ndarray
    variance: np.ndarray

    @classmethod
    def of(cls, response: Response | None) -> Self:
        """The tables of a camera's response (Debevec & Malik 1997, §2.1); of sRGB where it is None.

        Raises ValueError for a response of other than 256 values.
        """
        values = np.arange(256)
        if response is None:
            exposure = np.tile(decode_srgb(values / 255)[:, None], (1, 3))
            deviation = np.full((256, 3), UNKNOWN_NOISE)
        elif response.levels != 256:
            raise ValueError(f"the response has {response.levels} values; a film's frames have 256")
        else:
            exposure = np.exp(response.log_exposure.T - response.log_exposure[:, -1])
            exposure[0] = 0.0  # no light, where a logarithm has to stay above it
            deviation = np.maximum(response.deviation.T, np.sqrt(1 / 12))
        usual = InverseVariance()
        belief = np.clip((255 - values - usual.guard) / usual.fade, 0, 1)
        variance = (np.gradient(exposure, axis=0) * deviation) ** 2
        return cls(*(each.astype(np.float32) for each in (exposure, belief, variance)))

    @property
    def white(self) -> float:
        """The exposure from which on a value is believed no more, of the channel where that is least."""
        return float(self.exposure[self.belief > 0.999].max(axis=0).min())

    @property
    def black(self) -> float:
        """The exposure below which rounding and compression are more than a tenth of a value."""
        return float(self.exposure[20].max())


def looked_up(table: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """The entries of a table (256, 3), or (256,), at the values of pixels (H, W, 3), or (H, W), uint8: float32."""
    return cv2.LUT(pixels, np.ascontiguousarray(table[None]))
