"""The curve of histogram adjustment: from how often each luminance occurs to what the screen shows of it.

Logarithms are natural, luminances in cd/m² or, where no eye is asked, in the picture's log mean. A bin of the fine
histogram holds the luminances that share the upper half of a float32: 128 in an octave, so that a pixel's bin is had
without a logarithm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.vision import threshold

DARKEST, BRIGHTEST = 1e-7, 1e7
"""Luminances that can be distinguished from black and from each other, at most: the limits of Radiance's `pcond`,
cd/m²; where no eye is asked, multiples of the picture's log mean."""

BINS = 100
"""Of the histogram that is adjusted: as many as Ward Larson et al. take, §4.2."""

_TOLERANCE = 0.025
"""Of all samples, above the ceiling in the end (Ward Larson et al. 1997, §4.4)."""

_FIRST, _LAST = (int(np.float32(limit).view(np.uint32) >> 16) for limit in (DARKEST, BRIGHTEST))
FINE = slice(_FIRST, _LAST + 1)
"""The fine bins from the darkest to the brightest, among all upper halves of positive float32."""

UPPER_HALVES = 2**15 + 1
INFINITE = 0x7F80
"""The upper half of infinity: bins from here on hold no number."""


def fine_edges() -> np.ndarray:
    """(32769,) float64, the least luminance of each upper half; from infinity on the greatest finite one."""
    finite = (np.arange(INFINITE, dtype=np.uint32) << 16).view(np.float32)
    return np.pad(finite.astype(np.float64), (0, UPPER_HALVES - INFINITE), constant_values=np.finfo(np.float32).max)


class Contrast(Protocol):
    """How much steeper than the world a screen may show it.

    absolute : whether the world's luminances have to be in cd/m²; else they are in any unit
    """

    @property
    def absolute(self) -> bool: ...

    def slope(self, world: np.ndarray, shown: np.ndarray) -> np.ndarray:
        """The greatest d ln(shown)/d ln(world) where luminances `world` are `shown`, cd/m²."""
        ...

    def exposure(self, world: float, shown: float) -> float:
        """The factor on luminances near `world` when they fit on the screen unchanged, about `shown`."""
        ...


@dataclass(frozen=True)
class LinearContrast:
    """No contrast beyond that of the scene (Ward Larson et al. 1997, eq. 5)."""

    @property
    def absolute(self) -> bool:
        return False

    def slope(self, world: np.ndarray, shown: np.ndarray) -> np.ndarray:
        return np.ones_like(world)

    def exposure(self, world: float, shown: float) -> float:
        return shown / world


@dataclass(frozen=True)
class HumanContrast:
    """Nothing seen on the screen that could not be seen in the scene (Ward Larson et al. 1997, eqs. 7a–c)."""

    @property
    def absolute(self) -> bool:
        return True

    def slope(self, world: np.ndarray, shown: np.ndarray) -> np.ndarray:
        return threshold(shown) / threshold(world) * world / shown

    def exposure(self, world: float, shown: float) -> float:
        return float(threshold(np.array(shown)) / threshold(np.array(world)))


def bin_logarithms() -> np.ndarray:
    """(32640 − FINE.start,) the logarithm of each bin's middle, from the darkest on to the greatest finite float32."""
    logs = np.log(fine_edges()[_FIRST : INFINITE + 1])
    return (logs[1:] + logs[:-1]) / 2


def gains(
    shares: np.ndarray, mean: float, darkest: float, brightest: float, screen: DisplayRange, contrast: Contrast
) -> np.ndarray:
    """(32769,) float32, display value per luminance at the lower edge of every upper half of a float32.

    shares : of the samples in the bins FINE, what is brighter in the last one; all 0 for a picture without light, which
        is shown black
    mean : of the samples' logarithms
    darkest, brightest : logarithms of the least and the greatest luminance of any sample

    A scene that fits on the screen is shown in proportion, its log mean at the screen's. What is above BRIGHTEST is as
    bright as that to the curve, and in proportion at most white, so that a sun leaves the rest its place; of a scene
    that lies above altogether the mean, which alone is given as it is, comes to the middle.
    """
    edges = fine_edges()
    total = shares.sum()
    if not total > 0:
        return np.zeros(UPPER_HALVES, np.float32)
    top = min(brightest + np.log(1.01), np.log(BRIGHTEST))
    # A false bin below the darkest sample lets the curve begin at the screen's black.
    false_bin = darkest > np.log(DARKEST)
    bottom = top - (top - darkest) * BINS / (BINS - 1) if false_bin else np.log(DARKEST)
    black, white = np.log(screen.black), np.log(screen.white)
    known = np.maximum(edges, DARKEST)
    adjusted = None
    if top - bottom > white - black:
        cumulated = np.concatenate([[0], np.cumsum(shares)])
        ends = np.linspace(bottom, top, BINS + 1)
        at = np.interp(ends, np.log(edges[_FIRST : _LAST + 2]), cumulated)
        at[0], at[-1] = 0, total
        samples = np.diff(at)
        if false_bin:
            samples[1] /= 2
            samples[0] += samples[1]
        adjusted = _below_ceiling(samples, bottom, top, black, white, contrast)
    if adjusted is None:
        scale = contrast.exposure(float(np.exp(mean)), float(np.exp((black + white) / 2))) / screen.white
        return np.minimum(scale, max(1.0, scale * BRIGHTEST) / known).astype(np.float32)
    # ln Ld = ln Ldmin + (ln Ldmax − ln Ldmin)·P(ln Lw) (eq. 4), and the screen adds its own black.
    share = np.interp(np.log(known), np.linspace(bottom, top, BINS + 1), adjusted)
    return (screen.values_of(np.exp(black + (white - black) * share)) / known).astype(np.float32)


def _below_ceiling(
    samples: np.ndarray, bottom: float, top: float, black: float, white: float, contrast: Contrast
) -> np.ndarray | None:
    """(BINS + 1,) the cumulated shares of a histogram cut off where the curve would be too steep; None where so little
    is left that nothing needs to be compressed (Ward Larson et al. 1997, §4.4)."""
    step = (top - bottom) / BINS
    world = np.exp(bottom + (np.arange(BINS) + 0.5) * step)
    kept, all_samples = samples, samples.sum()
    curve, trimmed = np.linspace(0, 1, BINS + 1), np.inf
    while (total := kept.sum()) > _TOLERANCE * all_samples:
        last, cut = curve, trimmed
        curve = np.concatenate([[0], np.cumsum(kept)]) / total
        shown = np.exp(black + (white - black) * (curve[1:] + curve[:-1]) / 2)
        ceiling = contrast.slope(world, shown) * total * step / (white - black)
        trimmed = np.maximum(kept - ceiling, 0).sum() / total
        kept = np.minimum(kept, ceiling)
        if trimmed <= _TOLERANCE:
            # Between this curve and the one before, where just the tolerance is trimmed: an end at whole rounds would
            # make a sequence leap whenever it needs one more.
            share = (cut - _TOLERANCE) / (cut - trimmed) if np.isfinite(cut) else 1.0
            return last + share * (curve - last)
    return None
