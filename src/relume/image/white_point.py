"""The colour of light of a given temperature, and the gains that make it neutral.

CIE 15:2018, §4.1.2: phases of daylight from 4000 to 25 000 K. M. Krystek, "An algorithm to calculate correlated colour
temperature", Color Research & Application 10 (1985), 38–40: the Planckian locus, to 1e-4 in (u, v).
"""

from __future__ import annotations

import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS

COOLEST, DAYLIGHT, HOTTEST = 2000.0, 4000.0, 25000.0
"""K. Below the first a radiator's colour nears the edge of Rec. 709, where its blue is nothing."""

# ITU-R BT.709-6, item 1.3: x, y of red, green, blue and white
_PRIMARIES, _WHITE = ((0.64, 0.33), (0.30, 0.60), (0.15, 0.06)), (0.3127, 0.3290)


def daylight_chromaticity(kelvin: float) -> tuple[float, float]:
    """CIE x, y of daylight of a correlated colour temperature of 4000 to 25 000 K (CIE 15:2018, eqs. 4.7–4.9)."""
    if not DAYLIGHT <= kelvin <= HOTTEST:
        raise ValueError(f"daylight of {kelvin:g} K; its phases are known from 4000 to 25000 K")
    t = 1e3 / kelvin
    if kelvin <= 7000:
        x = -4.6070 * t**3 + 2.9678 * t**2 + 0.09911 * t + 0.244063
    else:
        x = -2.0064 * t**3 + 1.9018 * t**2 + 0.24748 * t + 0.237040
    return x, -3 * x * x + 2.870 * x - 0.275


def planckian_chromaticity(kelvin: float) -> tuple[float, float]:
    """CIE x, y of a black body of 1000 to 15 000 K (Krystek 1985)."""
    if not 1000 <= kelvin <= 15000:
        raise ValueError(f"a black body of {kelvin:g} K; expected 1000 to 15000 K")
    t = kelvin
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t * t) / (1 + 8.42420235e-4 * t + 7.08145163e-7 * t * t)
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t * t) / (1 - 2.89741816e-5 * t + 1.61456053e-7 * t * t)
    return 3 * u / (2 * u - 8 * v + 4), 2 * v / (2 * u - 8 * v + 4)


def linear_white(chromaticity: tuple[float, float]) -> np.ndarray:
    """Linear Rec. 709 (R, G, B) of luminance 1 of a chromaticity x, y; (1, 1, 1) is D65's, (0.3127, 0.3290)."""
    from_rgb = np.array([_tristimulus(*xy) for xy in _PRIMARIES]).T
    from_rgb *= np.linalg.solve(from_rgb, _tristimulus(*_WHITE))
    return np.linalg.solve(from_rgb, _tristimulus(*chromaticity))


def gains_from_temperature(kelvin: float) -> tuple[float, float, float]:
    """Gains of red, green and blue that make light of that colour temperature neutral and keep its luminance.

    kelvin : 2000 to 25 000 K; a black body below 4000 K, where lamps are, and a phase of daylight from there

    Raises ValueError outside.
    """
    if not COOLEST <= kelvin <= HOTTEST:
        raise ValueError(f"a colour temperature of {kelvin:g} K; expected 2000 to 25000 K, like 3200 or 5600")
    white = linear_white(daylight_chromaticity(kelvin) if kelvin >= DAYLIGHT else planckian_chromaticity(kelvin))
    gains = float(LUMINANCE_WEIGHTS @ white) / white
    return float(gains[0]), float(gains[1]), float(gains[2])


def _tristimulus(x: float, y: float) -> np.ndarray:
    """X, Y, Z of luminance 1."""
    return np.array([x / y, 1.0, (1 - x - y) / y])
