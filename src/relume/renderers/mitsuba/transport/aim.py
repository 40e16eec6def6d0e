"""Samples of light in Dr.Jit: directions towards it, and rays from it towards what bounds the objects.

Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

Spheres = list[tuple[Any, float]]
"""Centres and radii of what bounds objects."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A direction towards light.

    direction : unit vector from the point
    distance : to where the light stands, metres
    weight : radiance over density; irradiance over probability for lamps without size
    density : per steradian; 0 for lamps without size, which no other sampling finds
    valid : whether there is any
    """

    direction: Any
    distance: Any
    weight: Any
    density: Any
    valid: Any


def aimed(spheres: Spheres, which: Any, point: Any, place: Any) -> tuple[Any, Any]:
    """A direction from a place into the cone of one of several spheres, and its density over all of them."""
    cones = []
    for centre, radius in spheres:
        away = centre - place
        square = dr.minimum(radius**2 / dr.maximum(dr.squared_norm(away), 1e-20), 1)
        # From within every direction leads to what it bounds: 1 − cos of a whole sphere is 2.
        less = dr.select(square < 1, square / (1 + dr.safe_sqrt(1 - square)), 2)
        cones.append((dr.normalize(away), less))
    axis, less = cones[0]
    for index, (direction, width) in enumerate(cones):
        mine = which >= index / len(cones)
        axis, less = dr.select(mine, direction, axis), dr.select(mine, width, less)
    down = point.x * less
    flat = dr.safe_sqrt(down * (2 - down))
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    direction = mi.Frame3f(axis).to_world(mi.Vector3f(flat * cosine, flat * sine, 1 - down))
    density = mi.Float(0)
    for axis, less in cones:
        inside = 0.5 * dr.squared_norm(direction - axis) <= less
        density += dr.select(inside, 1 / (2 * np.pi * less * len(cones)), 0)
    return direction, density


def parallel(spheres: Spheres, which: Any, point: Any, towards: Any, radiance: Any) -> tuple[Any, Any, Any]:
    """A ray of parallel light through the disc of one of several spheres, and its flux."""
    frame = mi.Frame3f(towards)
    centre, radius = spheres[0][0], mi.Float(spheres[0][1])
    for index, (c, r) in enumerate(spheres):
        mine = which >= index / len(spheres)
        centre, radius = dr.select(mine, c, centre), dr.select(mine, r, radius)
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    flat = radius * dr.sqrt(point.x)
    through = centre + frame.to_world(mi.Vector3f(flat * cosine, flat * sine, 0))
    density = mi.Float(0)
    behind = mi.Float(0)
    for c, r in spheres:
        offset = through - c
        across = dr.squared_norm(offset - dr.dot(offset, towards) * towards)
        density += dr.select(across <= r**2, 1 / (np.pi * r**2 * len(spheres)), 0)
        behind = dr.maximum(behind, dr.norm(offset) + r)
    # Begun before all of the spheres.
    return mi.Ray3f(through + behind * towards, -towards), radiance / density, density > 0
