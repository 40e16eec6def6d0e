"""Shadow maps of reflectance functions: which lights reach each pixel straight (Debevec et al. 2000, §4.4, Fig. 13).

They are found by brightness alone, without geometry. Where strong indirect light falls, as within an ear, a shadowed
light looks bright enough to be seen: the lit part is overestimated there, and the albedo that is fitted to it under.
"""

from __future__ import annotations

import numpy as np

SHADOW = 0.1
"""A light below this fraction of the pixel's bright level is in shadow: a Lambertian surface loses by it only lights
within 6° of its horizon, which show little of it."""
BRIGHT = 0.95
"""The quantile of a pixel's values that is its bright level: highlights are in fewer of the lights than the rest."""
DARKEST = 0.004
"""A pixel below this share of the field's level shows noise, no surface; where the level is that of a surface of albedo
0.5, the share is that of an albedo of 0.002: a tenth of soot's."""
FIELD = 0.99
"""The quantile of the pixels' bright levels that is the field's: so that a subject may be small, but no stray pixel."""


def brightness(values: np.ndarray) -> np.ndarray:
    """The mean of the three channels of values (…, 3)."""
    return np.asarray(values.mean(axis=-1))


def bright_level(bright: np.ndarray) -> np.ndarray:
    """The bright level (…) of brightnesses (N, …) under N lights: their quantile `BRIGHT`."""
    rank = min(int(np.ceil(BRIGHT * len(bright))), len(bright) - 1)
    return np.asarray(np.partition(bright, rank, axis=0)[rank])


def shows_surface(level: np.ndarray) -> np.ndarray:
    """Whether each pixel shows a surface and not noise, bool (…), for the bright levels (…) of all pixels of a field.

    The field's own level decides, so that it does not matter in what unit the lights' irradiance was given.
    """
    above = level[level > 0]
    return np.asarray(level > DARKEST * (np.quantile(above, FIELD) if above.size else 0))


def lit(values: np.ndarray) -> np.ndarray:
    """Whether each light reaches each pixel straight, bool (N, …), for values (N, …, 3) of a reflectance field.

    A pixel that no light brightens is lit by none.
    Source: Debevec et al. 2000, §4.4.
    """
    bright = brightness(values)
    return (bright > SHADOW * bright_level(bright)) & (bright > 0)
