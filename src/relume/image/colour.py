"""Luminance of scene-linear Rec. 709 pixels, and the transfer curves of screens: sRGB, PQ and HLG.

sRGB (IEC 61966-2-1) is the standard's two-piece curve, not a plain 2.2 power: an approximation errs by up to 3 % in the
shadows. PQ (SMPTE ST 2084) and HLG are as ITU-R BT.2100-2 gives them. PQ codes absolute luminance. HLG codes scene
light, and the screen makes luminance of it by the OOTF, a power of the pixel's luminance that depends on how bright the
screen is.
"""

from __future__ import annotations

import numpy as np

# IEC 61966-2-1; ITU-R BT.709-6, item 3.3: the middle row of RGB → XYZ for these primaries and D65
LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
PQ_PEAK = 10000.0
"""cd/m², what the signal 1 of PQ stands for (BT.2100-2, table 4)."""
BT2020_WEIGHTS = np.array([0.2627, 0.6780, 0.0593])
"""Of luminance, for linear R, G and B of BT.2020 primaries (BT.2100-2, table 5)."""

# BT.2100-2, table 4, the fractions as written there
_M1, _M2 = 2610 / 16384, 2523 / 4096 * 128
_C1, _C2, _C3 = 3424 / 4096, 2413 / 4096 * 32, 2392 / 4096 * 32
# BT.2100-2, table 5; b and c are what makes both pieces of the curve meet with one slope
_A = 0.17883277
_B = 1 - 4 * _A
_C = 0.5 - _A * np.log(4 * _A)


def encode_srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB code values of linear ones, both nominally in [0, 1]; nothing is clipped, negative values keep their sign.

    linear : any shape, float
    returns : the same shape and float type
    """
    linear = np.asarray(linear)
    size = np.abs(linear)
    return np.copysign(np.where(size <= 0.0031308, 12.92 * size, 1.055 * size ** (1 / 2.4) - 0.055), linear)


def decode_srgb(encoded: np.ndarray) -> np.ndarray:
    """Linear values of sRGB code values, the inverse of `encode_srgb`.

    encoded : any shape, float in [0, 1] nominally; divide 8-bit codes by 255 first
    returns : the same shape and float type
    """
    encoded = np.asarray(encoded)
    size = np.abs(encoded)
    return np.copysign(np.where(size <= 0.04045, size / 12.92, ((size + 0.055) / 1.055) ** 2.4), encoded)


def luminance(rgb: np.ndarray) -> np.ndarray:
    """Luminance of linear Rec. 709 pixels, 0.2126 R + 0.7152 G + 0.0722 B, in the unit of the pixels.

    rgb : (..., 3) float
    returns : (...), of the float type of `rgb`

    >>> float(luminance(np.array([1.0, 1.0, 1.0])).round(6))
    1.0
    """
    rgb = np.asarray(rgb)
    if rgb.ndim == 0 or rgb.shape[-1] != 3:
        raise ValueError(f"rgb is {rgb.shape}; expected (..., 3): give linear R, G and B in the last axis")
    return rgb @ LUMINANCE_WEIGHTS.astype(np.result_type(rgb, np.float32))


def triple(values: np.ndarray) -> tuple[float, float, float]:
    """Red, green and blue of an array (3,) as plain floats."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def encode_pq(luminance: np.ndarray | float) -> np.ndarray:
    """PQ signal, 0 to 1, of luminance, the inverse EOTF (BT.2100-2, table 4).

    luminance : any shape, cd/m²; below 0 it is taken for 0, above 10,000 for 10,000
    returns : the same shape, float64
    """
    share = np.clip(np.asarray(luminance, np.float64), 0, PQ_PEAK) / PQ_PEAK
    power = share**_M1
    return ((_C1 + _C2 * power) / (1 + _C3 * power)) ** _M2


def encode_hlg(scene: np.ndarray | float) -> np.ndarray:
    """HLG signal, 0 to 1, of linear scene light, 0 to 1, the OETF (BT.2100-2, table 5); clipped to both ends."""
    light = np.clip(np.asarray(scene, np.float64), 0, 1)
    # The logarithm is of no dark value: those are on the other piece.
    return np.where(light <= 1 / 12, np.sqrt(3 * light), _A * np.log(np.maximum(12 * light, 1) - _B) + _C)


def hlg_gamma(peak: float) -> float:
    """The exponent of HLG's OOTF on a screen of that peak, 1.2 at 1000 cd/m² (BT.2100-2, table 5, note 5f).

    Raises ValueError beyond 400 to 2000 cd/m², for which the formula is meant.
    """
    if not 400 <= peak <= 2000:
        raise ValueError(f"the peak is {peak} cd/m²; HLG's system gamma is defined for 400 to 2000: give one of these")
    return float(1.2 + 0.42 * np.log10(peak / 1000))


def hlg_scene(displayed: np.ndarray, peak: float = 1000.0) -> np.ndarray:
    """The scene light that a screen shows so, the inverse of the OOTF, α·Y^(γ−1)·E; nothing is clipped at the top.

    displayed : (..., 3) linear, BT.2020, cd/m²; below 0 it is taken for 0
    returns : (..., 3) float64; above 1 where the screen cannot show it
    """
    share = np.maximum(np.asarray(displayed, np.float64), 0) / peak
    light = (share @ BT2020_WEIGHTS)[..., None]
    gamma = hlg_gamma(peak)
    # Black has no colour: its power would be infinite.
    return share * np.where(light > 0, light, 1) ** ((1 - gamma) / gamma)
