"""Which pixels stand just below white in the shortest photograph, where JPEG gives them the values of white.

A lamp whose red stands at 0.9 of white has values of 247 to 255 in a JPEG, as saturated places have. What is below
white is brighter one exposure on, what is white is not. That is asked of pixels and of those beside them: a lamp's dark
surroundings brighten always, and a cloud just below white says nothing of the sun in it.
"""

from __future__ import annotations

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.response.sampling import levels_of
from relume.capture.response.saturation import WHITE

LONGER = 1.2
"""Least ratio of two exposures by which what is below white brightens."""
BRIGHTER = 1.0
"""Pixel values, 3×3 pixels together, by which it does: JPEG leaves as much between two pictures of what is white."""
DARK = 235
"""Value below which a pixel is no part of what is nearly white: inside lamps at 251 JPEG leaves 241 to 255."""
AROUND = 9
"""Pixels across of what is asked beside a pixel: JPEG rings at a lamp's edge, so that some 3×3 pixels brighten."""
SUPPORT, SHARE = 6, 0.9
"""How many of them must lie inside, and the share that must brighten. At 0.8 a tenth of what is believed in a coloured
texture is white; at 0.97 half of a lamp at 251 is not believed, as JPEG rings in it."""
PLAIN = 13
"""Pixels across in which a pixel that stands out is sought, as the sun in a cloud does."""
STANDS_OUT = 2.0
"""Standard deviations above those beside it by which it does, and"""
OUTSTANDING = 253
"""the value that it then has, at least."""
BAND, REACH = 256, 8
"""Rows looked at together, and what is seen beside them."""


def below_white(bracket: Bracket) -> np.ndarray | None:
    """(H, W, 3) where the shortest photograph is nearly white but below it: the next longer one is brighter there.

    bracket : aligned, white where it ends (`whitened`)
    None where there is no such place, or no second exposure to show it. What is too small or thin to have an inside
    stays white: JPEG and the lens mix it with what is beside it.
    """
    if (
        levels_of(bracket) != 256
        or len(bracket.photographs) < 2
        or bracket.exposures[1] < LONGER * bracket.exposures[0]
    ):
        return None
    first, second = bracket.photographs[:2]
    found = np.zeros(first.pixels.shape, bool)
    bright = first.pixels >= WHITE * 256 - 1
    for photograph in (first, second):
        if photograph.outside is not None:
            bright &= ~photograph.outside[..., None]
    for c in range(3):
        for top in range(0, len(found), BAND):
            columns = np.flatnonzero(bright[top : top + BAND, :, c].any(0))
            if not len(columns):
                continue
            above, left = max(0, top - REACH), max(0, columns[0] - REACH)
            box = np.s_[above : top + BAND + REACH, left : columns[-1] + 1 + REACH, c]
            here = bright[box] & _below(first.pixels[box], second.pixels[box])
            within = np.s_[top - above : top - above + BAND]
            found[top : top + BAND, left : columns[-1] + 1 + REACH, c] = here[within]
    return found if found.any() else None


def _below(shorter: np.ndarray, longer: np.ndarray) -> np.ndarray:
    """(h, w) where the shorter exposure's values (h, w) are below white, by the longer one's."""
    from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

    light = shorter >= DARK
    inside = minimum_filter(light, 3)
    brightens = uniform_filter(longer.astype(np.float32) - shorter, 3) > BRIGHTER
    # Those beside must say the same, and there must be some.
    asked = _mean(inside, AROUND)
    believed = np.greater(asked * AROUND**2, SUPPORT - 0.5)
    believed &= np.greater(_mean(np.logical_and(inside, brightens), AROUND), (SHARE - 1e-3) * asked)
    # A pixel that stands out among its light neighbours is white, however small.
    beside = np.where(light, shorter - np.float32(255), np.float32(0))
    share = np.maximum(_mean(light, PLAIN), np.float32(1e-6))
    mean = uniform_filter(beside, PLAIN) / share
    spread = np.sqrt(np.maximum(uniform_filter(beside**2, PLAIN) / share - mean**2, 0.25))
    white = np.logical_and(inside, np.logical_not(brightens))
    white |= (shorter >= OUTSTANDING) & (shorter - 255.0 - mean > STANDS_OUT * spread)
    # And so are its neighbours that JPEG left as bright.
    white |= np.logical_and(maximum_filter(white, 3), shorter == 255)
    return np.logical_and(believed & ~white, maximum_filter(inside, 3))


def _mean(mask: np.ndarray, size: int) -> np.ndarray:
    from scipy.ndimage import uniform_filter

    return uniform_filter(mask.astype(np.float32), size)
