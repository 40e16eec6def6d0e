"""A constellation as glTF: directional lights, and point lights, of the extension KHR_lights_punctual."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from relume.export.lamps import beside, bulbs, figure, lamps, meaning
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights

EXTENSION = "KHR_lights_punctual"


def text(
    lights: Constellation,
    *,
    unit: str,
    background: str | None = None,
    angles: np.ndarray | None = None,
    points: PlacedLights | None = None,
) -> str:
    """The lights as a `.gltf` file; each shines along −Z of its node, intensity × color being our irradiance.

    unit : the map's, "relative" or "cd/m²"; glTF takes intensity for lux
    background : the file with the light that the lights do not carry; glTF cannot hold it, so `extras` name it
    angles : (N,), apparent diameters in radians; punctual lights have none, so `extras` keep them
    points : lights that have a place, as point lights of an intensity in candela; `extras` keep their radii

    Raises ValueError for another unit, an absolute path or angles that do not fit.
    """
    shining: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    # Distant lights: nodes that are turned.
    for index, lamp in enumerate(lamps(lights, angles)):
        light: dict[str, Any] = {
            "name": lamp.name,
            "type": "directional",
            "color": [float(figure(part)) for part in lamp.colour],
            "intensity": float(figure(lamp.intensity)),
        }
        if angles is not None:
            light["extras"] = {"apparent_diameter_radians": float(figure(lamp.angle))}
        shining.append(light)
        nodes.append(
            {
                "name": lamp.name,
                "rotation": [float(figure(part)) for part in lamp.quaternion],
                "extensions": {EXTENSION: {"light": index}},
            }
        )
    # Lights that have a place: nodes that are moved.
    for bulb in bulbs(points):
        light = {
            "name": bulb.name,
            "type": "point",
            "color": [float(figure(part)) for part in bulb.colour],
            "intensity": float(figure(bulb.strength)),
        }
        if bulb.radius > 0:
            light["extras"] = {"radius_metres": float(figure(bulb.radius))}
        nodes.append(
            {
                "name": bulb.name,
                "translation": [float(figure(part)) for part in bulb.position],
                "extensions": {EXTENSION: {"light": len(shining)}},
            }
        )
        shining.append(light)
    # What the numbers mean, and the background that belongs to them.
    takes = "glTF takes intensity for lux" + ("." if points is None else ", and that of point lights for candela.")
    notes: dict[str, Any] = {"meaning": f"{meaning(unit, points)} {takes}", "unit": unit}
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
            "extensions": {EXTENSION: {"lights": shining}},
            "nodes": nodes,
            "scenes": [{"name": "lights", "nodes": list(range(len(nodes)))}],
            "scene": 0,
        }
    return json.dumps(written, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
