"""Light that changes, looked at map by map: which file it is, the lights that stand for it, what a ball gets of it."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.shots.folder import Folder
from relume.studio.shots.measured import irradiance_facts

LIGHTS = 16
"""That are drawn over a map: as many as an eye follows."""
RATE = 24.0
"""Maps a second, where the shot does not say it."""

LOOKED_FOR_EVERY = 2.0
"""Seconds between looks at which maps there are."""


class LightFilm:
    """The maps that were looked at last, with their lights; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sequence: tuple[float, object, rl.light.LightSequence] | None = None
        self._paths: tuple[Path, ...] = ()
        self._lights: dict[int, rl.light.Constellation] = {}
        self._kept: dict[int, tuple[int, dict[str, Any]]] = {}

    def facts(self, light: object, folder: Folder, frame: int) -> dict[str, Any]:
        """A map, for JSON: its file, its size, where its lights stand in it, and `irradiance_facts`.

        light : the shot's [light]
        frame : 1 for the first map
        Lights go on from those of the nearest map before that was looked at, so that played they move without popping.
        Raises ValueError, UnreadableFile.
        """
        with self._lock:
            found = self._found(light, folder)
            if not 1 <= frame <= len(found.paths):
                raise ValueError(f"there is no frame {frame}; the light has the maps 1 to {len(found.paths)}")
            path = found.paths[frame - 1]
            if not path.resolve().is_relative_to(folder.root):
                raise ValueError(f"{path} is not below {folder.root}; the page shows maps of this folder alone")
            if self._paths != found.paths:
                self._paths, self._lights, self._kept = found.paths, {}, {}
            stamp = path.stat().st_mtime_ns
            if frame not in self._kept or self._kept[frame][0] != stamp:
                self._kept[frame] = stamp, self._looked_at(found, frame)
            return {
                "path": folder.name(path), "frame": frame, "count": len(found.paths), "rate": found.rate,
                **self._kept[frame][1],
            }  # fmt: skip

    def _found(self, light: object, folder: Folder) -> rl.light.LightSequence:
        """The maps, looked for again now and then: while they play that would take longer than all else."""
        kept, now = self._sequence, time.monotonic()
        if kept is None or kept[1] != light or now - kept[0] > LOOKED_FOR_EVERY:
            self._sequence = kept = now, light, sequence_of(light, folder)
        return kept[2]

    def _looked_at(self, found: rl.light.LightSequence, frame: int) -> dict[str, Any]:
        """What is measured of a map."""
        picture = found.at((frame - 1) / found.rate)
        before = max((number for number in self._lights if number < frame), default=None)
        start = None if before is None else self._lights[before]
        lights = self._lights[frame] = rl.light.move_lights(picture, start, LIGHTS)
        return {"lights": _places(picture, lights), "irradiance": irradiance_facts(picture), "unit": picture.unit}


def sequence_of(light: object, folder: Folder) -> rl.light.LightSequence:
    """The maps of a shot's [light]; raises ValueError where there are none, UnreadableFile."""
    maps = light.get("maps") if isinstance(light, dict) else None
    names = [maps] if isinstance(maps, str) else maps
    if not isinstance(light, dict) or not isinstance(names, list) or not all(isinstance(each, str) for each in names):
        raise ValueError("the light is no maps that follow one another; name them as light.maps")
    rate = light.get("rate", RATE)
    if not isinstance(rate, int | float):
        raise ValueError("light.rate is a number, maps a second")
    return rl.light.LightSequence.found(names, float(rate), folder=folder.root)


def _places(picture: rl.EnvironmentMap, lights: rl.light.Constellation) -> list[dict[str, Any]]:
    """Of each light where it stands, pixels of the map, and its share of all light."""
    width, height = picture.radiance.shape[1::-1]
    places = picture.mapping.image_points(lights.directions) * (width, height)
    power = lights.irradiance.sum(axis=-1)
    shares = power / max(float(power.sum()), 1e-300)
    return [
        {"x": float(x), "y": float(y), "share": float(share)}
        for (x, y), share in zip(places, shares, strict=True)
        if np.isfinite(x + y)
    ]
