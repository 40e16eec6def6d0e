"""The sensor's noise, from pixels that stayed the same while the exposure changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
    from scipy.optimize import nnls

    levels = log_exposure.shape[1]
    shot, read = np.zeros(3), np.zeros(3)
    table = np.full(log_exposure.shape, ROUNDING**0.5)
    for channel in range(3):
        # What a pixel's own light is judged by depends on the noise; three rounds settle both.
        for _ in range(3):
            found = _scatter(log_exposure[channel], table[channel], still[channel])
            if len(found) < 3:
                return None, np.full(log_exposure.shape, ROUNDING**0.5)
            value, variance, count = found.T
            at = np.clip(np.rint(value).astype(int), 1, levels - 2)
            relative = np.exp(log_exposure[channel] - log_exposure[channel, -1])[at]
            rise = 1 / np.maximum(relative * np.gradient(log_exposure[channel])[at], 1e-9)
            # A variance measured from n values is uncertain by variance · √(2 / n).
            weight = np.sqrt(count / 2) / np.maximum(variance, ROUNDING)
            design = np.column_stack([relative, np.ones_like(relative)]) * (rise**2 * weight)[:, None]
            scale = np.linalg.norm(design, axis=0)
            both, _ = nnls(design / scale, np.maximum(variance - ROUNDING, 0.0) * weight)
            shot[channel], read[channel] = both[0] / scale[0], np.sqrt(both[1] / scale[1])
            table[channel] = Noise(shot, read).deviation(log_exposure)[channel]
    return Noise(shot, read), table


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
    found = []
    edges = np.linspace(darkest, levels - darkest, BINS + 1)
    place = np.digitize(value, edges)
    for each in range(1, BINS + 1):
        here = square[place == each]
        if len(here) >= 50:
            # The mean square without those beyond four standard deviations: edges and movement. The median shows
            # them, since the median square of a bell curve is 0.455 of its variance.
            kept = here[here <= max(16 * 2.198 * float(np.median(here)), 1.0)]
            found.append((float(value[place == each].mean()), float(kept.mean()), float(len(here))))
    return np.array(found).reshape(-1, 3)
