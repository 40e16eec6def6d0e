"""Which projector pixel lights what each camera pixel sees, how certainly, and how much of that light comes straight.

Under a cosine of N shifts a pixel is A + B cos(θ − 2πk/N). θ is the place within the period and B half of what comes
straight from the projector; what is scattered under the skin or between surfaces is in A alone (Nayar et al. 2006).
What the cosine leaves over is noise, and shows how certain θ is: its deviation is √(2/N) σ/B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from relume.lightstage.geometry.pattern_photographs import PatternPhotographs

NEIGHBOURS = 5
"""Pixels each way over which the noise is averaged: five degrees of freedom of one pixel say little."""


@dataclass(frozen=True)
class DecodingSettings:
    """What is believed of the photographs of a projector's patterns.

    least_direct : the share of a pixel's light that must come straight from the projector; below a quarter the phase is
        that of scattered light, whose place is not the pixel's
    worst_deviation : of a place, projector pixels; beyond it noise or shade speak
    """

    least_direct: float = 0.25
    worst_deviation: float = 0.3


@dataclass(frozen=True, eq=False)
class ProjectorPlaces:
    """What the patterns say of each camera pixel.

    places : (H, W, 2) float64, projector pixels x right, y down from its corner; NaN where they are not believed
    deviation : (H, W, 2) float64, their standard deviations by the noise, projector pixels; NaN there too
    direct : (H, W) float32, the share of the projector's light that comes straight, 0 in shade
    reached : (H, W) bool, where the projector adds light
    """

    places: np.ndarray
    deviation: np.ndarray
    direct: np.ndarray
    reached: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """Where (H, W) bool a place is believed."""
        return np.isfinite(self.places[..., 0])


def decoded_places(photographs: PatternPhotographs, settings: DecodingSettings = DecodingSettings()) -> ProjectorPlaces:
    """The projector's places in photographs under its patterns.

    Raises ValueError where under a hundredth of what the projector reaches can be believed.
    """
    patterns, light = photographs.patterns, photographs.light
    reached = photographs.reached
    valid = reached & ~photographs.clipped
    places, deviations, direct = [], [], np.ones_like(light)
    for axis in "xy":
        phase, amplitude, noise = _cosine(photographs.shifted(axis))
        within = phase / (2 * np.pi) * patterns.period
        # The cell says which period: the place lies within it, so within a quarter of a period of its middle.
        middle = (_cell(photographs, axis) + 0.5) * patterns.period / 2
        place = within + np.rint((middle - within) / patterns.period) * patterns.period
        deviation = patterns.period / (2 * np.pi) * np.sqrt(2 / patterns.steps) * noise / np.maximum(amplitude, 1e-30)
        share = np.where(reached, 2 * amplitude / np.where(reached, light, 1), 0)
        valid &= np.abs(place - middle) < (1 / 4 + 1 / 8) * patterns.period
        valid &= (place >= 0) & (place <= patterns.length(axis))
        valid &= (share > settings.least_direct) & (deviation < settings.worst_deviation)
        direct = np.minimum(direct, share)
        places.append(place)
        deviations.append(deviation)
    if valid.sum() < 0.01 * reached.sum():
        raise ValueError(
            f"the projector's patterns are read on {valid.mean():.1%} of the picture: {1 - reached.mean():.0%} lies in "
            f"shade, and {photographs.clipped.mean():.0%} is saturated; check the projector's focus and the exposure"
        )
    found = [np.where(valid[..., None], np.stack(each, axis=-1), np.nan) for each in (places, deviations)]
    return ProjectorPlaces(found[0], found[1], direct.astype(np.float32), reached)


def _cosine(pictures: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phase (radians), amplitude and noise (H, W) of the cosine through pictures (N, H, W)."""
    count = len(pictures)
    turns = 2 * np.pi * np.arange(count) / count
    mean = pictures.mean(axis=0, dtype=np.float64)
    even = np.tensordot(np.cos(turns), pictures, 1) * 2 / count
    odd = np.tensordot(np.sin(turns), pictures, 1) * 2 / count
    left = np.zeros_like(mean)
    for turn, picture in zip(turns, pictures, strict=True):
        left += (picture - mean - even * np.cos(turn) - odd * np.sin(turn)) ** 2
    noise = np.sqrt(np.maximum(ndimage.uniform_filter(left / (count - 3), NEIGHBOURS), 0))
    return np.arctan2(odd, even), np.hypot(even, odd), noise


def _cell(photographs: PatternPhotographs, axis: str) -> np.ndarray:
    """Which half-period (H, W) the Gray code of an axis says."""
    threshold = 0.5 * (photographs["white"] + photographs["black"])
    bit = np.zeros(threshold.shape, bool)
    cell = np.zeros(threshold.shape, np.int64)
    for level in range(photographs.patterns.levels(axis)):
        # Gray to binary: a bit is the one before it, flipped where the code is white.
        bit = bit ^ (photographs[f"gray_{axis}{level}"] > threshold)
        cell = 2 * cell + bit
    return cell
