"""Which view of the ball gave what of the light, as numbers and as a map in the views' colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import relume as rl

COLOURS = ("f0a132", "4f9dff", "6fcf6a", "d871c8", "e8e05a", "58cfc9")
"""Of the views, sRGB; a seventh has the first's again. The page's own are the same (studio.css)."""
ROWS = 256
DARKEST = 0.15
"""How bright in the map's picture what is black is drawn, for its colour to be seen."""


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
