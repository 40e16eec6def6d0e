"""Nine spherical harmonics of a light as a document: enough to light a matte surface, as an engine wants it.

The real basis functions up to l = 2 are polynomials of the world's x, y, z (Ramamoorthi & Hanrahan, "An Efficient
Representation for Irradiance Environment Maps", 2001), so the polar axis is our +Z, towards a camera that looks along
−Z; the frame, right-handed with +Y up, is not turned. Order of rows: (l, m) = (0, 0), (1, −1), (1, 0), (1, 1), (2, −2),
(2, −1), (2, 0), (2, 1), (2, 2).
"""

from __future__ import annotations

import json

import numpy as np

from relume.light.harmonics.spherical_harmonics import SphericalHarmonics, cosine_factors

ORDER = ((0, 0), (1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2))
COSINE = np.repeat(cosine_factors(2), [1, 3, 5])
"""Â_l of every row: what max(0, cos θ) multiplies each harmonic by, π, 2π/3, π/4 (equation 8 there)."""

# The factor before every polynomial, so that the square of each integrates to 1 over the sphere.
_FACTORS = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))
_POLYNOMIALS = ("1", "y", "z", "x", "x*y", "y*z", "(3*z*z - 1)", "x*z", "(x*x - y*y)")


def as_json(light: SphericalHarmonics) -> str:
    """A readable document of harmonics of degree 2, with all that an engine's author needs to use them.

    Irradiance is in lux where the unit is cd/m². Raises ValueError for another unit or degree.
    """
    if light.unit not in ("relative", "cd/m²"):
        raise ValueError(f'unit is "{light.unit}"; expected "relative" or "cd/m²"')
    if light.degree != 2:
        raise ValueError(f"harmonics of degree {light.degree}; expected 2, nine coefficients")
    irradiance = COSINE[:, None] * light.coefficients
    terms = [
        {
            "l": degree,
            "m": order,
            "polynomial": f"{_FACTORS[row]:.8f}" + (f" * {_POLYNOMIALS[row]}" if row else ""),
            "radiance": _rounded(light.coefficients[row]),
            "irradiance": _rounded(irradiance[row]),
        }
        for row, (degree, order) in enumerate(ORDER)
    ]
    document = {
        "format": "relume spherical harmonics 1",
        "frame": "x, y, z is a unit direction of the world: right-handed, +Y up, the middle of a lat-long map is -Z, "
        "+X lies to its right; directions point towards the light, normals away from the surface",
        "basis": "real, orthonormal over the sphere, no Condon-Shortley sign, polar axis +Z (Ramamoorthi & Hanrahan "
        "2001): the polynomials below are whole",
        "colour": "linear red, green, blue; Rec. 709 primaries, D65",
        "radiance": "L_lm, the integral of radiance times polynomial over all directions; "
        "radiance(direction) is about the sum of radiance * polynomial(direction)",
        "irradiance": "A_l L_lm with A_0 = pi, A_1 = 2 pi / 3, A_2 = pi / 4; irradiance(normal) is the sum of "
        "irradiance * polynomial(normal); a matte surface reflects albedo / pi times that",
        "unit": {
            "radiance": "cd/m² · sr" if light.unit == "cd/m²" else "relative · sr",
            "irradiance": "lx" if light.unit == "cd/m²" else "relative · sr",
        },
        "terms": terms,
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _rounded(values: np.ndarray) -> list[float]:
    """Eight digits, beyond what a float32 map holds."""
    return [float(f"{value:.8g}") for value in values]
