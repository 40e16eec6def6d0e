"""Nine spherical harmonics of a light as a document: enough to light a matte surface, as an engine wants it.

The real basis functions up to l = 2 are polynomials of the world's x, y, z (Ramamoorthi & Hanrahan, "An Efficient
Representation for Irradiance Environment Maps", 2001), so the polar axis is our +Z, towards a camera that looks along
−Z; the frame, right-handed with +Y up, is not turned. Order of rows: (l, m) = (0, 0), (1, −1), (1, 0), (1, 1), (2, −2),
(2, −1), (2, 0), (2, 1), (2, 2).
"""

from __future__ import annotations

import json

import numpy as np

from relume.light.harmonics.spherical_harmonics import cosine_factors, project_sh
from relume.sphere.environment_map import EnvironmentMap

ORDER = ((0, 0), (1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2))
COSINE = np.repeat(cosine_factors(2), [1, 3, 5])
"""Â_l of every row: what max(0, cos θ) multiplies each harmonic by, π, 2π/3, π/4 (equation 8 there)."""

# The factor before every polynomial, so that the square of each integrates to 1 over the sphere.
_FACTORS = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))
_POLYNOMIALS = ("1", "y", "z", "x", "x*y", "y*z", "(3*z*z - 1)", "x*z", "(x*x - y*y)")


def irradiance_harmonics(light: EnvironmentMap) -> np.ndarray:
    """The coefficients L_lm = ∫ L Y_lm dω of the light's radiance, (9, 3), in its unit times steradians.

    Summed over the directions of the pixels' middles by their solid angles, as `EnvironmentMap.irradiance` does.
    """
    return project_sh(light, 2).coefficients


def as_json(coefficients: np.ndarray, unit: str) -> str:
    """A readable document of the coefficients (9, 3), with all that an engine's author needs to use them.

    unit : of the radiance they were made from, "relative" or "cd/m²" (irradiance is then in lux)

    Raises ValueError for another unit or shape.
    """
    if unit not in ("relative", "cd/m²"):
        raise ValueError(f'unit is "{unit}"; expected "relative" or "cd/m²"')
    radiance = _checked(coefficients)
    irradiance = COSINE[:, None] * radiance
    terms = [
        {
            "l": degree,
            "m": order,
            "polynomial": f"{_FACTORS[row]:.8f}" + (f" * {_POLYNOMIALS[row]}" if row else ""),
            "radiance": _rounded(radiance[row]),
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
            "radiance": "cd/m² · sr" if unit == "cd/m²" else "relative · sr",
            "irradiance": "lx" if unit == "cd/m²" else "relative · sr",
        },
        "terms": terms,
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _checked(coefficients: np.ndarray) -> np.ndarray:
    if np.shape(coefficients) != (9, 3):
        raise ValueError(f"coefficients have shape {np.shape(coefficients)}; expected (9, 3), as from a light")
    return np.asarray(coefficients, np.float64)


def _rounded(values: np.ndarray) -> list[float]:
    """Eight digits, beyond what a float32 map holds."""
    return [float(f"{value:.8g}") for value in values]
