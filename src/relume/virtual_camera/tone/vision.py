"""The eye: what it can distinguish at a luminance, how sharply, in which colours, and how wide its pupil is.

Luminances are in cd/m². Thresholds are those of Ferwerda, Pattanaik, Shirley & Greenberg 1996, joined to one curve as
by Ward Larson, Rushmeier & Piatko 1997.
"""

from __future__ import annotations

import numpy as np

DARKEST_MESOPIC, BRIGHTEST_MESOPIC = 5.6e-3, 5.62
"""Below rods alone see, above cones alone (Ward Larson et al. 1997)."""


def rod_threshold(adapted: np.ndarray) -> np.ndarray:
    """The least difference in luminance that rods see when adapted to a luminance (Ferwerda et al. 1996, eq. 2)."""
    log = np.log10(np.maximum(adapted, 1e-12))
    bent = np.power(np.maximum(0.405 * log + 1.6, 0), 2.18) - 2.86
    return 10.0 ** np.where(log <= -3.94, -2.86, np.where(log >= -1.44, log - 0.395, bent))


def cone_threshold(adapted: np.ndarray) -> np.ndarray:
    """The least difference in luminance that cones see when adapted to a luminance (Ferwerda et al. 1996, eq. 1)."""
    log = np.log10(np.maximum(adapted, 1e-12))
    bent = np.power(np.maximum(0.249 * log + 0.65, 0), 2.7) - 0.72
    return 10.0 ** np.where(log <= -2.6, -0.72, np.where(log >= 1.9, log - 1.255, bent))


def threshold(adapted: np.ndarray) -> np.ndarray:
    """The least difference in luminance seen by whichever is the more sensitive (Ward Larson et al. 1997, table 1)."""
    log = np.log10(np.maximum(adapted, 1e-12))
    return np.where(log < -0.0184, rod_threshold(adapted), cone_threshold(adapted))


def acuity(adapted: np.ndarray) -> np.ndarray:
    """The finest grating seen, cycles per degree (Shlaer 1937; Ward Larson et al. 1997), from 3e-4 cd/m² on."""
    return 17.25 * np.arctan(1.4 * np.log10(np.maximum(adapted, 1e-12)) + 0.35) + 25.72


def pupil_diameter(adapted: float) -> float:
    """Diameter of the pupil, mm, at a luminance (Moon & Spencer 1944): 7.9 in the dark, 2 in the sun."""
    return 4.9 - 3 * float(np.tanh(0.4 * (np.log10(max(adapted, 1e-12)) + 1)))


def scotopic_luminance(xyz: np.ndarray) -> np.ndarray:
    """Luminance as rods see it (…) of CIE X, Y, Z (…, 3): Y·[1.33·(1 + (Y + Z)/X) − 1.68] (Ward Larson et al. 1997).

    In its own unit: 1.29 Y for illuminant A and 2.57 Y for D65.
    """
    x, y, z = np.moveaxis(np.asarray(xyz), -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        seen = y * (1.33 * (1 + (y + z) / x) - 1.68)
    return np.maximum(np.where(x > 0, seen, 0), 0)


def cone_share(adapted: np.ndarray) -> np.ndarray:
    """How much of vision is of cones: 0 in the scotopic range, 1 in the photopic, linear in the luminance between
    (Ward Larson et al. 1997)."""
    return np.clip((np.asarray(adapted) - DARKEST_MESOPIC) / (BRIGHTEST_MESOPIC - DARKEST_MESOPIC), 0, 1)
