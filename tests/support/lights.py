"""Lights whose reflections are known, or hard: for the tests of reflection maps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from relume.image.files import write
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import CubeCross, Strip, VerticalCubeCross
from relume.sphere.mappings.discs import Angular, Fisheye, Hemispheres, MirrorBall
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_points
from relume.sphere.mappings.squares import EqualArea, Octahedral

SIMPLE = (LatLong(), Angular(), MirrorBall())
WHOLE: tuple[Mapping, ...] = (
    *SIMPLE, CubeCross(), VerticalCubeCross(), Strip(), Octahedral(), EqualArea(), Hemispheres(), Fisheye(2 * np.pi),
    Fisheye(2 * np.pi, equisolid=True),
)  # fmt: skip
"""Every mapping of the whole sphere; the first three are of any number of rows."""
NAMED = {mapping.name: mapping for mapping in WHOLE}


def fitting(mapping: Mapping, size: int) -> int:
    """The number of rows from `size` on that an image of the mapping can have."""
    while True:
        try:
            mapping.shape(size)
        except ValueError:
            size += 1
        else:
            return size


def constant(size: int, value: float | tuple[float, float, float] = 1.0) -> EnvironmentMap:
    return EnvironmentMap(np.broadcast_to(np.asarray(value, np.float32), (size, 2 * size, 3)).copy())


def of_directions(
    function: Callable[[np.ndarray], np.ndarray], size: int, mapping: Mapping = LatLong()
) -> EnvironmentMap:
    """Grey light whose radiance is a function of direction."""
    values = function(np.nan_to_num(mapping.directions(pixel_points(mapping, size))))
    return EnvironmentMap(np.repeat(values[..., None], 3, axis=-1).astype(np.float32), mapping)


def spiky(size: int, seed: int = 3) -> EnvironmentMap:
    """Nothing alike from pixel to pixel: noise from 0.01 to 100, mostly dark."""
    random = np.random.default_rng(seed).random((size, 2 * size, 3))
    return EnvironmentMap((random**8 * 100 + 0.01).astype(np.float32))


def lone(size: int, row: int, column: int, value: float = 1.0, dark: float = 0.0) -> EnvironmentMap:
    """One bright pixel."""
    radiance = np.full((size, 2 * size, 3), dark, np.float32)
    radiance[row, column] = value
    return EnvironmentMap(radiance)


def sunny(size: int, sun: float = 25.0) -> EnvironmentMap:
    """A blue sky, brown ground, a hedge of noise and a low orange sun 3° wide.

    sun : its radiance; 25 gives a seventh of the light, as at sunset, and 400 two thirds, as on a clear day
    """
    directions = LatLong().directions(pixel_points(LatLong(), size))
    height = directions[..., 1:2]
    sky, ground = np.array([0.3, 0.5, 1.0]) * (1.2 - height), np.array([0.15, 0.12, 0.08])
    radiance = np.where(height > 0, sky, ground)
    hedge = np.random.default_rng(5).random((size, 2 * size, 1))
    radiance = np.where(np.abs(height) < 0.1, hedge * np.array([0.2, 0.4, 0.1]), radiance)
    towards = normalised([0.7, 0.3, -0.65])
    glow = np.exp((directions @ towards - 1) / 0.002)[..., None]
    return EnvironmentMap((radiance + sun * glow * np.array([1.0, 0.6, 0.3])).astype(np.float32))


def spread(count: int, seed: int = 0) -> np.ndarray:
    """Unit directions all over the sphere."""
    return normalised(np.random.default_rng(seed).normal(size=(count, 3)))


def stored(folder: Path, light: EnvironmentMap, name: str = "light.exr") -> str:
    """Write a map that says its mapping; where it is."""
    write(folder / name, as_radiance_map(light))
    return str(folder / name)
