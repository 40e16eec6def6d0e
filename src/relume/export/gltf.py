"""A constellation as glTF: directional lights, and point lights, of the extension KHR_lights_punctual."""

from __future__ import annotations

import json
from typing import Any

from relume.export.lamps import Bulb, Lamp, LampFile, figure, rounded

EXTENSION = "KHR_lights_punctual"


def text(file: LampFile) -> str:
    """The lights as a `.gltf` file; each shines along −Z of its node, intensity × color being our irradiance.

    glTF takes intensity for lux, that of point lights for candela. It cannot hold the background, so `extras` name it;
    punctual lights have neither apparent diameters nor radii, so `extras` keep them.
    """
    lamps, bulbs = file.lamps, file.bulbs
    shining = [_light(lamp, "directional", lamp.intensity) for lamp in lamps]
    if file.angles is not None:
        for light, lamp in zip(shining, lamps, strict=True):
            light["extras"] = {"apparent_diameter_radians": float(figure(lamp.angle))}
    for bulb in bulbs:
        shining.append(_light(bulb, "point", bulb.strength))
        if bulb.radius > 0:
            shining[-1]["extras"] = {"radius_metres": float(figure(bulb.radius))}
    # Nodes of distant lights are turned, those of lights that have a place are moved.
    places = [{"rotation": rounded(lamp.quaternion)} for lamp in lamps]
    places += [{"translation": rounded(bulb.position)} for bulb in bulbs]
    nodes = [
        {"name": light["name"], **place, "extensions": {EXTENSION: {"light": index}}}
        for index, (light, place) in enumerate(zip(shining, places, strict=True))
    ]
    # What the numbers mean, and the background that belongs to them.
    takes = "glTF takes intensity for lux" + ("." if file.points is None else ", and that of point lights for candela.")
    notes: dict[str, Any] = {"meaning": f"{file.meaning} {takes}", "unit": file.unit}
    name = file.background_name
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


def _light(light: Lamp | Bulb, kind: str, intensity: float) -> dict[str, Any]:
    return {
        "name": light.name,
        "type": kind,
        "color": rounded(light.colour),
        "intensity": float(figure(intensity)),
    }
