"""The linear Rec. 709 colour of what reflects or passes light by its wavelength, and the other way round."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from relume.light.spectra.spectrum import illuminant, rgb_matching, visible
from relume.light.spectra.tables import PRIMARIES, table


@lru_cache
def white_matching() -> np.ndarray:
    """(401, 3) the colour that white light (D65) has at each visible wavelength; each column adds up to 1.

    So a surface that reflects all of it is (1, 1, 1) exactly. Channels are below 0 at some wavelengths.
    """
    found = illuminant("D65").at(visible())[:, None] * rgb_matching()
    found = found / found.sum(axis=0)
    found.setflags(write=False)
    return found


@lru_cache
def primaries() -> np.ndarray:
    """(401, 3) share of red, green and blue light at each visible wavelength; they add up to 1 at each.

    Mallett and Yuksel's, brought to our sums exactly: light of linear Rec. 709 L has the spectrum Σ L·primaries times
    D65, whose colour is L again.
    """
    rows = table(PRIMARIES)
    found = np.stack([np.interp(visible(), rows[:, 0], rows[:, 1 + channel]) for channel in range(3)], axis=-1)
    found = found / found.sum(axis=1, keepdims=True)
    found = found @ np.linalg.inv(white_matching().T @ found)
    found.setflags(write=False)
    return found


def colour_of(values: np.ndarray) -> np.ndarray:
    """(..., 3) linear Rec. 709 under D65 of reflectances (..., 401) at the visible wavelengths; nothing is clipped."""
    return np.asarray(values) @ white_matching()
