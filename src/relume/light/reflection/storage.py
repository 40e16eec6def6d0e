"""Reflection maps as pictures and layers whose attributes say what they hold, ready for files, and back.

And nine spherical harmonics of a light as a document: enough to light a matte surface, as an engine wants it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from relume.image.radiance import RadianceMap
from relume.light.harmonics.spherical_harmonics import SphericalHarmonics, cosine_factors
from relume.light.reflection.brdf import GGX, PhongReflectance, Reflectance, Ward
from relume.light.reflection.glossy import GlossyMap
from relume.light.reflection.lobes import Cosine, Lobe
from relume.light.reflection.reflection_map import Normalisation, ReflectionMap
from relume.light.reflection.weights import Even

_BRDFS: dict[str, type[GGX] | type[Ward] | type[PhongReflectance]] = {c.name: c for c in (GGX, Ward, PhongReflectance)}
_ORDER = ((0, 0), (1, -1), (1, 0), (1, 1), (2, -2), (2, -1), (2, 0), (2, 1), (2, 2))
_COSINE = np.repeat(cosine_factors(2), [1, 3, 5])
"""Â_l of every row: what max(0, cos θ) multiplies each harmonic by (Ramamoorthi & Hanrahan 2001, eq. 8)."""

# The factor before every polynomial, so that the square of each integrates to 1 over the sphere.
_FACTORS = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))
_POLYNOMIALS = ("1", "y", "z", "x", "x*y", "y*z", "(3*z*z - 1)", "x*z", "(x*x - y*y)")


def as_picture(table: ReflectionMap) -> RadianceMap:
    """A table as a radiance map whose attributes say its lobe, normalisation, error bound and unit.

    Sums that nothing divides are no radiance: their unit, with sr in it, is in the attribute alone.
    """
    summed = table.normalisation is Normalisation.SUM
    attributes = {
        "mapping": table.light.mapping.name,
        "lobe": table.lobe.name,
        **_parameters(table.lobe),
        "normalisation": table.normalisation.value,
        "error_bound": repr(table.error_bound),
        "unit": f"{table.light.unit}·sr" if summed else table.light.unit,
    }
    return RadianceMap(table.table, unit="relative" if summed else table.light.unit, attributes=attributes)


def as_layers(table: GlossyMap) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """A three-dimensional map as layers (rows, 2·rows, 3) and attributes, for `files.write_layers`.

    A layer is one view angle and one Fourier component about the lobe's middle: view_07_k0, view_07_k1_cos,
    view_07_k1_sin, … Angles among the attributes are radians.

    Raises ValueError for facets with a Fresnel reflectance of their own, which attributes do not hold.
    """
    if getattr(table.brdf, "fresnel", Even(1.0)) != Even(1.0):
        raise ValueError("the facets have a Fresnel reflectance, which the file would lose; make the map without it")
    views, components = table.tables.shape[0], table.tables.shape[3]
    layers = {
        name: table.tables[view, :, :, component]
        for view in range(views)
        for component, name in enumerate(_names(view, components))
    }
    attributes = {
        "mapping": "latlong",
        "brdf": table.brdf.name,
        **_parameters(table.brdf),
        "normalisation": Normalisation.RADIOMETRIC.value,
        "unit": table.unit,
        "view_angles": _written(np.linspace(0, np.pi / 2, views)),
        "tilts": _written(table.tilts),
        "albedos": _written(table.albedos),
        "components": str(components),
    }
    return layers, attributes


def glossy_from_layers(layers: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> GlossyMap:
    """The three-dimensional map that a file keeps as layers, from `read_layers` and `read_radiance(…).attributes`.

    layers : by name, as `read_layers` gives them
    attributes : the file's text
    Raises ValueError where an attribute or a layer is missing or wrong.
    """
    try:
        tilts, albedos = (np.array([float(w) for w in attributes[key].split()]) for key in ("tilts", "albedos"))
        kind = _BRDFS[attributes["brdf"]]
        brdf = kind(float(attributes["n" if kind is PhongReflectance else "alpha"]))
        unit, components = attributes["unit"], int(attributes["components"])
        tables = np.stack(
            [np.stack([layers[name] for name in _names(v, components)], axis=2) for v in range(len(tilts))]
        )
    except KeyError as error:
        raise ValueError(
            f"no {error} among the layers and attributes; give all of a file that `relume reflect --brdf` wrote"
        ) from None
    if len(albedos) != len(tilts) or len(tilts) < 2 or components % 2 != 1:
        raise ValueError(
            f"{len(tilts)} tilts, {len(albedos)} albedos and {components} components; "
            "expected as many of both, at least 2, and an odd number"
        )
    return GlossyMap(np.ascontiguousarray(tables, np.float32), tilts, albedos, brdf, unit)


def as_json(light: SphericalHarmonics) -> str:
    """A readable document of harmonics of degree 2, with all that an engine's author needs to use them.

    The real basis functions up to l = 2 are polynomials of the world's x, y, z (Ramamoorthi & Hanrahan, "An Efficient
    Representation for Irradiance Environment Maps", 2001), so the polar axis is our +Z, towards a camera that looks
    along −Z; the frame, right-handed with +Y up, is not turned.

    Irradiance is in lux where the unit is cd/m². Raises ValueError for another unit or degree.
    """
    if light.unit not in ("relative", "cd/m²"):
        raise ValueError(f'unit is "{light.unit}"; expected "relative" or "cd/m²"')
    if light.degree != 2:
        raise ValueError(f"harmonics of degree {light.degree}; expected 2, nine coefficients")
    irradiance = _COSINE[:, None] * light.coefficients
    terms = [
        {
            "l": degree,
            "m": order,
            "polynomial": f"{_FACTORS[row]:.8f}" + (f" * {_POLYNOMIALS[row]}" if row else ""),
            "radiance": _rounded(light.coefficients[row]),
            "irradiance": _rounded(irradiance[row]),
        }
        for row, (degree, order) in enumerate(_ORDER)
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


def _names(view: int, components: int) -> list[str]:
    phases = [f"k{k}_{phase}" for k in range(1, components // 2 + 1) for phase in ("cos", "sin")]
    return [f"view_{view:02d}_{name}" for name in ("k0", *phases)]


def _parameters(reflectance: Lobe | Reflectance) -> dict[str, str]:
    """The numbers of a lobe or BRDF, those that attributes can hold."""
    fields = {"k": reflectance.k} if isinstance(reflectance, Cosine) else asdict(reflectance)
    return {name: repr(float(value)) for name, value in fields.items() if isinstance(value, int | float)}


def _written(numbers: np.ndarray) -> str:
    """Every digit, so that reading gives the same numbers."""
    return " ".join(repr(float(number)) for number in numbers)


def _rounded(values: np.ndarray) -> list[float]:
    """Eight digits, beyond what a float32 map holds."""
    return [float(f"{value:.8g}") for value in values]
