"""What a camera sees by photons: its rays go on through mirrors and glass to the first surface that scatters evenly.

There light is put together from parts that exclude each other (Jensen 1996, §5): what comes straight from lamps, by
shadow rays; what mirrors and glass gathered, from the caustic map; all else by final gathering, rays over the
hemisphere that read the global map where they arrive. In a fog points along the ray are lit in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.renderers.photon_map.density import Density, Everywhere
from relume.renderers.photon_map.lamps import Environment, Lamp, Surface
from relume.renderers.photon_map.stage import EVEN, NOTHING, Met, Stage
from relume.renderers.photon_map.tracing import encounter
from relume.sphere.sampling import by_cosine


class Way(NamedTuple):
    """Rays at the end of their way: what they met, their direction and what came to them from lamps and fog as they
    went, and the share of what comes now that is seen; with whether it was fog that ended them, and where."""

    met: Met
    directions: np.ndarray
    light: np.ndarray
    share: np.ndarray
    stopped: np.ndarray
    point: np.ndarray


@dataclass(frozen=True, eq=False)
class Gathering:
    """Maps and lamps of one pass.

    lit : lamps that are seen without being shapes of the scene, or None; environment : what is seen at infinity
    surface, caustic : photons on surfaces, all of them and those of caustics; `everywhere` is read by gathered rays
    hanging, indirect : photons in the fog, all and those that did not come straight from a lamp
    rays : of final gathering at a point, 0 to look at the global map itself
    shadows, march : shadow rays to each lamp with a size, and points along a ray in a fog
    """

    stage: Stage
    lamps: tuple[Lamp, ...]
    lit: Stage | None
    environment: Environment | None
    surface: Density
    caustic: Density
    everywhere: Everywhere | None
    hanging: Density
    indirect: Density
    rays: int
    shadows: int
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
        irradiance, radius[at] = self.surface.irradiance(points, true)
        if self.rays:
            irradiance = self.direct(points, true, normals, random) + self.gathered(points, true, normals, random)
            irradiance += self.caustic.irradiance(points, true)[0]
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
                begin, length = self.stage.hazy(point[rows], directions[rows], met.distance, met.within)
                light[rows] += share[rows] * self._fog(point[rows], directions[rows], begin, length, random)
                share[rows] *= self.stage.left(length)
                light[rows] += share[rows] * self._glow(point[rows], directions[rows], met)
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
        return Way(ends, directions, light, share, stopped, point)

    def direct(
        self, points: np.ndarray, true: np.ndarray, normals: np.ndarray, random: np.random.Generator
    ) -> np.ndarray:
        """Irradiance (N, 3) that comes straight from lamps, by shadow rays."""
        found = np.zeros_like(points)
        for lamp, times in self._shadow_rays():
            for _ in range(times):
                light = lamp.reaching(random, points)
                cosine = np.maximum(np.einsum("ij,ij->i", light.directions, normals), 0)
                lit = (cosine > 0) & (np.einsum("ij,ij->i", light.directions, true) > 0) & light.irradiance.any(1)
                at = np.flatnonzero(lit)
                there = self.stage.sees(points[at], true[at], light.directions[at], light.distance[at])
                _, haze = self.stage.hazy(points[at], light.directions[at], light.distance[at])
                arrives = self.stage.left(haze) * light.irradiance[at] / times
                found[at] += arrives * (there * cosine[at])[:, None]
        return found

    def gathered(
        self, points: np.ndarray, true: np.ndarray, normals: np.ndarray, random: np.random.Generator
    ) -> np.ndarray:
        """Irradiance (N, 3) that comes from other surfaces and from fog: the mean over rays drawn by the cosine."""
        found, medium = np.zeros_like(points), self.stage.medium
        if self.everywhere is None:
            return found
        for _ in range(self.rays):
            directions = by_cosine(random, normals)
            out = np.einsum("ij,ij->i", directions, true) > 0
            way = self.went(points, directions, random, seen=False)
            at = np.flatnonzero(out & (way.met.kind == EVEN))
            there = self.everywhere.at(way.met.point[at], way.met.true_normal[at])
            found[at] += way.share[at] * way.met.colour[at] * there
            if medium is not None and len(at := np.flatnonzero(out & way.stopped)):
                radiance = self.hanging.scattered(way.point[at], -way.directions[at], medium)
                found[at] += way.share[at] * np.pi * radiance / np.maximum(medium.scattering, 1e-300)
        return found / self.rays

    def _fog(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        begin: np.ndarray,
        length: np.ndarray,
        random: np.random.Generator,
    ) -> np.ndarray:
        """Radiance (N, 3) that fog sends along rays: from lamps by shadow rays, all else from the photons in it."""
        medium, light, rows = self.stage.medium, np.zeros_like(origins), np.flatnonzero(length > 0)
        if medium is None or not any(medium.scattering):
            return light
        rate, directions = float(np.mean(medium.extinction)), directions[rows]
        reaches = -np.expm1(-rate * length[rows])
        for step in range(self.march):
            # Points as often as light from them comes through, one in each step.
            way = -np.log1p(-reaches * (step + random.random(len(rows))) / self.march) / rate
            points = origins[rows] + (begin[rows] + way)[:, None] * directions
            source = self.indirect.scattered(points, -directions, medium)
            for lamp, times in self._shadow_rays():
                for _ in range(times):
                    lit = lamp.reaching(random, points)
                    cosine = np.einsum("ij,ij->i", lit.directions, directions)
                    there = self.stage.sees(points, 0.0, lit.directions, lit.distance)
                    _, haze = self.stage.hazy(points, lit.directions, lit.distance)
                    arrives = self.stage.left(haze) * lit.irradiance * medium.scattering / times
                    source += arrives * (there * medium.phase(cosine))[:, None]
            density = rate * np.exp(-rate * way) / reaches * self.march
            light[rows] += self.stage.left(way) * source / density[:, None]
        return light

    def _shadow_rays(self) -> list[tuple[Lamp, int]]:
        return [(lamp, self.shadows if isinstance(lamp, Surface | Environment) else 1) for lamp in self.lamps]

    def _glow(self, origins: np.ndarray, directions: np.ndarray, met: Met) -> np.ndarray:
        """What rays see shine: the surface that they meet, a lamp before it, or the light map."""
        glow = met.glow.copy()
        gone = met.kind == NOTHING
        if self.environment is not None:
            glow[gone] = self.environment.bright.light.lookup(directions[gone])
        if self.lit is not None:
            lamp = self.lit.meet(origins, directions)
            before = lamp.distance < met.distance
            glow[before] = glow[before] * lamp.inside[before, None] + lamp.glow[before]
        return glow
