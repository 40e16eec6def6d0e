"""What a camera sees by photons: its rays go on through mirrors and glass to the first surface that scatters evenly.

There light is put together from parts that exclude each other (Jensen 1996, §5): what comes straight from lamps, by
shadow rays; what mirrors and glass gathered, from the caustic map; all else by final gathering, rays over the
hemisphere that read the global map where they arrive. In a fog points along the ray are lit in the same way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.renderers.photon_map.density import Maps
from relume.renderers.photon_map.stage import EVEN, NOTHING, Met, Stage
from relume.renderers.photon_map.tracing import encounter
from relume.renderers.raytrace.lamps import Lamp
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.sampling import by_cosine, shuffled


class Way(NamedTuple):
    """N rays at the end of their way.

    met : surfaces, or where the fog `stopped` (N,) the ray
    directions : (N, 3) of the last part of the way
    light, share : (N, 3) what came from lamps and fog on the way, and how much of what comes now is seen
    """

    met: Met
    directions: np.ndarray
    light: np.ndarray
    share: np.ndarray
    stopped: np.ndarray


@dataclass(frozen=True, eq=False)
class Gathering:
    """Maps and lamps of one pass.

    lamps : each with how many shadow rays go there from a point
    lit : lamps that are seen without being shapes of the scene, or None; sky : what is seen at infinity, or None
    rays : of final gathering at a point, 0 to look at the global map itself
    march : points along a ray in a fog; depth : mirrors and walls of glass that a ray meets at most
    """

    stage: Stage
    lamps: list[tuple[Lamp, int]]
    lit: Stage | None
    sky: EnvironmentMap | None
    maps: Maps
    rays: int
    march: int
    depth: int

    def seen(
        self, origins: np.ndarray, directions: np.ndarray, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (N, 3) along rays, and the radius (N,) of the disc of photons at what they show."""
        way = self.went(origins, directions, random, seen=True)
        light, at = way.light, np.flatnonzero(way.met.kind == EVEN)
        points, normals, true = way.met.point[at], way.met.normal[at], way.met.true_normal[at]
        radius = np.zeros(len(light))
        irradiance, radius[at] = self.maps.surface.irradiance(points, true)
        if self.rays:
            irradiance = self.direct(points, true, normals, random) + self.gathered(points, true, normals, random)
            irradiance += self.maps.caustic.irradiance(points, true)[0]
        light[at] += way.share[at] * way.met.colour[at] / np.pi * irradiance
        return light, radius

    def went(self, origins: np.ndarray, directions: np.ndarray, random: np.random.Generator, seen: bool) -> Way:
        """Rays that went on from mirrors and glass until they met something else.

        seen : by the camera: lamps are seen, and fog is added up along the way; otherwise fog ends rays by chance
        """
        count = len(origins)
        light, share, stopped = np.zeros((count, 3)), np.ones((count, 3)), np.zeros(count, bool)
        directions, point, rows, ends = directions.copy(), np.array(origins), np.arange(count), None
        for bounce in range(self.depth):
            met = self.stage.meet(point[rows], directions[rows])
            share[rows] *= self.stage.clearness(met)
            if seen:
                haze, left = self._haze(point[rows], directions[rows], met, random)
                light[rows] += share[rows] * (haze + left * self._glow(point[rows], directions[rows], met))
                share[rows] *= left
            else:
                way, stops, left = encounter(self.stage, point[rows], directions[rows], met, random)
                share[rows], stopped[rows] = share[rows] * left, stops
                met.point[stops] = point[rows][stops] + way[stops, None] * directions[rows][stops]
                met.kind[stops] = NOTHING
            if ends is None:
                ends = Met(*(part.copy() for part in met))
            for whole, part in zip(ends, met, strict=True):
                whole[rows] = part
            goes_on = (met.kind != NOTHING) & (met.kind != EVEN)
            point[rows] = met.point
            if not goes_on.any() or bounce == self.depth - 1:
                break
            ways, kept, squeezed = self.stage.glanced(directions[rows], met, random)
            rows = rows[goes_on]
            directions[rows] = ways[goes_on]
            share[rows] *= kept[goes_on] * squeezed[goes_on, None]
        assert ends is not None
        return Way(ends, directions, light, share, stopped)

    def arriving(
        self, points: np.ndarray, side: np.ndarray | float, random: np.random.Generator
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """By shadow rays from points that lie on `side` (N, 3) of a surface: directions to lamps, and irradiance."""
        for lamp, times in self.lamps:
            for _ in range(times):
                light = lamp.reaching(shuffled(random, len(points), lamp.numbers), points)
                there = self.stage.sees(points, side, light.directions, light.distance)
                _, haze = self.stage.hazy(points, light.directions, light.distance)
                yield light.directions, self.stage.left(haze) * light.irradiance * there[:, None] / times

    def direct(
        self, points: np.ndarray, true: np.ndarray, normals: np.ndarray, random: np.random.Generator
    ) -> np.ndarray:
        """Irradiance (N, 3) that comes straight from lamps."""
        found = np.zeros_like(points)
        for directions, irradiance in self.arriving(points, true, random):
            cosine = np.einsum("ij,ij->i", directions, normals) * (np.einsum("ij,ij->i", directions, true) > 0)
            found += irradiance * np.maximum(cosine, 0)[:, None]
        return found

    def gathered(
        self, points: np.ndarray, true: np.ndarray, normals: np.ndarray, random: np.random.Generator
    ) -> np.ndarray:
        """Irradiance (N, 3) that comes from other surfaces and from fog: the mean over rays drawn by the cosine."""
        found, medium = np.zeros_like(points), self.stage.medium
        if self.maps.everywhere is None:
            return found
        for _ in range(self.rays):
            directions = by_cosine(shuffled(random, len(normals), 2), normals)
            out = np.einsum("ij,ij->i", directions, true) > 0
            way = self.went(points, directions, random, seen=False)
            at = np.flatnonzero(out & (way.met.kind == EVEN))
            there = self.maps.everywhere.at(way.met.point[at], way.met.true_normal[at])
            found[at] += way.share[at] * way.met.colour[at] * there
            if medium is not None and len(at := np.flatnonzero(out & way.stopped)):
                radiance = self.maps.hanging.scattered(way.met.point[at], -way.directions[at], medium)
                found[at] += way.share[at] * np.pi * radiance / np.maximum(medium.scattering, 1e-300)
        return found / self.rays

    def _haze(
        self, origins: np.ndarray, directions: np.ndarray, met: Met, random: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (N, 3) that fog sends along rays, from lamps by shadow rays and all else from the photons in it; and
        the share (N, 3) that it lets through."""
        begin, length = self.stage.hazy(origins, directions, met.distance, met.within)
        medium, light, rows = self.stage.medium, np.zeros_like(origins), np.flatnonzero(length > 0)
        if medium is None or not any(medium.scattering):
            return light, self.stage.left(length)
        rate, ways = float(np.mean(medium.extinction)), directions[rows]
        reaches = -np.expm1(-rate * length[rows])
        for step in range(self.march):
            # Points as often as light from them comes through, one in each step.
            far = -np.log1p(-reaches * (step + random.random(len(rows))) / self.march) / rate
            points = origins[rows] + (begin[rows] + far)[:, None] * ways
            source = self.maps.indirect.scattered(points, -ways, medium)
            for towards, irradiance in self.arriving(points, 0.0, random):
                phase = medium.phase(np.einsum("ij,ij->i", towards, ways))
                source += irradiance * medium.scattering * phase[:, None]
            density = rate * np.exp(-rate * far) / reaches * self.march
            light[rows] += self.stage.left(far) * source / density[:, None]
        return light, self.stage.left(length)

    def _glow(self, origins: np.ndarray, directions: np.ndarray, met: Met) -> np.ndarray:
        """What rays see shine: the surface that they meet, a lamp before it, or the light map."""
        glow = met.glow.copy()
        if self.sky is not None:
            gone = met.kind == NOTHING
            glow[gone] = self.sky.lookup(directions[gone])
        if self.lit is not None:
            lamp = self.lit.meet(origins, directions)
            before = lamp.distance < met.distance
            glow[before] = glow[before] * lamp.inside[before, None] + lamp.glow[before]
        return glow
