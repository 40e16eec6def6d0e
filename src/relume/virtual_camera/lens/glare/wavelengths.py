"""Wavelengths that a pixel's red, green and blue stand for, and how much of each."""

from __future__ import annotations

import numpy as np

from relume.image.primaries import REC709

REFERENCE = 568.0
"""nm, at which the point spreads of Spencer et al. 1995 are written."""

# Wyman, Sloan & Shirley 2013: height, peak (nm), falloff below and above it (1/nm).
_RED = ((0.362, 442.0, 0.0624, 0.0374), (1.056, 599.8, 0.0264, 0.0323), (-0.065, 501.1, 0.0490, 0.0382))
_GREEN = ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322))
_BLUE = ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725))


def colour_matching(wavelengths: np.ndarray) -> np.ndarray:
    """(N, 3) CIE 1931 x̄, ȳ, z̄ at wavelengths (N,) in nm (Wyman, Sloan & Shirley 2013)."""
    return np.stack([sum(_lobe(wavelengths, *lobe) for lobe in lobes) for lobes in (_RED, _GREEN, _BLUE)], axis=-1)


def _lobe(wavelengths: np.ndarray, height: float, peak: float, below: float, above: float) -> np.ndarray:
    away = (wavelengths - peak) * np.where(wavelengths < peak, below, above)
    return height * np.exp(-0.5 * away**2)


def channel_shares(wavelengths: np.ndarray) -> np.ndarray:
    """(3, N) how much of each wavelength is in the light of a red, green and blue value; each row sums to 1.

    They are the colours of the spectrum in Rec. 709 where these are positive: no primary holds negative light. White
    that is spread by wavelength so is white in sum.
    """
    shares = np.maximum(np.linalg.inv(REC709.to_xyz()) @ colour_matching(wavelengths).T, 0)
    return shares / shares.sum(1, keepdims=True)
