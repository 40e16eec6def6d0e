"""A constellation as glTF: directional lights of the extension KHR_lights_punctual."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from relume.light.constellation import Constellation
from relume.light.exports.lamps import beside, figure, lamps, meaning

EXTENSION = "KHR_lights_punctual"


def text(lights: Constellation, *, unit: str, background: str | None = None, angles: np.ndarray | None = None) -> str:
    """The lights as a `.gltf` file; each shines along −Z of its node, intensity × color being our irradiance.

    unit : the map's, "relative" or "cd/m²"; glTF takes intensity for lux
    background : the file with the light that the lights do not carry; glTF cannot hold it, so `extras` name it
    angles : (N,), apparent diameters in radians; punctual lights have none, so `extras` keep them

    Raises ValueError for another unit, an absolute path or angles that do not fit.
    """
    bulbs: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    for index, lamp in enumerate(lamps(lights, angles)):
        bulb: dict[str, Any] = {
            "name": lamp.name,
            "type": "directional",
            "color": [float(figure(part)) for part in lamp.colour],
            "intensity": float(figure(lamp.intensity)),
        }
        if angles is not None:
            bulb["extras"] = {"apparent_diameter_radians": float(figure(lamp.angle))}
        bulbs.append(bulb)
        nodes.append(
            {
                "name": lamp.name,
                "rotation": [float(figure(part)) for part in lamp.quaternion],
                "extensions": {EXTENSION: {"light": index}},
            }
        )
    notes: dict[str, Any] = {"meaning": f"{meaning(unit)} glTF takes intensity for lux.", "unit": unit}
    name = beside(background)
    if name is not None:
        notes["background"] = name
        notes["background_note"] = (
            "The lights alone are not all the light: the rest is in the background, a lat-long map (top +Y, centre -Z, "
            "+X to its right) that glTF cannot hold; give it to the viewer as its environment."
        )
    written: dict[str, Any] = {"asset": {"version": "2.0", "generator": "relume", "extras": notes}}
    # The schema allows no empty lists.
    if nodes:
        written |= {
            "extensionsUsed": [EXTENSION],
            "extensions": {EXTENSION: {"lights": bulbs}},
            "nodes": nodes,
            "scenes": [{"name": "lights", "nodes": list(range(len(nodes)))}],
            "scene": 0,
        }
    return json.dumps(written, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
