"""A constellation as JSON: all its numbers, in our own frame, for whoever writes a reader of their own."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.export.lamps import FRAME, beside, bulbs, figure, lamps, meaning
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights

FORMAT = "relume constellation 1"


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
        "format": FORMAT,
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


def read_lights(path: str | Path) -> Constellation:
    """The parallel lights of such a text; raises UnreadableFile, also for lights that have a place."""
    try:
        document = json.loads(Path(path).read_text("utf-8"))
    except OSError as error:
        raise UnreadableFile(f"{path}: {error.strerror}; check the path") from None
    except (RecursionError, ValueError) as error:
        raise UnreadableFile(f"{path}: no JSON text ({error}); give what `relume lights` wrote") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise UnreadableFile(
            f'{path}: its format is not "{FORMAT}"; give what `relume lights -o {Path(path).name}` wrote'
        )
    if document.get("points"):
        raise UnreadableFile(f"{path}: has lights with a place, which are not read; write it without them")
    if document.get("background"):
        warnings.warn(
            f"{path}: the light that its lights do not carry is in {document['background']}; give it too", stacklevel=2
        )
    try:
        directions = np.array([light["direction"] for light in document["lights"]], np.float64).reshape(-1, 3)
        irradiance = np.array([light["irradiance"] for light in document["lights"]], np.float64).reshape(-1, 3)
        angles = [float(light.get("angle", 0.0)) for light in document["lights"]]
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: a light without three numbers of direction and irradiance ({error})") from None
    lengths = np.linalg.norm(directions, axis=1)
    if not np.isfinite(irradiance).all() or (irradiance < 0).any() or not np.all((lengths > 0) & np.isfinite(lengths)):
        raise UnreadableFile(f"{path}: a light without direction, or of negative or infinite irradiance; mend it")
    return Constellation(directions / lengths[:, None], irradiance, np.array(angles) / 2)
