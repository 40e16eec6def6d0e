"""The place of a bright source filled from what surrounds it."""

from __future__ import annotations

import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.inpainting import mean_by_distance
from relume.sphere.mappings.mapping import LatLong

RING = 3
"""Pixels round a patch that it is filled from."""
MOST = 2000
"""Pixels of the ring, at most; more make a fill no smoother."""


def filled(light: EnvironmentMap, patch: tuple[np.ndarray, np.ndarray], bright: np.ndarray) -> np.ndarray:
    """Radiance (M, 3) float32 for the pixels of a patch, from those round it that are not bright.

    patch : rows and columns
    bright : (rows, columns), what belongs to a source, this or another

    Each pixel is the mean of the ring, weighted by 1/distance⁴ on the sphere (Shepard 1968): near the rim it is what is
    there, so that no edge shows, and a horizon goes through. Black where nothing surrounds it.
    """
    ring = _ring(light, patch, bright)
    if not len(ring[0]):
        return np.zeros((len(patch[0]), 3), np.float32)
    step = -(-len(ring[0]) // MOST)
    ring = (ring[0][::step], ring[1][::step])
    around, inside = directions_of(light, ring), directions_of(light, patch)
    return mean_by_distance(inside, around, light.radiance[ring], power=4).astype(np.float32)


def directions_of(
    light: EnvironmentMap, pixels: tuple[np.ndarray, np.ndarray], down: float = 0.5, right: float = 0.5
) -> np.ndarray:
    """The unit directions (M, 3) of some pixels given by row and column: of their middles, or of other points."""
    rows, columns = light.radiance.shape[:2]
    points = np.stack([(pixels[1] + right) / columns, (pixels[0] + down) / rows], axis=-1)
    return light.mapping.directions(light.mapping.shown(points))


def extents_of(light: EnvironmentMap, pixels: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """The longer side of each pixel on the sphere, a chord (M,): near the rims of discs they are long and thin."""
    high = directions_of(light, pixels, down=0.99) - directions_of(light, pixels, down=0.01)
    wide = directions_of(light, pixels, right=0.99) - directions_of(light, pixels, right=0.01)
    return np.maximum(np.linalg.norm(high, axis=-1), np.linalg.norm(wide, axis=-1))


def shown(areas: np.ndarray) -> np.ndarray:
    """Where an image shows something: its solid angles are not 0, nor what rounding leaves of a disc's rim.

    A pixel whose corner the rim meets in one point, as by 3² + 4² = 5², may have 1e-15 of another's.
    """
    return areas > 1e-12 * areas.max()


def _ring(
    light: EnvironmentMap, patch: tuple[np.ndarray, np.ndarray], bright: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The pixels round a patch, in its image; in a lat-long round the seam too."""
    rows, columns = bright.shape
    near = np.zeros_like(bright)
    for down in range(-RING, RING + 1):
        for across in range(-RING, RING + 1):
            row, column = patch[0] + down, patch[1] + across
            if isinstance(light.mapping, LatLong):
                column = column % columns
            inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            near[row[inside], column[inside]] = True
    row, column = np.nonzero(near & ~bright & shown(light.mapping.solid_angles(rows)))
    return row, column
