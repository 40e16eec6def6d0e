"""The recovered local scene as arrays, so that it can be kept between runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from relume.project.stages import Arrays
from relume.scene.materials.checks import triple
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Shape
from relume.surface.gloss import FittedGloss, Gloss, glossy
from relume.surface.reflectance import RecoveredLocal, RecoveredSurface


def local_arrays(found: RecoveredLocal) -> Arrays:
    """For keeping; the albedo of all surfaces is one image and is kept once."""
    arrays: Arrays = {"albedo": found.albedo, "without": found.without, "irradiance": found.irradiance}
    told: list[dict[str, Any]] = []
    for index, surface in enumerate(found.surfaces):
        told.append(
            {
                "reflectance": surface.reflectance, "measured": surface.measured, "spread": surface.spread,
                "pixels": surface.pixels, "gloss": None if surface.gloss is None else asdict(surface.gloss),
                "fitted": None if surface.fitted is None else asdict(surface.fitted),
                "varies": [_varies(shape) for shape in surface.shapes] if surface.reflectance is not None else None,
                "even": [_even(shape) for shape in surface.shapes] if surface.reflectance is not None else None,
            }
        )  # fmt: skip
        if surface.reflectance is None:
            continue
        for number, shape in enumerate(surface.shapes):
            assert isinstance(shape, Mesh)  # what is recovered is projected triangles
            arrays |= {f"{index}.{number}.vertices": shape.vertices, f"{index}.{number}.faces": shape.faces}
            for name in ("normals", "uv"):
                if (plane := getattr(shape, name)) is not None:
                    arrays[f"{index}.{number}.{name}"] = plane
    whole = {"surfaces": told, "iterations": found.iterations, "change": found.change, "notes": found.notes}
    return arrays | {"told": np.array(json.dumps(whole))}


def local_from(arrays: Arrays, bare: Sequence[Shape]) -> RecoveredLocal:
    """The inverse of `local_arrays`.

    bare : the surfaces as the shot gives them, for those whose material is given
    """
    told = json.loads(str(arrays["told"]))
    albedo = arrays["albedo"]
    surfaces = []
    for index, (table, shape) in enumerate(zip(told["surfaces"], bare, strict=True)):
        gloss = None if table["gloss"] is None else Gloss(**table["gloss"])
        fitted = table["fitted"]
        if fitted is not None:
            fitted = FittedGloss(**fitted | {"gloss": Gloss(**fitted["gloss"]), "notes": tuple(fitted["notes"])})
        shapes: tuple[Shape, ...] = (shape,)
        if table["reflectance"] is not None:
            shapes = tuple(
                _mesh(arrays, f"{index}.{number}", albedo if varies else tuple(even), gloss)
                for number, (varies, even) in enumerate(zip(table["varies"], table["even"], strict=True))
            )
        reflectance, measured, spread = (
            None if table[name] is None else triple(table[name]) for name in ("reflectance", "measured", "spread")
        )
        surfaces.append(RecoveredSurface(reflectance, measured, spread, table["pixels"], gloss, fitted, shapes))
    return RecoveredLocal(
        tuple(surfaces), albedo, arrays["without"], arrays["irradiance"], told["iterations"], told["change"],
        tuple(told["notes"]),
    )  # fmt: skip


def _mesh(arrays: Arrays, name: str, reflectance: Any, gloss: Gloss | None) -> Mesh:
    material = Diffuse(reflectance) if gloss is None else glossy(reflectance, gloss)
    planes = (arrays.get(f"{name}.{plane}") for plane in ("normals", "uv"))
    return Mesh(arrays[f"{name}.vertices"], arrays[f"{name}.faces"], material, *planes, name="local surface")


def _colour(shape: Shape) -> Any:
    material: Any = shape.material
    return material.reflectance if isinstance(material, Diffuse) else material.base_color


def _varies(shape: Shape) -> bool:
    return np.ndim(_colour(shape)) > 1


def _even(shape: Shape) -> list[float]:
    return [] if _varies(shape) else [float(channel) for channel in _colour(shape)]
