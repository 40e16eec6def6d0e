"""The light of a scene in Dr.Jit: the probe's map projected onto the distant scene, and lamps, looked up and sampled.

Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.transport.aim import Sample, Spheres
from relume.renderers.mitsuba.transport.lamps import (
    cap,
    distance_to,
    emit_point,
    emit_sphere,
    emit_sun,
    sample_point,
    sample_sphere,
    sample_sun,
)
from relume.renderers.mitsuba.transport.light_map import LightMap
from relume.scene.lights import DistantLight, PointLight, SphereLight, SquareLaw
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import bounding_sphere

BRIGHT = 4.0
"""Of the map's mean radiance: what is brighter is followed from the light where objects are smooth."""


class SceneLight:
    """All the light of a scene that objects do not send themselves."""

    def __init__(self, scene: Scene) -> None:
        self.map = LightMap(scene) if np.any(scene.light.radiance) else None
        # Python's own numbers: one of NumPy's times a symbolic one would be evaluated.
        self.spheres = tuple(
            replace(light, radius=float(light.radius)) for light in scene.lights if isinstance(light, SphereLight)
        )
        self.points = tuple(light for light in scene.lights if isinstance(light, PointLight))
        self.suns = tuple(light for light in scene.lights if isinstance(light, DistantLight))
        for light in self.points:
            if not isinstance(light.falloff, SquareLaw):
                raise UnsupportedScene("points of light fall with the square of the distance here; use the square law")
        middle = np.mean([bounding_sphere(s)[0] for s in scene.objects], axis=0) if scene.objects else np.zeros(3)
        self.shares = self._shares(scene, middle)
        # Between what cones find well and what blinds: a few times the mean.
        self.bright = BRIGHT * float(scene.light.total().mean()) / (4 * np.pi)
        self.emitting = self.shares.copy()
        if self.map is not None:
            self.emitting[0] *= self.map.prepare_emission(self.bright)
        if self.emitting.any():
            self.emitting /= self.emitting.sum()

    def _shares(self, scene: Scene, place: np.ndarray) -> np.ndarray:
        """How often each is sampled: as the irradiance that it gives where the objects are."""
        given = [] if self.map is None else [float(scene.light.total().mean())]
        for sphere in self.spheres:
            away = max(float(np.linalg.norm(np.array(sphere.position) - place)), sphere.radius)
            given.append(np.pi * float(np.mean(sphere.radiance)) * (sphere.radius / away) ** 2)
        for point in self.points:
            away = max(float(np.linalg.norm(np.array(point.position) - place)), 1e-3)
            given.append(float(np.mean(point.intensity)) / away**2)
        given += [float(np.mean(sun.irradiance)) for sun in self.suns]
        # None is forgotten, however dark it is where the objects are.
        shares = np.array(given, np.float64)
        if not shares.any():
            return shares
        shares = shares / shares.sum() + 0.02
        return shares / shares.sum()

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
        for index, source in enumerate(self._sources()):
            share = float(self.shares[index])
            mine = active & (choice >= low) & ((choice < low + share) | (index == len(self.shares) - 1))
            low += share
            found = source(place, point, mine)
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
            weight = _weight(density, looks * chance * float(self.shares[0]))
            total += dr.select(far, radiance * weight, 0)
        for index, sphere in enumerate(self.spheres):
            distance = distance_to(place, direction, sphere)
            share = float(self.shares[index + (self.map is not None)])
            weight = _weight(density, looks * share / cap(place, sphere))
            met = active & (distance < surface) & (distance > beyond) & ~mi.Bool(dim)
            total += dr.select(met, mi.Color3f(*map(float, sphere.radiance)) * weight, 0)
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
        for index, source in enumerate(self._emitters()):
            share = float(self.emitting[index])
            if share == 0:
                continue
            mine = active & (choice >= low) & ((choice < low + share) | (index == len(self.emitting) - 1))
            low += share
            begin, sent, fine = source(spheres, which, mi.Point2f(first, second), mi.Point2f(third, fourth), mine)
            ray, flux = dr.select(mine, begin, ray), dr.select(mine, sent / share, flux)
            valid = dr.select(mine, fine, valid)
        return ray, flux, active & valid

    def _emitters(self) -> list[Any]:
        found: list[Any] = [] if self.map is None else [self.map.emit]
        found += [lambda k, w, a, b, m, s=s: emit_sphere(k, w, a, b, s) for s in self.spheres]
        found += [lambda k, w, a, b, m, s=s: emit_point(k, w, b, s) for s in self.points]
        found += [lambda k, w, a, b, m, s=s: emit_sun(k, w, b, s) for s in self.suns]
        return found

    def wall(self, place: Any, direction: Any, active: Any) -> Any:
        """How far the distant scene is along a ray."""
        assert self.map is not None  # what is dark has no walls to stick out of
        return self.map.reach(place, direction, active)[0]

    def _sources(self) -> list[Any]:
        found: list[Any] = [] if self.map is None else [self.map.sample]
        found += [lambda p, u, a, s=s: sample_sphere(p, u, s) for s in self.spheres]
        found += [lambda p, u, a, s=s: sample_point(p, s) for s in self.points]
        found += [lambda p, u, a, s=s: sample_sun(s) for s in self.suns]
        return found


def _weight(density: Any, other: Any) -> Any:
    return dr.select(density > 0, density / dr.maximum(density + other, 1e-30), 1)
