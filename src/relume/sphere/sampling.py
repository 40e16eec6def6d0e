"""Directions drawn by chance: evenly from a cap, by the cosine about a normal, or as often as a light map is bright.

Directions are unit vectors (N, 3), in the frame of the world; random numbers come from the generator that is given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bilinear import bilinear
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, continued_round


def spread(random: np.random.Generator, count: int) -> np.ndarray:
    """Numbers (N,) from 0 to 1, one in each of N equal parts, in an order by chance: their mean has little noise."""
    return (random.permutation(count) + random.random(count)) / max(count, 1)


def chosen(random: np.random.Generator, weights: np.ndarray, count: int) -> np.ndarray:
    """Which of P things (N,), each as often as its weight (P,) says, spread as `spread` does."""
    steps = np.cumsum(weights)
    return np.minimum(np.searchsorted(steps, spread(random, count) * steps[-1], side="right"), len(steps) - 1)


def in_frames(axis: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) given in frames whose third axis is the unit `axis` (N, 3), in the world (Duff et al. 2017)."""
    sign = np.copysign(1.0, axis[:, 2])
    a = -1 / (sign + axis[:, 2])
    b = axis[:, 0] * axis[:, 1] * a
    first = np.stack([1 + sign * axis[:, 0] ** 2 * a, sign * b, -sign * axis[:, 0]], -1)
    second = np.stack([b, sign + axis[:, 1] ** 2 * a, -axis[:, 1]], -1)
    return local[:, :1] * first + local[:, 1:2] * second + local[:, 2:] * axis


def turned_evenly(random: np.random.Generator, axis: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Directions (N, 3) at an angle of this cosine (N,) to the axis (N, 3), anywhere round it."""
    turn, sine = 2 * np.pi * spread(random, len(axis)), np.sqrt(np.maximum(1 - cosine**2, 0))
    return in_frames(axis, np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], -1))


def by_cosine(random: np.random.Generator, normal: np.ndarray) -> np.ndarray:
    """Directions (N, 3) over the hemisphere about normals (N, 3), with density cos θ/π to the solid angle."""
    return turned_evenly(random, normal, np.sqrt(spread(random, len(normal))))


def into_ball(
    random: np.random.Generator, origins: np.ndarray, centre: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) evenly from the cone that a ball fills as seen from origins (N, 3), and its solid angle (N,).

    From inside the ball all directions are in it.
    """
    way = centre - origins
    distance = np.linalg.norm(way, axis=1)
    sine = np.where(distance > radius, radius / np.maximum(distance, 1e-300), 1.0)
    # 1 − cos, without loss where the ball is far.
    height = np.where(distance > radius, sine**2 / (1 + np.sqrt(np.maximum(1 - sine**2, 0))), 2.0)
    axis = np.where(distance[:, None] > 0, way / np.maximum(distance, 1e-300)[:, None], [0.0, 0.0, 1.0])
    return turned_evenly(random, axis, 1 - height * spread(random, len(axis))), 2 * np.pi * height


@dataclass(frozen=True, eq=False)
class BrightDirections:
    """Directions towards an environment map in lat-long, drawn as often as it is bright between its pixels too.

    weights : (rows, columns), brightness of the pixels times the share of the sphere that they cover
    """

    light: EnvironmentMap
    weights: np.ndarray

    @staticmethod
    def of(light: EnvironmentMap) -> BrightDirections:
        """Those of a map that is not black; raises ValueError for another mapping than lat-long."""
        if not isinstance(light.mapping, LatLong) or not np.any(light.radiance):
            raise ValueError(f"a map in {light.mapping.name} or a black one; expected a lat-long map that shines")
        ring = np.sin(np.pi * (np.arange(light.size) + 0.5) / light.size)
        return BrightDirections(light, light.radiance.mean(axis=-1).astype(np.float64) * ring[:, None])

    def drawn(self, random: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Directions (N, 3), and the radiance from there over the density with which they are drawn (N, 3)."""
        rows, columns = self.weights.shape
        row, column = np.divmod(chosen(random, self.weights.ravel(), count), columns)
        # Tents about the pixels' middles add up to what bilinear look-ups see; those at a pole go on beyond it.
        x, y = (random.random((2, count)) + random.random((2, count))) + np.stack([column, row]) - 0.5
        towards = self.light.mapping.directions(np.stack([x / columns, y / rows], axis=-1))
        density = bilinear(continued_round(self.weights), x % columns + 1, y + 1) / self.weights.mean()
        measure = 2 * np.pi**2 * np.abs(np.sin(np.pi * y / rows)) / density
        return towards, self.light.lookup(towards) * measure[:, None]
