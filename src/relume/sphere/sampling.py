"""Directions and points drawn by chance: from a cap, by the cosine, over triangles, or as often as a map is bright.

Directions are unit vectors, in the frame of the world. Everything is drawn by numbers u in [0, 1) that are given: from
`shuffled` where many things are drawn once each, from `sequences` where each of many things is drawn several times.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.image.bilinear import bilinear
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, continued_round


def shuffled(random: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Numbers (count, dimensions) in [0, 1); in each column one in each of `count` equal parts, in an order by chance.

    A column's mean has little noise (Latin hypercube sampling, McKay et al. 1979).
    """
    u = np.empty((count, dimensions))
    for column in range(dimensions):
        u[:, column] = (random.permutation(count) + random.random(count)) / max(count, 1)
    return np.minimum(u, 1 - 2.0**-53)


def sequences(random: np.random.Generator, count: int, dimensions: int, sets: int = 1) -> np.ndarray:
    """`sets` sequences of `count` points that fill a square or a cube evenly: (sets, count, dimensions) in [0, 1).

    Kronecker sequences, each shifted by itself (Cranley and Patterson 1976), whose steps are generalised golden ratios
    (Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018). Each number alone is uniform, so that
    what is summed with them has no bias.
    """
    # The root of x^(d+1) = x + 1.
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    points = (np.arange(1, count + 1)[:, None] * steps) % 1
    return (points + random.random((sets, 1, dimensions))) % 1


def chosen(u: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Which of P things (N,), each as often as its weight says; steps : (P,) the running sums of the weights."""
    # Rounded up to the sum itself it would be behind the last.
    return np.searchsorted(steps, np.minimum(u * steps[-1], np.nextafter(steps[-1], 0)), side="right")


def frames(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (…, 3) across each unit axis (…, 3) and each other (Duff et al. 2017)."""
    x, y, z = np.moveaxis(axis, -1, 0)
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    first = np.stack([1 + sign * x**2 * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y**2 * a, -y], axis=-1)
    return first, second


def in_frames(axis: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) given in frames whose third axis is the unit `axis` (N, 3), in the world."""
    first, second = frames(axis)
    return local[:, :1] * first + local[:, 1:2] * second + local[:, 2:] * axis


def turned_evenly(u: np.ndarray, axis: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Directions (N, 3) at an angle of this cosine (N,) to the axis (N, 3), anywhere round it by u (N,)."""
    turn, sine = 2 * np.pi * u, np.sqrt(np.maximum(1 - cosine**2, 0))
    return in_frames(axis, np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], -1))


def by_cosine(u: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Directions (N, 3) over the hemisphere about normals (N, 3), with density cos θ/π; u : (N, 2)."""
    return turned_evenly(u[:, 1], normal, np.sqrt(u[:, 0]))


def into_ball(u: np.ndarray, origins: np.ndarray, centre: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 3) evenly from the cone that a ball fills as seen from origins (N, 3), and its solid angle (N,).

    From inside the ball all directions are in it; u : (N, 2).
    """
    way = centre - origins
    distance = np.linalg.norm(way, axis=1)
    sine = np.where(distance > radius, radius / np.maximum(distance, 1e-300), 1.0)
    # 1 − cos, without loss where the ball is far.
    height = np.where(distance > radius, sine**2 / (1 + np.sqrt(np.maximum(1 - sine**2, 0))), 2.0)
    axis = np.where(distance[:, None] > 0, way / np.maximum(distance, 1e-300)[:, None], [0.0, 0.0, 1.0])
    return turned_evenly(u[:, 1], axis, 1 - height * u[:, 0]), 2 * np.pi * height


def within_triangles(u: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) spread evenly over triangles (N, 3, 3), and their weights (N, 3); u : (N, 2)."""
    root = np.sqrt(u[:, 0])
    weights = np.stack([1 - root, root * (1 - u[:, 1]), root * u[:, 1]], axis=-1)
    return np.einsum("nk,nkx->nx", weights, corners), weights


@dataclass(frozen=True, eq=False)
class BrightDirections:
    """Directions towards an environment map in lat-long, drawn as often as it is bright between its pixels too.

    For sums over what `EnvironmentMap.lookup` sees, which is bilinear: a sun's light reaches into the next pixels,
    where `light.sampling.EnvironmentSampler`, for pixels that are even patches, of any mapping, hardly ever looks.

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

    def drawn(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Directions (N, 3) by u (N, 2), and the radiance from there over the density with which they come (N, 3).

        The second number chooses the row, the first the place along it, so that even numbers stay even on the map.
        """
        rows, columns = self.weights.shape
        steps, ends = self._steps[1:], self._steps[columns::columns]
        row = chosen(u[:, 1], ends)
        low = self._steps[row * columns]
        share = ends[row] - low
        along = np.minimum(low + u[:, 0] * share, np.nextafter(ends[row], 0))
        pixel = np.searchsorted(steps, along, side="right")
        # What is left of the numbers that chose the pixel is the place in it.
        left = np.stack([(along - self._steps[pixel]) / (steps[pixel] - self._steps[pixel]),
                         (u[:, 1] * ends[-1] - low) / share])  # fmt: skip
        left = np.clip(left, 0, 1)
        # Tents about the pixels' middles add up to what bilinear look-ups see; those at a pole go on beyond it.
        tents = np.where(left < 0.5, np.sqrt(2 * left), 2 - np.sqrt(2 * (1 - left)))
        x, y = tents + np.stack([pixel % columns, row]) - 0.5
        towards = self.light.mapping.directions(np.stack([x / columns, y / rows], axis=-1))
        density = bilinear(self._round, x % columns + 1, y + 1) / self.weights.mean()
        measure = 2 * np.pi**2 * np.abs(np.sin(np.pi * y / rows)) / density
        return towards, self.light.lookup(towards) * measure[:, None]

    @cached_property
    def _steps(self) -> np.ndarray:
        """Running sums of the weights, row after row, from 0."""
        return np.concatenate([[0.0], np.cumsum(self.weights)])

    @cached_property
    def _round(self) -> np.ndarray:
        return continued_round(self.weights)
