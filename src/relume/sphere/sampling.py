"""Directions drawn by chance: evenly from a cap, by the cosine about a normal, or as often as a light map is bright.

Directions are unit vectors (N, 3), in the frame of the world; random numbers come from the generator that is given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong


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
    turn, sine = 2 * np.pi * random.random(len(axis)), np.sqrt(np.maximum(1 - cosine**2, 0))
    return in_frames(axis, np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], -1))


def by_cosine(random: np.random.Generator, normal: np.ndarray) -> np.ndarray:
    """Directions (N, 3) over the hemisphere about normals (N, 3), with density cos θ/π to the solid angle."""
    return turned_evenly(random, normal, np.sqrt(random.random(len(normal))))


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
    return turned_evenly(random, axis, 1 - height * random.random(len(axis))), 2 * np.pi * height


@dataclass(frozen=True, eq=False)
class BrightDirections:
    """Directions towards an environment map in lat-long, drawn about as often as it is bright.

    chances : (P,) of the pixels in rows; angles : (P,) their solid angles, steradians
    """

    light: EnvironmentMap
    chances: np.ndarray
    angles: np.ndarray

    @staticmethod
    def of(light: EnvironmentMap) -> BrightDirections:
        """Those of a map that is not black; raises ValueError for another mapping than lat-long."""
        if not isinstance(light.mapping, LatLong) or not np.any(light.radiance):
            raise ValueError(f"a map in {light.mapping.name} or a black one; expected a lat-long map that shines")
        # A look-up between pixels has light of both: a dark pixel beside the sun is drawn as well.
        most = light.radiance.mean(axis=-1).astype(np.float64)
        for axis in (0, 1):
            most = np.maximum(most, np.maximum(np.roll(most, 1, axis), np.roll(most, -1, axis)))
        angles = light.mapping.solid_angles(light.size).ravel()
        weight = most.ravel() * angles
        return BrightDirections(light, weight / weight.sum(), angles)

    def drawn(self, random: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Directions (N, 3), and the radiance from there over the density with which they are drawn (N, 3)."""
        size = self.light.size
        pixel = random.choice(len(self.chances), count, p=self.chances)
        row, column = np.divmod(pixel, 2 * size)
        upper, lower = np.cos(np.pi * row / size), np.cos(np.pi * (row + 1) / size)
        polar = np.arccos(upper + (lower - upper) * random.random(count)) / np.pi
        points = np.stack([(column + random.random(count)) / (2 * size), polar], axis=-1)
        towards = self.light.mapping.directions(points)
        return towards, self.light.lookup(towards) * (self.angles[pixel] / self.chances[pixel])[:, None]
