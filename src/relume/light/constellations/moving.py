"""Lights of maps that follow one another: the same lights in every map, which move without popping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from relume.light.constellations.cells import cells_of
from relume.light.constellations.constellation import Constellation, constellation, lights_of_regions
from relume.light.constellations.k_means import KMeans, Regions, follow
from relume.light.constellations.rectangles import MedianCut
from relume.sphere.environment_map import EnvironmentMap

SETTLED = 1e-5
"""Share of the spread that an iteration saves in the first map: where lights have settled, still light stays still."""


def moving_constellation(maps: Iterator[EnvironmentMap], count: int, start: Regions) -> Iterator[Constellation]:
    """The same lights in every map, all of its light in them; light n of one map goes on as light n of the next.

    maps : one after another, like `LightSequence` gives
    count : of lights, at most; fixed by the first map
    start : how the first map is divided, before k-means settles

    Each light goes on from where it was to the mean of the light that is nearest to it (Lloyd 1982, begun from the
    map before). One that has lost its light stays, dark, so that none jumps. Later maps have no say in earlier ones.
    """
    before: Constellation | None = None
    for light in maps:
        before = move_lights(light, before, count, start)
        yield before


def move_lights(
    light: EnvironmentMap, before: Constellation | None = None, count: int = 64, start: Regions = MedianCut()
) -> Constellation:
    """The lights of one map, going on from those of the map before it; all of its light is in them.

    light : the map whose lights are wanted
    before : of the map before, which says how many there are; None for the first map
    count, start : of the first map: how many lights, and the regions that k-means begins with
    """
    if before is None:
        before = constellation(light, count, KMeans(500, start, SETTLED))
    cells = cells_of(light)
    centres = before.directions
    lights = lights_of_regions(cells, follow(cells, centres), len(centres))
    dark = lights.irradiance.sum(axis=-1, keepdims=True) <= 0
    return replace(lights, directions=np.where(dark, centres, lights.directions))
