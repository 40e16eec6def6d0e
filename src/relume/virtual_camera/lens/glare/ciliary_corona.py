"""The ciliary corona: fine coloured needles about a small light, drawn by particles in the lens of the eye.

Each needle is light that many particles diffract; its brightness wanders along it, and everything lies farther out the
longer the wavelength, so needles are coloured (van den Berg, Hagenouw & Coppens 2005). Spencer et al. 1995 draw
it as rays of random strength that vanish by averaging about sources wider than 20 minutes of arc: here convolution
does that. Strengths and widths below are chosen by eye; the mean over all directions is always that of the
point spread.
"""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.lens.glare.point_spread import seen_by_pixels
from relume.virtual_camera.lens.glare.wavelengths import REFERENCE

NEEDLES = 150
"""Over half a turn, twice as many in all: a few per degree would merge at the pixels' pitch."""
WIDTHS = np.radians((0.10, 0.30))
"""Standard deviations of needles across, between which they are drawn."""
SPREAD_OF_STRENGTHS = 1.0
"""Standard deviation of the logarithm of the needles' strengths: a few stand out, as they do to the eye."""
WANDERING, KNOT = 0.6, 0.22
"""Standard deviation of the logarithm of brightness along a needle, and in what logarithm of distance it changes."""
EVEN = 0.4
"""Share of the corona's light between the needles."""
FADING = 3.0
"""Degrees at which half of the contrast is left: beyond, needles are lost in the retina's own stray light."""
_NEAREST, _FARTHEST = np.log(1e-3), np.log(200.0)


def corona(
    degrees: np.ndarray, distances: np.ndarray, angles: int, wavelengths: np.ndarray, shares: np.ndarray, seed: int
) -> np.ndarray:
    """(channels, levels, angles) float32, brightness over the mean of its level.

    degrees, distances : (levels,) from the point, on the retina and in pixels
    wavelengths, shares : (N,) nm and (channels, N), what each channel's light is made of
    seed : two eyes with one seed are one eye
    """
    random = np.random.default_rng(seed)
    place = np.pi * random.random(NEEDLES)
    width = random.uniform(WIDTHS[0], WIDTHS[1], NEEDLES)
    strength = np.exp(SPREAD_OF_STRENGTHS * random.standard_normal(NEEDLES))
    knots = int((_FARTHEST - _NEAREST) / KNOT) + 2
    wander = WANDERING * random.standard_normal((knots, NEEDLES))
    away = (np.arange(angles) * np.pi / angles - place[:, None] + np.pi / 2) % np.pi - np.pi / 2
    profile = np.exp(-0.5 * (away / width[:, None]) ** 2).astype(np.float32)

    contrast = ((1 - EVEN) / (1 + (degrees / FADING) ** 2)).astype(np.float32)[:, None]
    patterns = np.empty((len(shares), len(degrees), angles), np.float32)
    for channel, amounts in enumerate(shares):
        along = np.zeros((len(degrees), NEEDLES))
        for wavelength, share in zip(wavelengths, amounts, strict=True):
            # What one wavelength shows at an angle another shows in proportion to it.
            knot = (np.log(np.maximum(degrees, 2e-3) * REFERENCE / wavelength) - _NEAREST) / KNOT
            before = knot.astype(np.intp)
            after = (knot - before)[:, None]
            along += share * np.exp((1 - after) * wander[before] + after * wander[before + 1])
        drawn = (along * strength).astype(np.float32) @ profile
        drawn /= drawn.mean(axis=1, keepdims=True)
        drawn -= 1
        drawn *= contrast
        drawn += 1
        patterns[channel] = seen_by_pixels(drawn, distances)
    return patterns
