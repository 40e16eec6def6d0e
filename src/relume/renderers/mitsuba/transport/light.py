"""The light of a scene in Dr.Jit: the map projected onto the distant scene, and lamps, looked up, sampled, sent out."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.light_map import FAR, LightMap
from relume.renderers.mitsuba.transport.sampling import Sample, Spheres, aimed, beside, parallel
from relume.scene.lights import DistantLight, PointLight, SphereLight, SquareLaw
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import bounding_sphere
from relume.sphere.directions import normalised

BRIGHT = 4.0
"""Of the map's mean radiance: what is brighter is followed from the light where objects are smooth."""


class _SphereLamp:
    """A sphere that shines."""

    def __init__(self, light: SphereLight) -> None:
        self.centre, self.radius = opaque.sphere(light.position, light.radius)
        self.radiance = mi.Color3f(opaque.point(light.radiance))

    def distance(self, place: Any, direction: Any) -> Any:
        """How far along a ray it begins; infinity where it is missed or left from within."""
        away = self.centre - place
        along = dr.dot(away, direction)
        square = self.radius**2 - dr.squared_norm(away - along * direction)
        distance = along - dr.sqrt(dr.maximum(square, 0))
        return dr.select((square > 0) & (distance > 0), distance, dr.inf)

    def solid_angle(self, place: Any) -> Any:
        """Its solid angle as a place sees it: 2π(1 − cos α), exact for small α too."""
        square = self.radius**2 / dr.squared_norm(self.centre - place)
        return 2 * np.pi * square / (1 + dr.safe_sqrt(1 - square))

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        """Evenly over its solid angle."""
        away = self.centre - place
        square = self.radius**2 / dr.squared_norm(away)
        outside = square < 1
        # 1 − cos, so that nothing cancels for a small lamp.
        direction = beside(dr.normalize(away), point.x * square / (1 + dr.safe_sqrt(1 - square)), point.y)
        along = dr.dot(away, direction)
        distance = along - dr.safe_sqrt(self.radius**2 - dr.squared_norm(away - along * direction))
        angle = self.solid_angle(place)
        weight = dr.select(outside, self.radiance * angle, 0)
        return Sample(direction, dr.maximum(distance, 0), weight, 1 / angle, outside)

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        normal = mi.warp.square_to_uniform_sphere(point)
        place = self.centre + self.radius * normal
        direction, density = aimed(spheres, which, aim, place)
        cosine = dr.dot(normal, direction)
        valid = (cosine > 0) & (density > 0)
        flux = self.radiance * (4 * np.pi * self.radius**2) * cosine / density
        return mi.Ray3f(place, direction), dr.select(valid, flux, 0), valid


class _PointLamp:
    """A point that shines by the square law."""

    def __init__(self, light: PointLight) -> None:
        if not isinstance(light.falloff, SquareLaw):
            raise UnsupportedScene("points of light fall with the square of the distance here; use the square law")
        self.place = opaque.point(light.position)
        self.intensity = mi.Color3f(opaque.point(light.intensity))

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        way = self.place - place
        distance = dr.norm(way)
        return Sample(way / distance, distance, self.intensity / dr.square(distance), mi.Float(0), mi.Bool(True))

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        direction, density = aimed(spheres, which, aim, self.place)
        return mi.Ray3f(self.place, direction), self.intensity / density, density > 0


class _Sun:
    """Parallel light."""

    def __init__(self, light: DistantLight) -> None:
        self.direction = mi.Vector3f(opaque.point(normalised(light.towards)))
        self.irradiance = mi.Color3f(opaque.point(light.irradiance))

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        return Sample(self.direction, mi.Float(FAR), self.irradiance, mi.Float(0), mi.Bool(True))

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        return parallel(spheres, which, aim, self.direction, self.irradiance)


