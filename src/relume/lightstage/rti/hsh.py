"""Hemispherical harmonics: a pixel's value as a smooth function of the light's direction over the hemisphere.

The functions are spherical harmonics whose polar angle is stretched from the hemisphere to the sphere (Gautron et al.
2004): Legendre functions of 2 cos θ − 1, orthonormal over the hemisphere, without the Condon–Shortley sign, θ from the
camera's direction and φ from x towards y in the RTI frame (x right, y up, z towards the camera). Their order and signs
are RTIViewer's: 1; cos φ, –, sin φ of degree 1; and so on to degree 3. Values are display code values, 1 the code 255.

A .rti is "#HSH1.2", "3", "width height 3", "terms 2 1", each a line that ends in CR LF, as the first fitter wrote it;
then a scale and a bias a term, float32 little-endian, and from the picture's upper row down, every pixel's terms of
red, of green and of blue, a byte each: a coefficient is byte / 255 · scale + bias (RTIViewer's and RelightLab's
readers).
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.image.files import replacing
from relume.lightstage.rti.hemisphere_fit import STEADINESS, least_squares
from relume.sphere.directions import normalised

DEGREES = (1, 2, 3)
"""With 4, 9 and 16 terms."""


@dataclass(frozen=True, eq=False)
class HemisphericalHarmonics:
    """A picture whose pixels are hemispherical harmonics.

    coefficients : (H, W, 3, T) float32, T = 4, 9 or 16
    """

    coefficients: np.ndarray

    @property
    def degree(self) -> int:
        """1, 2 or 3."""
        return round(self.coefficients.shape[3] ** 0.5) - 1

    def lit_from(self, direction: ArrayLike) -> np.ndarray:
        """Display code values (H, W, 3) float32, nominally 0 to 1 and not cut off, under a light from (3,)."""
        terms = hemispherical_terms(normalised(direction), self.degree)
        return self.coefficients @ terms.astype(np.float32)


def hemispherical_terms(directions: np.ndarray, degree: int) -> np.ndarray:
    """The harmonics of unit directions (…, 3) of the RTI frame: (…, (degree + 1)²), in the files' order."""
    cosine = np.clip(directions[..., 2], 0, 1)
    x, ring = 2 * cosine - 1, 2 * np.sqrt(cosine - cosine**2)  # cosine and sine of the stretched angle
    phi = np.arctan2(directions[..., 1], directions[..., 0])
    # Legendre functions P_lm(x) without sign, times √((2l + 1)/(2π) (l − m)!/(l + m)!), and √2 where m > 0.
    legendre = {
        (0, 0): np.sqrt(1 / (2 * np.pi)) * np.ones_like(x),
        (1, 0): np.sqrt(3 / (2 * np.pi)) * x,
        (1, 1): np.sqrt(3 / (2 * np.pi)) * ring,
        (2, 0): np.sqrt(5 / (2 * np.pi)) * (3 * x**2 - 1) / 2,
        (2, 1): np.sqrt(15 / (2 * np.pi)) * x * ring,
        (2, 2): np.sqrt(15 / (8 * np.pi)) * ring**2,
        (3, 0): np.sqrt(7 / (2 * np.pi)) * (5 * x**3 - 3 * x) / 2,
        (3, 1): np.sqrt(21 / (16 * np.pi)) * (5 * x**2 - 1) * ring,
        (3, 2): np.sqrt(105 / (8 * np.pi)) * x * ring**2,
        (3, 3): np.sqrt(35 / (16 * np.pi)) * ring**3,
    }
    # RTIViewer writes cos²θ − cos θ where the square of the ring is meant, so that terms of m = 2 have a minus.
    terms = []
    for l in range(degree + 1):  # noqa: E741
        cosines = [(-1 if m == 2 else 1) * legendre[l, m] * np.cos(m * phi) for m in range(l, 0, -1)]
        sines = [(-1 if m == 2 else 1) * legendre[l, m] * np.sin(m * phi) for m in range(1, l + 1)]
        terms += [*cosines, legendre[l, 0], *sines]
    return np.stack(terms, axis=-1)


def fit_hsh(
    pictures: np.ndarray,
    directions: np.ndarray,
    degree: int = 2,
    weights: np.ndarray | None = None,
    *,
    steadiness: float = STEADINESS,
) -> HemisphericalHarmonics:
    """The harmonics that are nearest to pictures (N, H, W, 3), by least squares.

    directions : (N, 3) unit, RTI frame
    degree : 2 unless given, nine terms, which most viewers read fastest; 3 holds sharper highlights
    weights, steadiness : as of `least_squares`
    Raises ValueError for fewer lights than terms.
    """
    terms = hemispherical_terms(normalised(directions), degree)
    solve = least_squares(terms, weights, steadiness, f"hemispherical harmonics of degree {degree}")
    return HemisphericalHarmonics(np.einsum("tn,nhwc->hwct", solve, pictures).astype(np.float32))


def write_hsh(path: str | os.PathLike[str], harmonics: HemisphericalHarmonics) -> None:
    """Write a .rti, whole or not at all; coefficients are rounded to 1/255 of each term's range, nothing is cut off.

    Raises ValueError for coefficients that are not finite, OutputNotWritten.
    """
    values = harmonics.coefficients.astype(np.float64)
    if not np.all(np.isfinite(values)):
        raise ValueError("a coefficient of the harmonics is not finite; mask out the pixels it comes from")
    bias = values.min(axis=(0, 1, 2)).astype("<f4")
    scale = (values.max(axis=(0, 1, 2)) - bias).astype("<f4")
    codes = np.clip(np.rint((values - bias) / np.where(scale > 0, scale, 1) * 255), 0, 255).astype(np.uint8)
    height, width, _, terms = values.shape
    header = f"#HSH1.2\r\n3\r\n{width} {height} 3\r\n{terms} 2 1\r\n"
    # A term that is the same everywhere has scale 0, by which some readers divide.
    written = np.where(scale > 0, scale, np.float32(1)).astype("<f4")
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + written.tobytes() + bias.tobytes() + codes.tobytes())
