"""How many times as much light one take of a film gets as another, from the film itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import NotABracket
from relume.probe.video.light_tables import LightTables

FEWEST = 24
"""Pixels that two takes must both show, neither near white nor near black, for their ratio to be believed."""
BLOCKS = 16
"""Parts in which a ratio is found anew, for its error: misregistration and changing light are alike within one."""
QUANTILES = 201
OFF = 4.0
"""Standard deviations from which on a pixel is left out: an edge that does not lie on itself."""


@dataclass(frozen=True, eq=False)
class ExposureRatio:
    """ln of one take's exposure over another's, (3,), with its standard errors (3,)."""

    logarithm: np.ndarray
    error: np.ndarray

    @property
    def stops(self) -> tuple[float, float]:
        """The mean over the channels and its error, stops."""
        return float(self.logarithm.mean() / np.log(2)), float(np.hypot.reduce(self.error) / 3 / np.log(2))


def ratio_of_pixels(bright: np.ndarray, dark: np.ndarray, tables: LightTables, name: str) -> ExposureRatio:
    """The ratio dark / bright of takes that lie on one another.

    bright, dark : (N, 3) exposures of the same places, pixel value 255 being 1; N in the order of frames and columns
    name : of the darker take, for messages

    The ratio of sums over the pixels which the brighter one shows below white and the darker one, by the ratio itself,
    well above black: chosen by the less noisy of the two, so that noise does not choose. Pixels that do not fit are
    left out, round by round. Raises NotABracket where too few are shown by both.
    """
    logarithm, error = np.zeros(3), np.zeros(3)
    for c in range(3):
        usable = np.flatnonzero((bright[:, c] < tables.white) & (bright[:, c] > tables.black))
        x, y = bright[usable, c].astype(np.float64), dark[usable, c].astype(np.float64)
        shown = y > tables.black / 2
        if shown.sum() < FEWEST:
            raise NotABracket(_too_little(name))
        slope = float(np.median(y[shown] / x[shown]))
        kept = np.zeros(len(x), bool)
        for _ in range(5):
            near = (x * slope > 1.5 * tables.black) & (x * slope < tables.white)
            if near.sum() < FEWEST:
                near = x * slope > 0.75 * tables.black
            off = np.log(np.maximum(y, 1e-6) / np.maximum(x * slope, 1e-6))
            scale = 1.4826 * float(np.median(np.abs(off[near] - np.median(off[near])))) if near.any() else 1.0
            kept = near & (np.abs(off) < OFF * max(scale, 1e-3))
            if kept.sum() < FEWEST // 3:
                raise NotABracket(_too_little(name))
            slope = float(y[kept].sum() / x[kept].sum())
        parts = [(a.sum(), b.sum()) for a, b in zip(
            np.array_split(x[kept], BLOCKS), np.array_split(y[kept], BLOCKS), strict=True) if a.sum() > 0]  # fmt: skip
        each = np.log([max(b, 1e-12) / a for a, b in parts])
        logarithm[c], error[c] = np.log(slope), float(np.std(each) / np.sqrt(max(len(each), 1)))
    return ExposureRatio(logarithm, error)


def ratio_of_quantiles(bright: np.ndarray, dark: np.ndarray, tables: LightTables, name: str) -> ExposureRatio:
    """The ratio dark / bright of takes that show the same light, but not in the same places.

    bright, dark : (…, 3) exposures

    How much light is brighter than what is a matter of the light alone: the same quantiles of both are divided, and
    the median is taken. Raises NotABracket where no quantile is shown well by both.
    """
    bright, dark = bright.reshape(-1, 3), dark.reshape(-1, 3)
    # As many among the few pixels of lamps, which dark takes alone show, as among the many.
    share = 1 - np.geomspace(4 / min(len(bright), len(dark)), 0.95, QUANTILES)
    x, y = np.quantile(bright, share, axis=0), np.quantile(dark, share, axis=0)
    shown = (x > tables.black) & (x < tables.white) & (y > tables.black / 2) & (y < tables.white)
    logarithm, error = np.zeros(3), np.zeros(3)
    for c in range(3):
        if shown[:, c].sum() < 3:
            raise NotABracket(_too_little(name))
        ratios = np.log(y[shown[:, c], c] / x[shown[:, c], c])
        logarithm[c] = np.median(ratios)
        error[c] = 1.4826 * np.median(np.abs(ratios - logarithm[c])) / np.sqrt(min(len(ratios), BLOCKS))
    return ExposureRatio(logarithm, error)


def _too_little(name: str) -> str:
    return (
        f"{name}: it and the next brighter exposure show too little light well in common; give the stops of all "
        "exposures, or choose exposures that are nearer"
    )
