"""The sensor's noise, from pixels that stayed the same while the exposure changed."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.capture.response.sampling import Observations

ROUNDING = 1 / 12
"""Variance of a pixel value from rounding alone."""
BINS = 24
"""Ranges of pixel values whose scatter is measured apart."""
DARKEST = 6.0
"""In 256ths of the range: below, noise is as large as the light and the curve's slope says nothing of it."""


@dataclass(frozen=True, eq=False)
class Noise:
    """Photon and read noise of a sensor: var(X) = shot · X + read², X the exposure with 1 at the greatest pixel value.

    shot : (3,) variance of the exposure that is white; 1 / shot is the number of electrons of a white pixel
    read : (3,) standard deviation where there is no light
    """

    shot: np.ndarray
    read: np.ndarray

    def deviation(self, log_exposure: np.ndarray) -> np.ndarray:
        """(3, levels) standard deviation of a pixel value of the curves `log_exposure`, rounding included.

        Noise of the exposure becomes noise of the value through the curve's slope, dz/dX = 1 / (X g′).
        """
        relative = np.exp(log_exposure - log_exposure[:, -1:])
        slope = relative * np.gradient(log_exposure, axis=1)
        rise = 1 / np.maximum(slope, 1e-9)
        variance = (self.shot[:, None] * relative + self.read[:, None] ** 2) * rise**2
        # Where the curve is level but for a hair its slope is no camera's; nothing scatters by more than all values.
        return np.minimum(np.sqrt(variance + ROUNDING), log_exposure.shape[1] / 4)


def fit_noise(log_exposure: np.ndarray, still: Sequence[Sequence[Observations]]) -> tuple[Noise | None, np.ndarray]:
    """Fit `Noise` to the scatter of the same pixels in different photographs.

    log_exposure : (3, levels) the curves
    still : for each channel the values of places that were not chosen by their noise, a bracket each
    Returns the noise, None where too few values are seen to fit it, and the table (3, levels) of the standard
    deviation of every pixel value, 1/√12 from rounding where nothing is known.
    """
    with ThreadPoolExecutor(3) as pool:
        found = [each for each in pool.map(_fitted, log_exposure, still) if each is not None]
    if len(found) < 3:
        return None, np.full(log_exposure.shape, ROUNDING**0.5)
    shot, read, table = zip(*found, strict=True)
    return Noise(np.array(shot), np.array(read)), np.stack(table)


def _fitted(log_exposure: np.ndarray, still: Sequence[Observations]) -> tuple[float, float, np.ndarray] | None:
    """Photon noise, read noise and the table of one channel; None where too few values are seen."""
    from scipy.optimize import nnls

    levels = len(log_exposure)
    shot, read, table = 0.0, 0.0, np.full(levels, ROUNDING**0.5)
    # What a pixel's own light is judged by depends on the noise; three rounds settle both.
    for _ in range(3):
        found = _scatter(log_exposure, table, still)
        if len(found) < 3:
            return None
        value, variance, count = found.T
        at = np.clip(np.rint(value).astype(int), 1, levels - 2)
        relative = np.exp(log_exposure - log_exposure[-1])[at]
        rise = 1 / np.maximum(relative * np.gradient(log_exposure)[at], 1e-9)
        # A variance measured from n values is uncertain by variance · √(2 / n).
        weight = np.sqrt(count / 2) / np.maximum(variance, ROUNDING)
        design = np.column_stack([relative, np.ones_like(relative)]) * (rise**2 * weight)[:, None]
        scale = np.linalg.norm(design, axis=0)
        both, _ = nnls(design / scale, np.maximum(variance - ROUNDING, 0.0) * weight)
        shot, read = float(both[0] / scale[0]), float(np.sqrt(both[1] / scale[1]))
        (table,) = Noise(np.array([shot]), np.array([read])).deviation(log_exposure[None])
    return shot, read, table


def _scatter(curve: np.ndarray, deviation: np.ndarray, still: Sequence[Observations]) -> np.ndarray:
    """(bins, 3): mean pixel value, variance of the values about the pixels' own light, and how many values."""
    levels = len(curve)
    slope = np.gradient(curve)
    precision = np.maximum(slope * deviation, 1e-6) ** -2.0
    darkest = DARKEST * levels / 256
    values_seen, squares = [], []
    for values, log_exposures in still:
        # Near either end values are cut off, and the mean of what is left is not the light.
        counted = (values > darkest) & (values < levels - darkest)
        share = np.where(counted, precision[values], 0.0)
        total = share.sum(1, keepdims=True)
        share = share / np.where(total > 0, total, 1.0)
        log_radiance = curve[values] - log_exposures
        mean = (share * log_radiance).sum(1, keepdims=True)
        # A value pulls the mean it is compared with towards itself: its residual has 1 − share of its variance.
        usable = counted & (share < 0.8)
        expected = np.interp((mean + log_exposures)[usable], curve, np.arange(levels))
        difference = (log_radiance - mean)[usable] / slope[values[usable]]
        values_seen.append(expected)
        squares.append(difference**2 / (1 - share[usable]))
    value, square = np.concatenate(values_seen), np.concatenate(squares)
    edges = np.linspace(darkest, levels - darkest, BINS + 1)
    # Of one byte, such numbers are sorted in one pass.
    place = np.digitize(value, edges).astype(np.uint8)
    order = np.argsort(place, kind="stable")
    bounds = np.searchsorted(place[order], np.arange(1, BINS + 2, dtype=np.uint8))
    value, square = value[order], square[order]
    found = []
    for begin, end in pairwise(bounds):
        here = square[begin:end]
        if len(here) >= 50:
            # The mean square without those beyond four standard deviations: edges and movement. The median shows
            # them, since the median square of a bell curve is 0.455 of its variance.
            kept = here[here <= max(16 * 2.198 * float(np.median(here)), 1.0)]
            found.append((float(value[begin:end].mean()), float(kept.mean()), float(len(here))))
    return np.array(found).reshape(-1, 3)
