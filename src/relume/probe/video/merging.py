"""Several exposures of one moment, laid on one another in a map and merged with their variance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.video.light_tables import LightTables, looked_up
from relume.probe.video.lookup import Continuation, Lookup

LEAST = 0.05
"""Share of the darkest take's belief below which light is taken for saturated."""


@dataclass(frozen=True, eq=False)
class Take:
    """One exposure of the light: a facet of a film's frames, or every n-th frame.

    film : its number among the films
    phase : of the frames, 0 to below the film's period
    lookup : where its frames show the map
    gain : (3,) its exposure, as a share of the brightest take's
    """

    film: int
    phase: int
    lookup: Lookup
    gain: np.ndarray

    def collected(self, frame: np.ndarray, tables: LightTables) -> Collected:
        """What it shows of the light in a frame (H, W, 3) uint8."""
        part = self.lookup.cut(frame)
        light, variance = (self.lookup.to_map(looked_up(table, part)) for table in (tables.exposure, tables.variance))
        # Beside a saturated pixel nothing is believed: in between, light would be that of the other pixels alone.
        brightest = cv2.max(cv2.max(part[..., 0], part[..., 1]), part[..., 2])
        belief = self.lookup.least(looked_up(tables.belief, brightest))[..., None]
        if self.lookup.gain is not None:
            light *= self.lookup.gain
            variance *= self.lookup.gain**2
        light *= belief
        variance *= belief * belief
        return Collected(light, belief * self.gain.astype(np.float32), variance)


@dataclass(frozen=True, eq=False)
class Collected:
    """Sums over takes, all (H, 2H, 3) float32.

    light : Σ c E
    exposure : Σ c g, so that light over exposure is radiance
    spread : Σ c² var E
    """

    light: np.ndarray
    exposure: np.ndarray
    spread: np.ndarray

    def add(self, other: Collected) -> None:
        """Add another's sums to these, in place."""
        for mine, theirs in ((self.light, other.light), (self.exposure, other.exposure), (self.spread, other.spread)):
            np.add(mine, theirs, out=mine)


@dataclass(frozen=True, eq=False)
class MomentMap:
    """The light of one frame.

    radiance, variance : (H, 2H, 3) float32; the exposure of the brightest take shows 1 as white
    clipped : (H, 2H) uint8 in the codes of `RadianceMap`
    """

    radiance: np.ndarray
    variance: np.ndarray
    clipped: np.ndarray

    @property
    def saturated(self) -> bool:
        """Whether any of it is a lower bound."""
        return bool((self.clipped == SATURATED).any())


def merged(sums: Collected, darkest: np.ndarray, tables: LightTables, blind: Continuation) -> MomentMap:
    """The radiance of all that was collected of one moment.

    darkest : (3,) the least gain of the takes
    blind : of what no take shows

    Where even the darkest take is saturated radiance is what that would be just at white, a lower bound, and its
    variance infinite; what no take shows is continued from its rim, and its variance infinite too.
    """
    least = (LEAST * darkest).astype(np.float32)
    exposure = np.maximum(sums.exposure, least)
    radiance = sums.light / exposure
    np.multiply(exposure, exposure, out=exposure)
    variance = sums.spread / exposure
    clipped = np.zeros(radiance.shape[:2], np.uint8)
    short = sums.exposure < least
    if short.any():
        bound = (tables.exposure[255] / darkest).astype(np.float32)
        radiance = np.where(short, np.maximum(radiance, bound), radiance)
        variance[short] = np.inf
        clipped[short.any(axis=-1)] = SATURATED
    if len(blind.weights):
        blind.fill(radiance)
        variance[~blind.seen] = np.inf
        clipped[~blind.seen] = OUTSIDE
    return MomentMap(radiance, variance, clipped)


def gains_darkest(takes: Sequence[Take]) -> np.ndarray:
    """(3,) the least gain of some takes, channel by channel."""
    return np.min([take.gain for take in takes], axis=0)
