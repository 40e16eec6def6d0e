"""A test map with its axes written on it: whoever loads it sees at once whether it is turned or mirrored.

Round each of ±X, ±Y and ±Z lies a disc in a colour of its own with the axis's name upright for someone who stands
inside, looks along −Z with +Y up, turns to ±X or +Z, or nods to ±Y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class Label:
    """An axis of the world as it is written on the map.

    towards : the axis, and the middle of its disc
    right, up : what lies to the right and above for who looks there
    colour : radiance of the disc
    """

    towards: np.ndarray
    right: np.ndarray
    up: np.ndarray
    colour: tuple[float, float, float]


LABELS: dict[str, Label] = {
    "+X": Label(_X, _Z, _Y, (1.0, 0.1, 0.1)),
    "-X": Label(-_X, -_Z, _Y, (0.1, 0.9, 0.9)),
    "+Y": Label(_Y, _X, _Z, (0.1, 1.0, 0.1)),
    "-Y": Label(-_Y, _X, -_Z, (1.0, 0.1, 1.0)),
    "+Z": Label(_Z, -_X, _Y, (0.2, 0.3, 1.0)),
    "-Z": Label(-_Z, _X, _Y, (1.0, 0.9, 0.1)),
}
"""The six axes by their names."""

RADIUS = np.radians(30)
"""Of a disc: six do not touch."""
GROUND, LINE, HORIZON, INK = 0.18, 0.3, 0.6, 0.01
"""Radiance between the discs, of the lines every 30° there, of the horizon and of the letters."""

_STROKES: dict[str, tuple[tuple[float, float, float, float], ...]] = {
    "+": ((-1, 0, 1, 0), (0, -1, 0, 1)),
    "-": ((-1, 0, 1, 0),),
    "X": ((-1, -1, 1, 1), (-1, 1, 1, -1)),
    "Y": ((-1, 1, 0, 0), (1, 1, 0, 0), (0, 0, 0, -1)),
    "Z": ((-1, 1, 1, 1), (1, 1, -1, -1), (-1, -1, 1, -1)),
}
"""Lines from (x, y) to (x, y) in a square of ±1."""


def orientation_chart(size: int = 512) -> EnvironmentMap:
    """A lat-long map of `size` rows whose six axes are named and coloured; radiance is relative and at most 1.

    The very direction of an axis shows the colour of its disc: the letters leave the middle free.
    """
    directions = pixel_directions(LatLong(), size)
    pixel = np.pi / size
    radiance = _grid(directions, pixel)
    for name, label in LABELS.items():
        depth = directions @ label.towards
        near = depth > np.cos(RADIUS) - 2 * pixel
        # The plane that touches the sphere in the axis: letters are straight there.
        plane = directions[near] / depth[near][:, None]
        x, y = plane @ label.right, plane @ label.up
        disc = _inside(np.tan(RADIUS) - np.hypot(x, y), pixel)
        sign, letter = _STROKES[name[0]], _STROKES[name[1]]
        ink = np.maximum(_ink(sign, x + 0.24, y, 0.11, pixel), _ink(letter, x - 0.22, y, 0.13, pixel))
        written = np.asarray(label.colour) * (1 - ink)[:, None] + INK * ink[:, None]
        radiance[near] += disc[:, None] * (written - radiance[near])
    return EnvironmentMap(radiance.astype(np.float32))


def _grid(directions: np.ndarray, pixel: float) -> np.ndarray:
    """Ground with a line every 30° of longitude and latitude, (rows, columns, 3)."""
    longitude, latitude = np.arctan2(directions[..., 0], -directions[..., 2]), np.arcsin(directions[..., 1])
    step = np.radians(30)
    to_meridian = np.abs((longitude + step / 2) % step - step / 2) * np.cos(latitude)
    to_parallel = np.abs((latitude + step / 2) % step - step / 2)
    width = np.radians(0.4)
    line = _inside(width - np.minimum(to_meridian, to_parallel), pixel)
    horizon = _inside(2 * width - np.abs(latitude), pixel)
    grey = GROUND + (LINE - GROUND) * line
    grey += (HORIZON - grey) * horizon
    return np.repeat(grey[..., None], 3, axis=-1)


def _ink(
    strokes: tuple[tuple[float, float, float, float], ...], x: np.ndarray, y: np.ndarray, scale: float, pixel: float
) -> np.ndarray:
    """How much of each point round (x, y) = (0, 0) lies within pens drawn along the strokes, 0…1."""
    distances = []
    for stroke in strokes:
        x0, y0, x1, y1 = (scale * place for place in stroke)
        along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2)
        along = np.clip(along, 0, 1)
        distances.append(np.hypot(x - x0 - along * (x1 - x0), y - y0 - along * (y1 - y0)))
    return _inside(0.035 - np.minimum.reduce(distances), pixel)


def _inside(depth: np.ndarray, pixel: float) -> np.ndarray:
    """How much of a pixel lies within an edge that is `depth` away, 0…1."""
    return np.clip(depth / pixel + 0.5, 0, 1)
