"""A constellation as JSON: all its numbers, in our own frame, for whoever writes a reader of their own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.export.lamps import FRAME, LampFile, figure, rounded
from relume.light.constellations.constellation import Constellation

FORMAT = "relume constellation 1"


def text(file: LampFile) -> str:
    """The lights as a JSON text; what is None is left out of it, but for the background."""
    written: dict[str, Any] = {
        "format": FORMAT,
        "meaning": f"Parallel lights. {file.meaning} Angles are apparent diameters in radians.",
        "frame": FRAME,
        "unit": file.unit,
        "background": file.background_name,
        "background_frame": "lat-long: the top row is +Y, the centre -Z and +X to its right",
        "lights": [],
    }
    for lamp in file.lamps:
        light: dict[str, Any] = {
            "direction": rounded(lamp.direction),
            "irradiance": rounded(lamp.irradiance),
        }
        if file.angles is not None:
            light["angle"] = float(figure(lamp.angle))
        written["lights"].append(light)
    if file.points is not None:
        written["points"] = [
            {
                "position": rounded(bulb.position),
                "intensity": rounded(bulb.intensity),
                **({} if file.points.radii is None else {"radius": float(figure(bulb.radius))}),
            }
            for bulb in file.bulbs
        ]
    return json.dumps(written, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def read_lights(path: str | Path) -> Constellation:
    """The parallel lights in a JSON file that `write_lights` wrote.

    path : the file, .json
    Raises UnreadableFile for any other file, and for lights that have a place.
    """
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
        warn(f"{path}: the light that its lights do not carry is in {document['background']}; give it too")
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
