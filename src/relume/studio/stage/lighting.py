"""The light that the page asks for, as JSON: lamps with colours and sizes, a map that is turned and dimmed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import relume as rl

MOST_LAMPS = 64


@dataclass(frozen=True)
class Lamp:
    """A distant lamp.

    direction : unit, towards it, world
    irradiance : red, green, blue on a surface that faces it
    diameter : apparent, degrees
    """

    direction: tuple[float, float, float]
    irradiance: tuple[float, float, float]
    diameter: float


@dataclass(frozen=True)
class Light:
    """All that shines; lamps and the map are summed.

    map : which of the session's maps; None for none
    turn : degrees by which the map is turned about the vertical, right-handed
    stops : by which it is brightened
    """

    lamps: tuple[Lamp, ...] = ()
    map: int | None = None
    turn: float = 0.0
    stops: float = 0.0

    def constellation(self) -> rl.light.Constellation:
        """The lamps as a set of lights with sizes."""
        return rl.light.Constellation(
            np.array([lamp.direction for lamp in self.lamps], np.float64).reshape(-1, 3),
            np.array([lamp.irradiance for lamp in self.lamps], np.float64).reshape(-1, 3),
            np.radians([lamp.diameter / 2 for lamp in self.lamps]),
        )

    def lighting(self, maps: Sequence[rl.EnvironmentMap]) -> rl.lightstage.StageLighting | None:
        """The same as `rl.lightstage.relight` takes it; None for no light."""
        lamps = self.constellation()
        if self.map is None:
            return rl.lightstage.StageLighting(light_sets=(lamps,)) if self.lamps else None
        # Light sets turn with the maps: the lamps are turned back first, so that they stay.
        rotation = turned(self.turn)
        lamps = replace(lamps, directions=lamps.directions @ rotation)
        light = maps[self.map]
        light = replace(light, radiance=light.radiance * np.float32(2.0**self.stops)) if self.stops else light
        return rl.lightstage.StageLighting((light,), (lamps,) if self.lamps else (), rotation=rotation)


def turned(degrees: float) -> np.ndarray:
    """The rotation (3, 3) about the vertical, right-handed."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def light_of(given: Any, maps: int) -> Light:
    """The light in what a page sent; raises ValueError for anything that is none, with what it is.

    maps : how many there are
    """
    if not isinstance(given, Mapping):
        raise ValueError("the light is no object")
    lamps = given.get("lamps", [])
    if not isinstance(lamps, list) or len(lamps) > MOST_LAMPS:
        raise ValueError(f"lamps are no list of at most {MOST_LAMPS}")
    chosen = given.get("map")
    if chosen is not None and not (type(chosen) is int and 0 <= chosen < maps):
        raise ValueError(f"map is {chosen!r}; there are {maps}")
    turn, stops = (_numbers(given.get(name, 0), name, 1)[0] for name in ("turn", "stops"))
    if abs(stops) > 32:
        raise ValueError(f"stops are {stops}; give −32 to 32")
    return Light(tuple(_lamp(each) for each in lamps), chosen, turn, stops)


def _lamp(given: Any) -> Lamp:
    if not isinstance(given, Mapping):
        raise ValueError("a lamp is no object")
    direction = np.array(_numbers(given.get("direction"), "direction", 3))
    length = float(np.linalg.norm(direction))
    irradiance = _numbers(given.get("irradiance"), "irradiance", 3)
    diameter = _numbers(given.get("diameter", 0), "diameter", 1)[0]
    if length == 0 or min(irradiance) < 0 or not 0 <= diameter < 180:
        raise ValueError("a lamp needs a direction, irradiance from 0 and a diameter from 0 to below 180 degrees")
    x, y, z = (direction / length).tolist()
    return Lamp((x, y, z), (irradiance[0], irradiance[1], irradiance[2]), diameter)


def _numbers(given: Any, name: str, count: int) -> list[float]:
    values = given if isinstance(given, list) else [given]
    if len(values) != count or not all(isinstance(v, int | float) and np.isfinite(v) for v in values):
        raise ValueError(f"{name} is {given!r}; give {count} number{'s' if count > 1 else ''}")
    return [float(value) for value in values]
