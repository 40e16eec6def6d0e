"""Polynomial texture maps: a pixel's value as a polynomial of the light's direction (Malzbender et al. 2001, eq. 1).

L(lu, lv) = a0 lu² + a1 lv² + a2 lu lv + a3 lu + a4 lv + a5, where lu, lv are x and y of the unit direction to the
light in the RTI frame: x right, y up, z towards the camera. Values are what viewers show, in display code values: 1 is
the code 255, and viewers neither decode nor encode. The RGB form has a polynomial a channel; LRGB has one for all,
which a colour is multiplied with, and is half as large. `ptm_file` reads and writes them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.lightstage.rti.hemisphere_fit import STEADINESS, checked_pictures, in_hemisphere, least_squares


@dataclass(frozen=True, eq=False)
class PolynomialTexture:
    """A polynomial texture map.

    coefficients : (H, W, 3, 6) float32, a0 … a5 of red, green and blue; (H, W, 1, 6), of all, where there is a colour
    colour : (H, W, 3) float32 in [0, 1], what the polynomial is multiplied with; None for the RGB form
    """

    coefficients: np.ndarray
    colour: np.ndarray | None = None

    def __post_init__(self) -> None:
        shape, channels = self.coefficients.shape, 3 if self.colour is None else 1
        if len(shape) != 4 or shape[2:] != (channels, 6) or 0 in shape:
            raise ValueError(f"coefficients are {shape}; expected (H, W, {channels}, 6)")
        if self.colour is not None and self.colour.shape != (*shape[:2], 3):
            raise ValueError(f"colour is {self.colour.shape}; expected {(*shape[:2], 3)}")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.coefficients.shape[0], self.coefficients.shape[1]

    def lit_from(self, direction: ArrayLike) -> np.ndarray:
        """Display code values (H, W, 3) float32, nominally 0 to 1 and not cut off, under a light from (3,).

        Raises ValueError for a light from behind.
        """
        terms = polynomial_terms(in_hemisphere(np.asarray(direction, np.float64).reshape(3)))
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
    """The polynomials of three channels that are nearest to pictures, by least squares.

    pictures : (N, H, W, 3), display code values, 1 the highest
    directions : (N, 3) unit, RTI frame
    weights : (N,) of the pictures' errors; all alike unless given
    steadiness : the cost of large coefficients, see `hemisphere_fit.STEADINESS`; 0 is the paper's plain least squares
    Raises ValueError for fewer than six lights, or lights that do not determine the polynomial.
    """
    solve = _solution(pictures, directions, weights, steadiness)
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
    solve = _solution(pictures, directions, weights, steadiness)
    mean = pictures.mean(axis=0, dtype=np.float64)
    strongest = mean.max(axis=-1, keepdims=True)
    # A pixel that is black in all pictures has no colour of its own.
    colour = np.where(strongest > 0, mean / np.where(strongest > 0, strongest, 1), 1.0)
    brightness = np.einsum("nhwc,hwc->nhw", pictures, colour / np.square(colour).sum(axis=-1, keepdims=True))
    coefficients = np.einsum("tn,nhw->hwt", solve, brightness)[:, :, None]
    return PolynomialTexture(coefficients.astype(np.float32), colour.astype(np.float32))


def _solution(
    pictures: np.ndarray, directions: np.ndarray, weights: np.ndarray | None, steadiness: float
) -> np.ndarray:
    checked_pictures(pictures, directions)
    return least_squares(polynomial_terms(in_hemisphere(directions)), weights, steadiness, "a polynomial texture map")
