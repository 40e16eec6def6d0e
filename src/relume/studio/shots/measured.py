"""What a job found of plate and light, for a page to draw: camera, light, surfaces, and which view gave what of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.shots.cameras import camera_facts

COLOURS = ("f0a132", "4f9dff", "6fcf6a", "d871c8", "e8e05a", "58cfc9")
"""Of the views, sRGB; a seventh has the first's again. The page's own are the same (studio.css)."""
ROWS = 256
DARKEST = 0.15
"""How bright in the map's picture what is black is drawn, for its colour to be seen."""


def measured_facts(table: rl.Shot, result: Any, camera: rl.Camera, step: int, scratch: Path) -> dict[str, Any]:
    """What a page draws over the plate: camera, points it was fitted to, light; the light as a file beside."""
    probe = result.calibrated.probe
    scratch.mkdir(parents=True, exist_ok=True)  # what cleans temporary folders may have taken it since
    rl.write(scratch / "light.exr", rl.as_radiance_map(probe.light))
    fit, place = result.place.fit, result.place
    return {
        "camera": camera_facts(camera),
        "points": (step * fit.points).round(2).tolist(),
        "offsets": (step * fit.offsets).round(3).tolist(),
        "agreement": replace(fit, points=step * fit.points, offsets=step * fit.offsets).agreement,
        "light": "light.exr",
        "views": view_facts(probe, scratch / "views.exr"),
        "probe": [float(each) for each in place.bare.probe],
        "irradiance": irradiance_facts(probe.light),
        "lamp": lamp_direction(probe.light),
        "unit": result.plate.unit,
        "surfaces": surface_facts(table, place.recovered),
        "seconds": {name: round(each, 2) for name, each in result.seconds.items()},
        "kept": list(result.kept),
    }


def irradiance_facts(light: rl.EnvironmentMap) -> list[list[float]]:
    """E(n) as coefficients (9, 3) of 1, x, y, z, xy, yz, zx, x² − y² and 3z² − 1 of a unit normal, fitted.

    What is left out of matte shading is about a hundredth (Ramamoorthi & Hanrahan 2001).
    """
    coarse = light.remapped(rl.mappings.LatLong(), 64)
    normals = rl.mappings.pixel_directions(rl.mappings.LatLong(), 8).reshape(-1, 3)
    x, y, z = normals.T
    basis = np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], axis=1)
    return np.linalg.lstsq(basis, coarse.irradiance(normals), rcond=None)[0].tolist()


def lamp_direction(light: rl.EnvironmentMap) -> list[float]:
    """The unit vector towards what throws the sharpest shadows: ∫ L² ω dω, so that a lamp counts more than a window."""
    coarse = light.remapped(rl.mappings.LatLong(), 64)
    weights = coarse.radiance.sum(-1).astype(np.float64) ** 2 * coarse.mapping.solid_angles(64)
    directions = rl.mappings.pixel_directions(coarse.mapping, 64)
    above = np.where(directions[..., 1] > 0, weights, 0.0)
    found = (above[..., None] * directions).sum((0, 1)) + np.array([0.0, 1e-12, 0.0])
    return (found / np.linalg.norm(found)).tolist()


def surface_facts(shot: rl.Shot, recovered: Any) -> list[dict[str, Any]]:
    """Of each surface what was recovered, for JSON.

    recovered : the result's, None where nothing was
    given is the entry of [[local]] as the shot has it, of which a page sees whether it is still that one, and number
    its place there. spread is by how much the reflectance varies over the surface's pixels: half the distance between
    the 16th and the 84th percentile. The gloss has one standard deviation of each of its numbers.
    """
    if recovered is None:
        return []
    tables = [(number, table) for number, table in enumerate(shot.surfaces()) for _ in table.shapes(shot.folder)]
    found = []
    for (number, table), surface in zip(tables, recovered.surfaces, strict=True):
        fitted = surface.fitted
        found.append(
            {
                "number": number, "given": table.model_dump(mode="json", exclude_unset=True),
                "reflectance": _listed(surface.reflectance), "spread": _listed(surface.spread),
                "measured": _listed(surface.measured), "pixels": surface.pixels,
                "gloss": None if surface.gloss is None else {
                    "f0": surface.gloss.f0, "roughness": surface.gloss.roughness, "found": None if fitted is None else {
                        "f0_error": fitted.f0_error, "roughness_error": fitted.roughness_error, "points": fitted.points,
                        "views": fitted.views, "notes": list(fitted.notes),
                    },
                },
            }
        )  # fmt: skip
    return found


def _listed(colour: tuple[float, float, float] | None) -> list[float] | None:
    return None if colour is None else [float(each) for each in colour]


def view_facts(probe: rl.probe.Probe, target: Path) -> list[dict[str, float]]:
    """Of each view its share of all directions and of the light, for JSON; writes the map in the views' colours.

    target : .exr, lat-long: as bright as the light, by its tone; what no view saw is black. Written for several views
    """
    shares = probe.shares
    if shares is None or len(shares) < 2:
        return []
    mapping = rl.mappings.LatLong()
    rows = shares.shape[1]
    areas = mapping.solid_angles(rows)
    coarse = _luminance(probe.light.remapped(mapping, rows).radiance) * areas
    step = max(1, ROWS // rows)
    finer = _luminance(probe.light.remapped(mapping, step * rows).radiance)
    bright = finer / (finer + max(float(np.median(finer)), 1e-12))
    mixed = sum(
        share.repeat(step, 0).repeat(step, 1)[..., None] * _linear(COLOURS[i % len(COLOURS)])
        for i, share in enumerate(shares)
    )
    pixels = ((DARKEST + (1 - DARKEST) * bright)[..., None] * mixed).astype(np.float32)
    rl.write(target, rl.as_radiance_map(rl.EnvironmentMap(pixels)))
    return [
        {
            "directions": float((share * areas).sum() / (4 * np.pi)),
            "light": float((share * coarse).sum() / max(float(coarse.sum()), 1e-30)),
        }
        for share in shares
    ]


def _luminance(radiance: np.ndarray) -> np.ndarray:
    return radiance.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def _linear(colour: str) -> np.ndarray:
    """Linear red, green and blue of a colour as pages write it."""
    codes = np.array([int(colour[i : i + 2], 16) for i in (0, 2, 4)]) / 255
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
