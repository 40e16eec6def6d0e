"""Lamps that hang in the room: taken out of the map that was photographed, and put where they are.

A map projected onto walls puts a lamp that hangs before one too far away: its shadows fall too flat, and its light
falls off too slowly. Where its place was measured, the map's bright spot there becomes a sphere of light in that place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from relume.image.colour import luminance
from relume.light.constellations.placement import PlacedLights, point
from relume.light.reflection.convolution import as_latlong
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_points

REACH = np.radians(6.0)
"""How far from where it was measured a lamp is looked for: a hand's breadth at a metre, and errors of registration."""
EDGE = 0.1
"""Of the lamp's brightest: where it ends. Its blurred rim, a pixel or two, is taken along."""


@dataclass(frozen=True, eq=False)
class FreeLamp:
    """A lamp apart from the light behind it.

    rest : the map with what surrounds the lamp in its place
    lamp : one sphere that shines, with all the light that was taken
    off : radians between where it was measured and where the map shows it
    """

    rest: EnvironmentMap
    lamp: PlacedLights
    off: float


def free_lamp(light: EnvironmentMap, position: ArrayLike, probe: ArrayLike = (0.0, 0.0, 0.0)) -> FreeLamp:
    """Take the lamp that hangs at a place out of a map.

    light : as the place `probe` sees it
    position : (3,) metres, world, of the lamp's middle; its distance counts, for its direction the map is believed
    probe : (3,) metres, world

    What is taken and what is left are together the map's light, in every channel. Raises ValueError where the map shows
    nothing brighter than its surroundings there. Source: Debevec 1998, §9 (concentrated lights located and identified).
    """
    light = as_latlong(light)
    way = point(position, "position") - point(probe, "probe")
    distance = float(np.linalg.norm(way))
    if not distance > 0:
        raise ValueError("the lamp is where the light was measured; give the place of its middle, metres")
    rows = light.size
    # All that is looked at lies in these rows: the ring, and a lamp as wide as may be with its rim.
    polar, reach = np.arccos(np.clip(way[1] / distance, -1, 1)), 3 * REACH + 2 * np.pi / rows
    low, high = np.floor((polar - reach) / np.pi * rows), np.ceil((polar + reach) / np.pi * rows)
    band = slice(max(int(low), 0), min(int(high), rows))
    directions = light.mapping.directions(pixel_points(light.mapping, rows)[band])
    areas, seen = light.mapping.solid_angles(rows)[band], light.radiance[band]
    near = directions @ (way / distance) > np.cos(REACH)
    values = luminance(seen)
    brightest = float(np.where(near, values, 0).max())
    ring = (directions @ (way / distance) > np.cos(3 * REACH)) & ~near
    around = np.median(seen[ring], axis=0)
    if not brightest > 4 * float(luminance(around)):
        raise ValueError(
            f"the light shows no lamp towards {np.asarray(position).tolist()}: within 6° nothing is four times as "
            "bright as what surrounds it; is the place in metres, in the frame of the scene?"
        )
    bright = near & (values > EDGE * brightest)
    middle = (directions[bright] * (values * areas)[bright][:, None]).sum(axis=0)
    middle /= np.linalg.norm(middle)
    # The blurred rim: two pixels of the map more than what is bright.
    radius = float(np.arccos(np.clip((directions[bright] @ middle).min(), -1, 1))) + 2 * np.pi / rows
    taken = directions @ middle > np.cos(radius)
    left = np.minimum(seen, around)
    flux = ((seen - left) * areas[..., None])[taken].sum(axis=0)
    # As wide as a disc of the lamp's own brightness that gives this light.
    solid_angle = float(luminance(flux)) / float(np.percentile(values[bright], 90))
    size = distance * np.sqrt(solid_angle / np.pi)
    lamp = PlacedLights(
        (np.asarray(probe, np.float64) + distance * middle)[None], (flux * distance**2)[None], np.array([size])
    )
    radiance = light.radiance.astype(np.float32)
    radiance[band] = np.where(taken[..., None], left, seen)
    clipped = None if light.clipped is None else light.clipped.astype(np.uint8)
    if clipped is not None:
        clipped[band] = np.where(taken, 0, clipped[band])
    off = float(np.arccos(np.clip(middle @ way / distance, -1, 1)))
    return FreeLamp(replace(light, radiance=radiance, clipped=clipped), lamp, off)
