"""Wavelengths for paths of light: each carries one, drawn as often as it counts in the picture (hero wavelengths).

Wilkie, Nawaz, Droske, Weidlich and Hanika 2014 ("Hero wavelength spectral sampling") give each path one that steers
it. Here the light itself stays linear Rec. 709: light L that is parted at a wavelength λ arrives as weight(λ) times the
sum of share(λ) L over the channels, of which the mean over all λ is L again. White through what does not disperse stays
white, exactly.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from relume.light.spectra.reflectance import primaries, white_matching
from relume.light.spectra.spectrum import LONGEST, SHORTEST, visible

STRATA = 2048
"""Of equal chance: a tenth of a nanometre wide where the eye sees best, 75 at the red end, where it sees nothing."""
FINE = 256
"""Steps of each nanometre, so that strata end between the wavelengths of the tables."""


@lru_cache
def strata() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wavelengths where the strata end, (2049,) nm; weights and shares of each, (2048, 3) linear Rec. 709.

    The mean of the weights is (1, 1, 1), that of weight ⊗ share the identity; the shares of each add up to 1. Weights
    are below 0 in some channels: a wavelength alone is outside of Rec. 709, and what is there cancels in a sum.
    """
    fine = np.linspace(SHORTEST, LONGEST, int(LONGEST - SHORTEST) * FINE + 1)
    matching, parts = (
        np.stack([np.interp(fine, visible(), table[:, channel]) for channel in range(3)], axis=-1)
        for table in (white_matching(), primaries())
    )
    chance = np.cumsum(np.abs(matching).sum(axis=1))
    chance = (chance - chance[0]) / (chance[-1] - chance[0])
    ends = np.interp(np.linspace(0, 1, STRATA + 1), chance, fine)
    # Each fine wavelength belongs to one stratum.
    stratum = np.clip(np.searchsorted(ends, fine, side="right") - 1, 0, STRATA - 1)
    weights = np.stack([np.bincount(stratum, matching[:, c], STRATA) for c in range(3)], axis=-1)
    counts = np.bincount(stratum, minlength=STRATA)[:, None]
    shares = np.stack([np.bincount(stratum, parts[:, c], STRATA) for c in range(3)], axis=-1) / counts
    weights *= STRATA / weights.sum(axis=0)
    shares = shares @ np.linalg.inv(weights.T @ shares / STRATA)
    for each in (ends, weights, shares):
        each.setflags(write=False)
    return ends, weights, shares