class SceneLight:
    """All the light of a scene that objects do not send themselves."""

    def __init__(self, scene: Scene) -> None:
        self.map = LightMap(scene) if np.any(scene.light.radiance) else None
        spheres = [light for light in scene.lights if isinstance(light, SphereLight)]
        points = [light for light in scene.lights if isinstance(light, PointLight)]
        suns = [light for light in scene.lights if isinstance(light, DistantLight)]
        self.spheres = [_SphereLamp(light) for light in spheres]
        beyond: list[Any] = [] if self.map is None else [self.map]
        self.sources: list[Any] = [*beyond, *self.spheres, *map(_PointLamp, points), *map(_Sun, suns)]
        middle = np.mean([bounding_sphere(s)[0] for s in scene.objects], axis=0) if scene.objects else np.zeros(3)
        # How often each is sampled: as the irradiance that it gives where the objects are.
        total = float(scene.light.total().mean())
        given = [total for _ in beyond]
        for sphere in spheres:
            away = max(float(np.linalg.norm(np.array(sphere.position) - middle)), float(sphere.radius))
            given.append(np.pi * float(np.mean(sphere.radiance)) * (float(sphere.radius) / away) ** 2)
        for point in points:
            away = max(float(np.linalg.norm(np.array(point.position) - middle)), 1e-3)
            given.append(float(np.mean(point.intensity)) / away**2)
        given += [float(np.mean(sun.irradiance)) for sun in suns]
        self.shares = np.array(given, np.float64)
        if self.shares.any():
            # None is forgotten, however dark it is where the objects are.
            self.shares = self.shares / self.shares.sum() + 0.02
            self.shares = self.shares / self.shares.sum()
        # Between what cones find well and what blinds: a few times the mean.
        bright = BRIGHT * total / (4 * np.pi)
        self.emitting = self.shares.copy()
        if self.map is not None:
            self.emitting[0] *= self.map.prepare_emission(bright)
        if self.emitting.any():
            self.emitting /= self.emitting.sum()
        self.bright = opaque.number(bright)
        self._sampled, self._sent = ([*map(opaque.number, shares)] for shares in (self.shares, self.emitting))

    @property
    def even(self) -> bool:
        """Whether nothing in it is bright enough to be followed from where it begins."""
        return not self.emitting.any()

    @property
    def dark(self) -> bool:
        """Whether there is no light at all."""
        return not self.shares.any()

    def sample(self, place: Any, choice: Any, point: Any, active: Any) -> Sample:
        """A direction towards one of the lights, chosen by `choice`, within it by `point` (two numbers from 0 to 1)."""
        direction, distance = mi.Vector3f(0, 1, 0), mi.Float(0)
        weight, density, valid = mi.Color3f(0), mi.Float(0), mi.Bool(False)
        low = 0.0
        for index, source in enumerate(self.sources):
            share = self._sampled[index]
            mine = active & (choice >= low) & ((choice < low + share) | (index == len(self.shares) - 1))
            low += share
            found = source.sample(place, point, mine)
            direction = dr.select(mine, found.direction, direction)
            distance = dr.select(mine, found.distance, distance)
            weight = dr.select(mine, found.weight / share, weight)
            density = dr.select(mine, found.density * share, density)
            valid = dr.select(mine, found.valid, valid)
        return Sample(direction, distance, weight, density, valid & active)

    def arriving(
        self, place: Any, direction: Any, surface: Any, active: Any, density: Any,
        looks: int = 1, beyond: Any = 0, dim: Any = False,
    ) -> Any:  # fmt: skip
        """The radiance that a ray sees before a surface (at infinity for none), weighed against looking for it.

        density : of the ray's direction; 0 where it was the only way, which has all the weight
        looks : directions towards light that were looked in beside it
        beyond : lamps nearer than this are left out
        dim : where only what is not `emitted` is wanted

        Lamps hide nothing: what was behind them in the map was left there (`light.free_lamps`). Each light has a weight
        of its own, as each is looked for by itself (the balance heuristic, Veach & Guibas 1995).
        """
        total = mi.Color3f(0)
        if self.map is not None:
            far = active & dr.isinf(surface)
            radiance, chance = self.map.seen(place, direction, far)
            radiance = dr.select(dim, radiance * self.dimmed(radiance), radiance)
            weight = _weight(density, looks * chance * self._sampled[0])
            total += dr.select(far, radiance * weight, 0)
        for index, sphere in enumerate(self.spheres):
            distance = sphere.distance(place, direction)
            share = self._sampled[index + (self.map is not None)]
            weight = _weight(density, looks * share / sphere.solid_angle(place))
            met = active & (distance < surface) & (distance > beyond) & ~mi.Bool(dim)
            total += dr.select(met, sphere.radiance * weight, 0)
        return total

    def dimmed(self, radiance: Any) -> Any:
        """The share of the map's radiance that paths from the camera find through smooth objects; the rest is sent."""
        brightness = dr.mean(radiance)
        return dr.select(brightness > self.bright, self.bright / dr.maximum(brightness, 1e-30), 1)

    def emitted(self, spheres: Spheres, rng: Any, active: Any) -> tuple[Any, Any, Any]:
        """Rays from the bright part of the light towards spheres, each with its share of the flux (Σ flux / N)."""
        choice = rng.next_float32()
        which, first, second, third, fourth = (rng.next_float32() for _ in range(5))
        ray, flux, valid = dr.zeros(mi.Ray3f), mi.Color3f(0), mi.Bool(False)
        low = 0.0
        for index, source in enumerate(self.sources):
            if not self.emitting[index]:
                continue
            share = self._sent[index]
            mine = active & (choice >= low) & ((choice < low + share) | (index == len(self.emitting) - 1))
            low += share
            point, aim = mi.Point2f(first, second), mi.Point2f(third, fourth)
            begin, sent, fine = source.emit(spheres, which, point, aim, mine)
            ray, flux = dr.select(mine, begin, ray), dr.select(mine, sent / share, flux)
            valid = dr.select(mine, fine, valid)
        return ray, flux, active & valid

    def wall(self, place: Any, direction: Any, active: Any) -> Any:
        """How far the distant scene is along a ray."""
        assert self.map is not None  # what is dark has no walls to stick out of
        return self.map.reach(place, direction, active)[0]


def _weight(density: Any, other: Any) -> Any:
    return dr.select(density > 0, density / dr.maximum(density + other, 1e-30), 1)
