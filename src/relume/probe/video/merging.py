"""Several exposures of one moment, laid on one another in a map and merged with their variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.video.light_tables import LightTables, looked_up
from relume.probe.video.lookup import Continuation, Lookup

LEAST = 0.05
"""Share of the darkest take's belief below which light is taken for saturated."""
BOUND = 1e-3
"""Belief in white of the darkest take, so that a lower bound is there where nothing else is."""


@dataclass(frozen=True, eq=False)
class Take:
    """One exposure of the light: a facet of a film's frames, or every n-th frame.

    film : its number among the films
    phase : of the frames, 0 to below the film's period
    lookup : where its frames show the map
    gain : (3,) its exposure, as a share of the brightest take's
    darkest : whether none is darker: where nothing else shows the light, what it shows is its lower bound
    """

    film: int
    phase: int
    lookup: Lookup
    gain: np.ndarray
    darkest: bool = False

    def collect(self, frame: np.ndarray, tables: LightTables, sums: Collected) -> None:
        """Add what it shows of the light in a frame (H, W, 3) uint8 to sums, in place."""
        part, gain = self.lookup.cut(frame), self.gain.astype(np.float32)
        radiance = self.lookup.to_map(looked_up(tables.exposure / gain, part))
        if self.lookup.gain is not None:
            radiance *= self.lookup.gain
        # Beside a saturated pixel nothing is believed: in between, light would be that of the other pixels alone.
        brightest = cv2.max(cv2.max(part[..., 0], part[..., 1]), part[..., 2])
        belief = np.maximum(tables.belief[:, None], BOUND) if self.darkest else tables.belief[:, None]
        weights = self.lookup.least(looked_up(belief * gain, cv2.merge([brightest] * 3)))
        cv2.accumulateProduct(radiance, weights, sums.light)
        cv2.accumulate(weights, sums.exposure)


@dataclass(frozen=True, eq=False)
class Collected:
    """Sums over takes, all (H, 2H, 3) float32.

    light : Σ c E
    exposure : Σ c g, so that light over exposure is radiance
    """

    light: np.ndarray
    exposure: np.ndarray

    @classmethod
    def nothing(cls, size: int) -> Self:
        """Sums to begin with, of a map of `size` rows."""
        return cls(np.zeros((size, 2 * size, 3), np.float32), np.zeros((size, 2 * size, 3), np.float32))

    def add(self, other: Collected) -> None:
        """Add another's sums to these, in place."""
        cv2.accumulate(other.light, self.light)
        cv2.accumulate(other.exposure, self.exposure)


@dataclass(frozen=True, eq=False)
class MomentMap:
    """The light of one frame.

    radiance : (H, 2H, 3) float32; the exposure of the brightest take shows 1 as white
    exposure : (H, 2H, 3) float32 that it was measured by, as shares of the brightest take's; 0 where it is not measured
    clipped : (H, 2H) uint8 in the codes of `RadianceMap`
    """

    radiance: np.ndarray
    exposure: np.ndarray
    clipped: np.ndarray

    @property
    def saturated(self) -> bool:
        """Whether any of it is a lower bound."""
        return bool((self.clipped == SATURATED).any())

    def variance(self, tables: LightTables) -> np.ndarray:
        """(H, 2H, 3) float32, of the radiance; infinite where it is not measured.

        By the noise of pixel values, and by the camera's curve where that is only assumed. Of the brightest take that
        is believed, which is nearly all of the exposure: the darker ones are several stops below it. Interpolation
        between pixels and means over time leave less.
        """
        level = np.minimum(self.radiance * self.exposure, 1)
        noise = np.stack([np.interp(level[..., c], tables.exposure[:, c], tables.variance[:, c]) for c in range(3)], -1)
        curve = tables.curve_variance(level, self.exposure) * np.square(self.radiance, dtype=np.float64)
        with np.errstate(divide="ignore"):
            return (noise / np.square(self.exposure, dtype=np.float64) + curve).astype(np.float32)


def merged(sums: Collected, darkest: np.ndarray, tables: LightTables, blind: Continuation) -> MomentMap:
    """The radiance of all that was collected of one moment.

    darkest : (3,) the least gain of the takes
    blind : of what no take shows

    Where even the darkest take is saturated radiance is what that would be just at white, a lower bound; what no take
    shows is continued from its rim.
    """
    least = (LEAST * darkest).astype(np.float32)
    radiance = cv2.divide(sums.light, np.maximum(sums.exposure, BOUND / 2 * least))
    clipped = np.zeros(radiance.shape[:2], np.uint8)
    # Where it is short in one channel it is in all: they are believed together.
    short = sums.exposure[..., 0] < least[0]
    if short.any():
        bound = (tables.exposure[255] / darkest).astype(np.float32)
        radiance[short] = np.where(sums.exposure[short] > 0, radiance[short], bound)
        sums.exposure[short] = 0
        clipped[short] = SATURATED
    if len(blind.weights):
        blind.fill(radiance)
        sums.exposure[~blind.seen] = 0
        clipped[~blind.seen] = OUTSIDE
    return MomentMap(radiance, sums.exposure, clipped)


def gains_darkest(takes: Sequence[Take]) -> np.ndarray:
    """(3,) the least gain of some takes, channel by channel."""
    return np.min([take.gain for take in takes], axis=0)
