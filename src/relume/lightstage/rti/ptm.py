"""Polynomial texture maps: a pixel's value as a polynomial of the light's direction (Malzbender et al. 2001, eq. 1).

L(lu, lv) = a0 lu² + a1 lv² + a2 lu lv + a3 lu + a4 lv + a5, where lu, lv are x and y of the unit direction to the
light in the RTI frame: x right, y up, z towards the camera. Values are what viewers show, in display code values: 1 is
the code 255, and viewers neither decode nor encode. The RGB form has a polynomial a channel; LRGB has one for all,
which a colour is multiplied with, and is half as large.

A .ptm, as RTIViewer, RelightLab and OpenLIME read it, is a text of six lines, PTM_1.2, PTM_FORMAT_RGB or
PTM_FORMAT_LRGB, width, height, six scales, six biases (whole numbers), then bytes, from the lowest row of the picture
to the highest: a coefficient is (byte − bias) · scale, in units of code values. RGB: a plane of red with six bytes a
pixel, one of green, one of blue. LRGB: a plane of six bytes a pixel, then a plane of red, green and blue. The layout is
that of the format's specification (PtmFormat12, Hewlett-Packard 2001).
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.image.files import replacing
from relume.lightstage.rti.hemisphere_fit import STEADINESS, least_squares
from relume.sphere.directions import normalised

_NAME = "a polynomial texture map"


@dataclass(frozen=True, eq=False)
class PolynomialTexture:
    """A polynomial texture map.

    coefficients : (H, W, 3, 6) float32, a0 … a5 of red, green and blue; (H, W, 1, 6), of all, where there is a colour
    colour : (H, W, 3) float32 in [0, 1], what the polynomial is multiplied with; None for the RGB form
    """

    coefficients: np.ndarray
    colour: np.ndarray | None = None

    def lit_from(self, direction: ArrayLike) -> np.ndarray:
        """Display code values (H, W, 3) float32, nominally 0 to 1 and not cut off, under a light from (3,)."""
        terms = polynomial_terms(normalised(direction))
        value = self.coefficients @ terms.astype(np.float32)
        return value if self.colour is None else value * self.colour


def polynomial_terms(directions: np.ndarray) -> np.ndarray:
    """lu², lv², lu·lv, lu, lv, 1 of unit directions (…, 3) in the RTI frame: (…, 6)."""
    u, v = directions[..., 0], directions[..., 1]
    return np.stack([u * u, v * v, u * v, u, v, np.ones_like(u)], axis=-1)


def fit_rgb(
    pictures: np.ndarray,
    directions: np.ndarray,
    weights: np.ndarray | None = None,
    *,
    steadiness: float = STEADINESS,
) -> PolynomialTexture:
    """The polynomials of three channels that are nearest to pictures (N, H, W, 3), by least squares.

    directions : (N, 3) unit, RTI frame
    weights, steadiness : as of `least_squares`; a steadiness of 0 is the paper's fit
    Raises ValueError for fewer than six lights.
    """
    solve = least_squares(polynomial_terms(normalised(directions)), weights, steadiness, _NAME)
    return PolynomialTexture(np.einsum("tn,nhwc->hwct", solve, pictures).astype(np.float32))


def fit_lrgb(
    pictures: np.ndarray,
    directions: np.ndarray,
    weights: np.ndarray | None = None,
    *,
    steadiness: float = STEADINESS,
) -> PolynomialTexture:
    """One polynomial for all channels, times the pixel's mean colour, whose strongest channel is 1.

    Each picture's brightness is that multiple of the colour which is nearest to it, so that grey shading of one colour
    comes back as it was; a highlight of another colour takes the pixel's. Arguments and errors as of `fit_rgb`.
    """
    solve = least_squares(polynomial_terms(normalised(directions)), weights, steadiness, _NAME)
    mean = pictures.mean(axis=0, dtype=np.float64)
    strongest = mean.max(axis=-1, keepdims=True)
    # A pixel that is black in all pictures has no colour of its own.
    colour = np.where(strongest > 0, mean / np.where(strongest > 0, strongest, 1), 1.0)
    brightness = np.einsum("nhwc,hwc->nhw", pictures, colour / np.square(colour).sum(axis=-1, keepdims=True))
    coefficients = np.einsum("tn,nhw->hwt", solve, brightness)[:, :, None]
    return PolynomialTexture(coefficients.astype(np.float32), colour.astype(np.float32))


def write_ptm(path: str | os.PathLike[str], texture: PolynomialTexture) -> None:
    """Write a .ptm of version 1.2, whole or not at all: RGB, or LRGB where the texture has a colour.

    Coefficients are rounded to 1/255 of the range that each of the six has over the picture; nothing is cut off.
    Raises ValueError for coefficients that are not finite, OutputNotWritten.
    """
    coefficients = texture.coefficients.astype(np.float64) * 255
    if not np.all(np.isfinite(coefficients)):
        raise ValueError("a coefficient of the polynomial texture map is not finite; mask out the pixels it comes from")
    scales, biases = zip(*(_quantised(coefficients[..., term]) for term in range(6)), strict=True)
    # The scales as the file holds them are those that the bytes are made with.
    scales = np.array([float(f"{scale:.7g}") for scale in scales])
    codes = np.clip(np.rint(coefficients / scales + np.array(biases)), 0, 255).astype(np.uint8)[::-1]
    height, width = codes.shape[:2]
    planes = [np.ascontiguousarray(codes[:, :, channel]) for channel in range(codes.shape[2])]
    if texture.colour is not None:
        planes.append(np.rint(np.clip(texture.colour[::-1], 0, 1) * 255).astype(np.uint8))
    form = "PTM_FORMAT_RGB" if texture.colour is None else "PTM_FORMAT_LRGB"
    lines = ["PTM_1.2", form, str(width), str(height), " ".join(f"{scale:.7g}" for scale in scales)]
    header = "\n".join([*lines, " ".join(str(bias) for bias in biases), ""])
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + b"".join(plane.tobytes() for plane in planes))


def _quantised(values: np.ndarray) -> tuple[float, int]:
    """The finest scale and the whole bias, 0 to 255, with which bytes reach all values."""
    lowest, highest = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    if highest == lowest:
        return 1.0, 0
    bias = round(255 * -lowest / (highest - lowest))
    # Where the range lies on one side of 0 for the most part, the bias still has to leave a step to the other.
    bias = min(max(bias, 1 if lowest < 0 else 0), 254 if highest > 0 else 255)
    return max(highest / (255 - bias) if bias < 255 else 0.0, -lowest / bias if bias else 0.0), bias
