"""Reflection maps as pictures and layers whose attributes say what they hold, ready for files, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from relume.image.radiance import RadianceMap
from relume.light.reflection.brdf import GGX, PhongReflectance, Reflectance, Ward
from relume.light.reflection.glossy import GlossyMap
from relume.light.reflection.lobes import Cosine, Lobe
from relume.light.reflection.reflection_map import Normalisation, ReflectionMap
from relume.light.reflection.weights import Even

_BRDFS: dict[str, type[GGX] | type[Ward] | type[PhongReflectance]] = {c.name: c for c in (GGX, Ward, PhongReflectance)}


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
    """The three-dimensional map that `as_layers` took apart, from `read_layers` and `read_radiance(…).attributes`.

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
