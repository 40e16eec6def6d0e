"""The primaries that linear R, G and B stand for, and the way between two sets of them.

A file's own primaries are converted to Rec. 709 when it is read; where the whites differ too, colours are adapted (Lam
1985, "Bradford"), so that what was neutral stays neutral. Nothing is clipped: a colour outside Rec. 709 has a negative
channel.

The colour of light of a given temperature: CIE 15:2018, §4.1.2, phases of daylight from 4000 to 25 000 K. M. Krystek,
"An algorithm to calculate correlated colour temperature", Color Research & Application 10 (1985), 38–40: the Planckian
locus, to 1e-4 in (u, v).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS, luminance, triple
from relume.image.radiance import RadianceMap

COOLEST, DAYLIGHT, HOTTEST = 2000.0, 4000.0, 25000.0
"""K. Below the first a radiator's colour nears the edge of Rec. 709, where its blue is nothing."""

_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_SAME = 2e-3  # chromaticities are written with three digits, and D65 as .3127 or .313


@dataclass(frozen=True)
class Primaries:
    """CIE 1931 x, y of the red, green and blue primary and of white, R = G = B."""

    red: tuple[float, float]
    green: tuple[float, float]
    blue: tuple[float, float]
    white: tuple[float, float]

    def __post_init__(self) -> None:
        values = np.array(self.values)
        with np.errstate(all="ignore"):
            usable = bool(np.all(np.isfinite(values))) and self.white[1] > 0 and np.linalg.cond(_columns(self)) < 1e6
        if not usable or not np.all(np.linalg.solve(_columns(self), _white(self.white)) > 0):
            raise ValueError(f"the primaries are {self.text}; white must lie within the triangle of red, green, blue")

    @staticmethod
    def of(values: object) -> Primaries:
        """From eight numbers: x, y of red, green, blue and white; ValueError for others."""
        numbers = [float(value) for value in np.ravel(np.asarray(values, np.float64))]
        if len(numbers) != 8:
            raise ValueError(f"{len(numbers)} numbers; primaries are eight: x, y of red, green, blue and white")
        red, green, blue, white = zip(numbers[::2], numbers[1::2], strict=True)
        return Primaries(red, green, blue, white)

    @property
    def values(self) -> tuple[float, ...]:
        """The eight numbers, x, y of red, green, blue and white."""
        return (*self.red, *self.green, *self.blue, *self.white)

    @property
    def text(self) -> str:
        """The eight numbers as a Radiance PRIMARIES line has them."""
        return " ".join(f"{value:.6g}" for value in self.values)

    def to_xyz(self) -> np.ndarray:
        """(3, 3) from linear R, G, B to CIE XYZ, in which R = G = B = 1 has Y = 1 (SMPTE RP 177)."""
        columns = _columns(self)
        return columns * np.linalg.solve(columns, _white(self.white))

    def is_close(self, other: Primaries) -> bool:
        """Whether the two are the same but for rounding, 0.002 in each coordinate."""
        return bool(np.allclose(self.values, other.values, rtol=0, atol=_SAME))


def adaptation(seen: tuple[float, float], wanted: tuple[float, float]) -> np.ndarray:
    """(3, 3) on XYZ that takes the white x, y of `seen` to that of `wanted`; the identity where they are the same.

    The same but for rounding, 0.0002 in each coordinate: D65 is written in several ways.
    """
    return np.eye(3) if np.allclose(seen, wanted, rtol=0, atol=_SAME / 10) else _adapted(seen, wanted)


def between(given: Primaries, wanted: Primaries) -> np.ndarray:
    """(3, 3) from linear R, G, B of `given` to those of `wanted`; white stays (1, 1, 1)."""
    return np.linalg.inv(wanted.to_xyz()) @ _adapted(given.white, wanted.white) @ given.to_xyz()


def converted(image: RadianceMap, matrix: np.ndarray, given: Primaries) -> RadianceMap:
    """The map with its channels mixed by `matrix`, and the primaries it had as an attribute.

    Variances are converted as of independent channels.
    """
    variance = None if image.variance is None else mixed(image.variance, matrix**2)
    attributes = {**image.attributes, "primaries": given.text}
    return replace(image, radiance=mixed(image.radiance, matrix), variance=variance, attributes=attributes)


def mixed(pixels: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(..., 3) float32 of which each new channel is a row of `matrix` times the old ones; infinite beyond float32."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(pixels, np.float32) @ matrix.T.astype(np.float32)


def inside_gamut(pixels: np.ndarray) -> np.ndarray:
    """(…, 3) linear Rec. 709 without negative channels: colours outside it move towards grey of their luminance.

    Light that is handed to renderers can have no negative channel; cut off at 0 it would gain luminance. Pixels whose
    luminance is not above 0 become black. Pixels without a negative channel keep every bit.
    """
    least = pixels.min(axis=-1, keepdims=True)
    if not np.any(least < 0):
        return pixels
    light = np.maximum(luminance(pixels), 0)[..., None].astype(pixels.dtype)
    share = np.divide(light, light - least, out=np.zeros_like(light), where=light > 0)
    return np.where(least < 0, np.maximum(light + share * (pixels - light), 0), pixels).astype(pixels.dtype)


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
    return np.linalg.solve(REC709.to_xyz(), _white(chromaticity))


def gains_from_temperature(kelvin: float) -> tuple[float, float, float]:
    """Gains of red, green and blue that make light of that colour temperature neutral and keep its luminance.

    kelvin : 2000 to 25 000 K; a black body below 4000 K, where lamps are, and a phase of daylight from there

    Raises ValueError outside.
    """
    if not COOLEST <= kelvin <= HOTTEST:
        raise ValueError(f"a colour temperature of {kelvin:g} K; expected 2000 to 25000 K, like 3200 or 5600")
    white = linear_white(daylight_chromaticity(kelvin) if kelvin >= DAYLIGHT else planckian_chromaticity(kelvin))
    return triple(float(LUMINANCE_WEIGHTS @ white) / white)


def _adapted(seen: tuple[float, float], wanted: tuple[float, float]) -> np.ndarray:
    gains = (_BRADFORD @ _white(wanted)) / (_BRADFORD @ _white(seen))
    return np.linalg.inv(_BRADFORD) @ (gains[:, None] * _BRADFORD)


def _columns(primaries: Primaries) -> np.ndarray:
    corners = np.array([primaries.red, primaries.green, primaries.blue])
    return np.column_stack([corners, 1 - corners.sum(1)]).T


def _white(white: tuple[float, float]) -> np.ndarray:
    x, y = white
    return np.array([x / y, 1.0, (1 - x - y) / y])


REC709 = Primaries((0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.3127, 0.3290))
P3 = Primaries((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), REC709.white)
"""Of SMPTE RP 431-2 with the white of sRGB, D65."""
BT2020 = Primaries((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), REC709.white)
"""Of ITU-R BT.2020, and of BT.2100's HDR."""
ADOBE_RGB = Primaries((0.64, 0.33), (0.21, 0.71), (0.15, 0.06), REC709.white)
"""Of Adobe RGB (1998)."""
EQUAL_ENERGY = (1 / 3, 1 / 3)
