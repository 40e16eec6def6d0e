"""Key lights and the glow that is left: lights for what is bright, a residual map for all else (*Fiat Lux*, 1999).

The map is split by level: up to a certain luminance a pixel's light stays in the residual, what rises above it goes to
the lights. The residual has no holes and no edges of its own, the sum of both is the map in every channel, and only
the lights' light is moved, by no more than the extent of the bright spots they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import SATURATED
from relume.light.constellations.constellation import Constellation, constellation
from relume.sphere.environment_map import EnvironmentMap

if TYPE_CHECKING:
    from relume.light.constellations.k_means import Regions


@dataclass(frozen=True, eq=False)
class KeyLights:
    """A map's light in two parts.

    lights : what is brighter than `level`
    residual : the map with nothing brighter than it
    level : luminance, in the map's unit
    """

    lights: Constellation
    residual: EnvironmentMap
    level: float


def key_lights(
    light: EnvironmentMap, count: int = 64, contrast: float = 4.0, method: Regions | None = None
) -> KeyLights:
    """Lights and a residual map that together are the map: ∫ L dω is kept exactly in every channel.

    light : in any mapping, which the residual keeps
    count, method : as in `constellation`, for the light that is above the level
    contrast : the residual is nowhere brighter than so many times its own mean. 4, two stops, leaves a glow that no
        renderer finds noise in; 0 leaves nothing, and infinity everything

    Raises ValueError for no lights and a negative contrast. Source: Debevec, *Fiat Lux* (SIGGRAPH 99).
    """
    if count < 1:
        raise ValueError(f"key lights are {count}; expected 1 or more, like 64")
    values, areas = luminance(light.radiance), light.mapping.solid_angles(light.size)
    level = glow_level(values, areas, contrast)
    share = np.divide(level, values, out=np.ones_like(values), where=values > level)
    residual = light.radiance * share[..., None]
    bright = share < 1
    clipped = light.clipped
    if clipped is not None:
        # Where the map is a lower bound, what is left under the level is known.
        clipped = np.where(bright & (clipped == SATURATED), 0, clipped).astype(np.uint8)
    glow = EnvironmentMap(residual, light.mapping, light.unit, clipped)
    above = EnvironmentMap(light.radiance - residual, light.mapping, light.unit)
    return KeyLights(_carrying(constellation(above, count, method), light.total() - glow.total()), glow, level)


def glow_level(values: np.ndarray, areas: np.ndarray, contrast: float) -> float:
    """The level that is `contrast` times the mean of all light up to it; luminance and solid angles (rows, columns).

    T = k · ∫ min(Y, T) dω / ∫ dω has one solution above 0 where k > 1. It does not depend on how bright the brightest
    is: a sun neither raises nor hides it.
    """
    if not contrast >= 0:
        raise ValueError(f"contrast of the residual is {contrast}; expected 0 or more, like 4")
    if contrast <= 1 or not values.any():
        return 0.0
    whole, shown = float(np.sum(areas)), areas > 0
    values, areas = values[shown].astype(np.float64), areas[shown]
    if contrast == np.inf:
        return float(values.max())
    # Newton's method from above, on a convex function of straight pieces: it arrives after a few steps.
    level = contrast * float(values @ areas) / whole
    for _ in range(100):
        over = values > level
        below, beyond = float(values[~over] @ areas[~over]) / whole, float(areas[over].sum()) / whole
        if contrast * beyond >= 1:
            return 0.0
        before, level = level, contrast * below / (1 - contrast * beyond)
        if not level < before * (1 - 1e-12):
            break
    return level


def _carrying(lights: Constellation, total: np.ndarray) -> Constellation:
    """The lights with exactly this light: pixels of the map above the level were rounded."""
    sums = lights.total()
    irradiance = lights.irradiance * np.where(sums > 0, np.maximum(total, 0) / np.maximum(sums, 1e-300), 1)
    return replace(lights, irradiance=irradiance)
