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
ASSUMED = 0.6
"""ln of exposure by which the sRGB curve is off below white where a camera's own is not known. Five brackets of JPEGs,
by four cameras, gave curves that lie 0.4 rms off it from value 40 on, 0.7 at most there, and 1.1 at value 10: cameras
render with more contrast."""
ASSUMED_RATIO = 0.4
"""Share of ln of an exposure's ratio that it is off by for the same reason, rms of those curves and of ratios from half
a stop to four: what two exposures show alike lies on other parts of the curve, whose slopes differ."""


@dataclass(frozen=True, eq=False)
class LightTables:
    """Tables over the 256 pixel values of a film, all float32.

    exposure : (256, 3) of the sensor by the colours of light, 1 at white in the channel where that is most
    belief : (256,) c(z), 1, falling to 0 before white: in saturated patches compression leaves 250 where 255 was
    variance : (256, 3) of the exposure, by noise, which differs from frame to frame
    assumed : ln of exposure by which the curve itself may be off, all frames alike; 0 where it is the camera's own
    assumed_ratio : share of ln of an exposure's ratio that was found by an assumed curve
    """

    exposure: np.ndarray
    belief: np.ndarray
    variance: np.ndarray
    assumed: float = 0.0
    assumed_ratio: float = 0.0

    @classmethod
    def of(cls, response: Response | None, balance: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Self:
        """The tables of a camera's response (Debevec & Malik 1997, §2.1); of sRGB where it is None.

        balance : of a camera's profile, factors on the channels' radiance; 1 leaves the response's own
        Raises ValueError for a response of other than 256 values.
        """
        values = np.arange(256)
        if response is None:
            exposure = np.tile(decode_srgb(values / 255)[:, None], (1, 3))
            deviation = np.full((256, 3), UNKNOWN_NOISE)
        elif response.levels != 256:
            raise ValueError(f"the response has {response.levels} values; a film's frames have 256")
        else:
            # One number for all channels: what is grey by the response and its balance stays grey.
            curves = response.log_exposure.T + np.log(balance)
            exposure = np.exp(curves - curves[-1].max())
            exposure[0] = 0.0  # no light, where a logarithm has to stay above it
            deviation = np.maximum(response.deviation.T, np.sqrt(1 / 12))
        usual = InverseVariance()
        belief = np.clip((255 - values - usual.guard) / usual.fade, 0, 1)
        variance = (np.gradient(exposure, axis=0) * deviation) ** 2
        exposure, belief, variance = (each.astype(np.float32) for each in (exposure, belief, variance))
        if response is None:
            return cls(exposure, belief, variance, ASSUMED, ASSUMED_RATIO)
        return cls(exposure, belief, variance)

    def curve_variance(self, level: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Variance of ln radiance, float32, by a curve that is only assumed; 0 where it is the camera's own.

        level : exposures on the curve; at white, 1, all curves meet
        gain : the exposure that it was seen in, as a share of the brightest take's
        """
        if not self.assumed:
            return np.zeros(np.shape(level), np.float32)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(gain > 0, np.log(gain), 0)
        found = (self.assumed * (1 - level**3)) ** 2 + (self.assumed_ratio * ratio) ** 2
        return np.asarray(found, np.float32)

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
