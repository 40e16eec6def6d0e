"""Colour arithmetic on scene-linear Rec. 709 pixels: the sRGB transfer curve and relative luminance (IEC 61966-2-1).

The curve is the standard's two-piece one, not a plain 2.2 power: an approximation errs by up to 3 % in the shadows.
"""

from __future__ import annotations

import numpy as np

# IEC 61966-2-1; ITU-R BT.709-6, item 3.3: the middle row of RGB → XYZ for these primaries and D65
LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


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
    """
    rgb = np.asarray(rgb)
    if rgb.ndim == 0 or rgb.shape[-1] != 3:
        raise ValueError(f"rgb is {rgb.shape}; expected (..., 3): give linear R, G and B in the last axis")
    return rgb @ LUMINANCE_WEIGHTS.astype(np.result_type(rgb, np.float32))


def triple(values: np.ndarray) -> tuple[float, float, float]:
    """Red, green and blue of an array (3,) as plain floats."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue
