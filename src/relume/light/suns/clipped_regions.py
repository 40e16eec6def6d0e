"""Where a map's light was too bright for every photograph: its clipped pixels, gathered into sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.errors import SunNotRecovered
from relume.image.colour import luminance
from relume.image.radiance import SATURATED
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap

SUN_DIAMETER = 0.0093
"""Radians, 0.533°, the sun's mean angular diameter."""
NEAR_THE_TOP = 0.999
"""Share of the brightest value at which a pixel belongs to the plateau."""


class Shape(Protocol):
    """Where in the map the light that a clipped source lacks is put."""

    def place(self, light: EnvironmentMap, directions: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels, flat indices (M,), and the radiance (M,) that gives 1 on a surface facing the source.

        directions : (rows, columns, 3) of the map's pixels
        source : flat indices of the clipped pixels
        """
        ...


@dataclass(frozen=True)
class ClippedPixels:
    """Over all clipped pixels, in proportion to what they hold: nothing is said about the source that was not seen."""

    def place(self, light: EnvironmentMap, directions: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The source's pixels (K,) and shares (K,) in proportion to what they hold; by solid angle they sum to 1.

        light, directions : the map, and the directions (rows, columns, 3) of its pixels
        source : (K,) flat indices of the source's clipped pixels
        """
        held = luminance(light.radiance.reshape(-1, 3)[source].astype(np.float64))
        held = held if held.any() else np.ones(len(source))
        return source, held / (held @ light.mapping.solid_angles(light.size).reshape(-1)[source])


@dataclass(frozen=True)
class SunDisc:
    """In a round disc in the middle of the clipped pixels, for a sun whose surroundings clipped with it.

    diameter : radians; 0.53°, the sun's, unless given, and never finer than one pixel
    """

    diameter: float = SUN_DIAMETER

    def place(self, light: EnvironmentMap, directions: np.ndarray, source: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The disc's pixels (K,) and even shares (K,); by solid angle they sum to 1.

        light, directions : the map, and the directions (rows, columns, 3) of its pixels
        source : (K,) flat indices of the source's clipped pixels
        """
        areas = light.mapping.solid_angles(light.size).reshape(-1)
        flat = directions.reshape(-1, 3)
        middle = middle_of(light, directions, source)
        # Chords, which are exact for small angles where cosines are not.
        chords = np.where(areas > 0, np.linalg.norm(flat - middle, axis=-1), np.inf)
        pixels = np.flatnonzero(chords <= max(2 * np.sin(self.diameter / 4), chords.min()))
        return pixels, np.full(len(pixels), 1 / areas[pixels].sum())


def plateau(light: EnvironmentMap) -> np.ndarray:
    """The pixels of a map without a mask that look clipped: (rows, columns) bool, those at the top of any channel.

    Raises SunNotRecovered where fewer than three are: a lone brightest pixel is no plateau.
    """
    tops = light.radiance.max((0, 1))
    mask = ((light.radiance >= NEAR_THE_TOP * tops) & (tops > 0)).any(-1)
    mask &= light.mapping.solid_angles(light.size) > 0
    if mask.sum() < 3:
        raise SunNotRecovered(
            "the map marks no clipped pixel, and its brightest ones are no plateau; "
            "say from which radiance on pixels are clipped (--level)"
        )
    return mask


def clipped_pixels(light: EnvironmentMap, level: float | None = None) -> np.ndarray:
    """(rows, columns) bool: where any channel reaches `level`, else where the map says SATURATED, else its plateau.

    Raises SunNotRecovered where there is none.
    """
    shown = light.mapping.solid_angles(light.size) > 0
    if level is not None:
        mask, where = (light.radiance >= level).any(-1) & shown, f"reaches {level:g}"
    elif light.clipped is not None:
        mask, where = (light.clipped == SATURATED) & shown, "is marked as saturated"
    else:
        return plateau(light)
    if not mask.any():
        raise SunNotRecovered(f"no pixel of the map {where}: nothing clipped, so nothing is to be recovered")
    return mask


def sources(light: EnvironmentMap, directions: np.ndarray, mask: np.ndarray, apart: float) -> list[np.ndarray]:
    """The clipped pixels gathered into sources, flat indices each, the strongest first.

    apart : radians; what is nearer to a stronger source belongs to it
    """
    from scipy.ndimage import label

    labelled = np.empty(mask.shape, np.int32)
    label(mask, np.ones((3, 3)), labelled)
    count = int(labelled.max())
    areas = light.mapping.solid_angles(light.size)
    strength = luminance(light.radiance.astype(np.float64)) * areas
    flat = np.flatnonzero(mask)
    island = labelled.ravel()[flat] - 1
    strengths = np.bincount(island, strength.ravel()[flat] + 1e-30 * areas.ravel()[flat], count)
    weight = (strength + 1e-30 * areas).ravel()[flat]
    moments = np.stack([np.bincount(island, weight * directions.reshape(-1, 3)[flat, k], count) for k in range(3)], -1)
    middles = normalised(moments)
    seeds: list[int] = []
    belongs = np.empty(count, int)
    for each in np.argsort(-strengths, kind="stable").tolist():
        cosines = middles[seeds] @ middles[each]
        if seeds and cosines.max() > np.cos(apart):
            belongs[each] = int(np.argmax(cosines))
        else:
            belongs[each] = len(seeds)
            seeds.append(each)
    gathered = [flat[belongs[island] == k] for k in range(len(seeds))]
    return sorted(gathered, key=lambda pixels: -float(strength.ravel()[pixels].sum()))


def middle_of(light: EnvironmentMap, directions: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The mean direction (3,) of clipped pixels by solid angle: they are alike bright, as far as is known."""
    areas = light.mapping.solid_angles(light.size).reshape(-1)[source]
    return normalised(areas @ directions.reshape(-1, 3)[source])
