"""Hemispherical harmonics: a pixel's value as a smooth function of the light's direction over the hemisphere.

The functions are spherical harmonics whose polar angle is stretched from the hemisphere to the sphere (Gautron et al.
2004): Legendre functions of 2 cos θ − 1, orthonormal over the hemisphere, without the Condon–Shortley sign, θ from the
camera's direction and φ from x towards y in the RTI frame (x right, y up, z towards the camera). Their order and signs
are RTIViewer's: 1; cos φ, –, sin φ of degree 1; and so on to degree 3. Values are display code values, 1 the code 255.
`hsh_file` reads and writes them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.lightstage.rti.hemisphere_fit import STEADINESS, checked_pictures, in_hemisphere, least_squares

DEGREES = (1, 2, 3)
"""With 4, 9 and 16 terms."""


@dataclass(frozen=True, eq=False)
class HemisphericalHarmonics:
    """A picture whose pixels are hemispherical harmonics.

    coefficients : (H, W, 3, T) float32, T = 4, 9 or 16
    """

    coefficients: np.ndarray

    def __post_init__(self) -> None:
        shape = self.coefficients.shape
        if len(shape) != 4 or shape[2] != 3 or shape[3] not in [(l + 1) ** 2 for l in DEGREES] or 0 in shape:  # noqa: E741
            raise ValueError(f"coefficients are {shape}; expected (H, W, 3, T) with T of 4, 9 or 16")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.coefficients.shape[0], self.coefficients.shape[1]

    @property
    def degree(self) -> int:
        """1, 2 or 3."""
        return round(self.coefficients.shape[3] ** 0.5) - 1

    def lit_from(self, direction: ArrayLike) -> np.ndarray:
        """Display code values (H, W, 3) float32, nominally 0 to 1 and not cut off, under a light from (3,).

        Raises ValueError for a light from behind.
        """
        terms = hemispherical_terms(in_hemisphere(np.asarray(direction, np.float64).reshape(3)), self.degree)
        return self.coefficients @ terms.astype(np.float32)


def hemispherical_terms(directions: np.ndarray, degree: int) -> np.ndarray:
    """The harmonics of unit directions (…, 3) of the RTI frame: (…, (degree + 1)²), in the files' order."""
    if degree not in DEGREES:
        raise ValueError(f"hemispherical harmonics of degree {degree}; files hold 1, 2 or 3")
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
    """The harmonics that are nearest to pictures, by least squares.

    pictures : (N, H, W, 3), display code values, 1 the highest
    directions : (N, 3) unit, RTI frame
    degree : 2 unless given, nine terms, which most viewers read fastest; 3 holds sharper highlights
    weights : (N,) of the pictures' errors; all alike unless given
    steadiness : the cost of large coefficients, see `hemisphere_fit.STEADINESS`; 0 is plain least squares
    Raises ValueError for fewer lights than terms, or lights that do not determine them.
    """
    checked_pictures(pictures, directions)
    terms = hemispherical_terms(in_hemisphere(directions), degree)
    solve = least_squares(terms, weights, steadiness, f"hemispherical harmonics of degree {degree}")
    return HemisphericalHarmonics(np.einsum("tn,nhwc->hwct", solve, pictures).astype(np.float32))
