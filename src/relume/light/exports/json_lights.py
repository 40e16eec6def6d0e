"""A constellation as JSON: all its numbers, in our own frame, for whoever writes a reader of their own."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from relume.light.constellation import Constellation
from relume.light.exports.lamps import FRAME, beside, bulbs, figure, lamps, meaning
from relume.light.placing import PlacedLights


def text(
    lights: Constellation,
    *,
    unit: str,
    background: str | None = None,
    angles: np.ndarray | None = None,
    points: PlacedLights | None = None,
) -> str:
    """The lights as a JSON text.

    unit : the map's, "relative" or "cd/m²"
    background : the file with the light that the lights do not carry, relative to the file written; None for none
    angles : (N,), apparent diameters in radians; left out of the text where None
    points : lights that have a place, under "points"; the key is left out where None

    Raises ValueError for another unit, an absolute path or angles that do not fit.
    """
    written: dict[str, Any] = {
        "format": "relume constellation 1",
        "meaning": f"Parallel lights. {meaning(unit, points)} Angles are apparent diameters in radians.",
        "frame": FRAME,
        "unit": unit,
        "background": beside(background),
        "background_frame": "lat-long: the top row is +Y, the centre -Z and +X to its right",
        "lights": [],
    }
    for lamp in lamps(lights, angles):
        light: dict[str, Any] = {
            "direction": [float(figure(part)) for part in lamp.direction],
            "irradiance": [float(figure(part)) for part in lamp.irradiance],
        }
        if angles is not None:
            light["angle"] = float(figure(lamp.angle))
        written["lights"].append(light)
    if points is not None:
        written["points"] = [
            {
                "position": [float(figure(part)) for part in bulb.position],
                "intensity": [float(figure(part)) for part in bulb.intensity],
                **({} if points.radii is None else {"radius": float(figure(bulb.radius))}),
            }
            for bulb in bulbs(points)
        ]
    return json.dumps(written, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
