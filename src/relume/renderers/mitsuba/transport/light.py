"""The light of a scene in Dr.Jit: the map projected onto the distant scene, and lamps, looked up, sampled, sent out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.lamps import PointLamp, RectangleLamp, SphereLamp, Sun
from relume.renderers.mitsuba.transport.light_map import LightMap
from relume.renderers.mitsuba.transport.sampling import Sample, Spheres, Spread
from relume.renderers.raytrace.extent import sphere_round
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight
from relume.scene.scene import Scene

BRIGHT = 4.0
"""Of the map's mean radiance: what is brighter is followed from the light where objects are smooth."""

THIN = 1e-3
"""Share of light that a medium takes below which places in it are looked at evenly."""


class SceneLight:
    """All the light of a scene that objects do not send themselves."""

    def __init__(self, scene: Scene) -> None:
        self.map = LightMap(scene) if np.any(scene.light.radiance) else None
        spheres = [light for light in scene.lights if isinstance(light, SphereLight)]
        rectangles = [light for light in scene.lights if isinstance(light, RectangleLight)]
        points = [light for light in scene.lights if isinstance(light, PointLight)]
        suns = [light for light in scene.lights if isinstance(light, DistantLight)]
        # Lamps that a ray can meet.
        self.sized: list[Any] = [*map(SphereLamp, spheres), *map(RectangleLamp, rectangles)]
        beyond: list[Any] = [] if self.map is None else [self.map]
        self.sources: list[Any] = [*beyond, *self.sized, *map(PointLamp, points), *map(Sun, suns)]
        lit = scene.objects or scene.local
        middle = np.mean([sphere_round(shape)[0] for shape in lit], axis=0) if lit else np.zeros(3)
        # How often each is sampled: as the irradiance that it gives where the objects are.
        total = float(scene.light.total().mean())
        given = [total for _ in beyond]
        for sphere in spheres:
            away = max(float(np.linalg.norm(np.array(sphere.position) - middle)), float(sphere.radius))
            given.append(np.pi * float(np.mean(sphere.radiance)) * (float(sphere.radius) / away) ** 2)
        for rectangle in rectangles:
            away = max(float(np.linalg.norm(np.array(rectangle.position) - middle)), 0.5 * max(rectangle.size))
            given.append(float(np.mean(rectangle.radiance)) * rectangle.size[0] * rectangle.size[1] / away**2)
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
        # Of those that no path from the camera ever meets.
        self.sizeless = self.emitting * [isinstance(source, PointLamp | Sun) for source in self.sources]
        if self.sizeless.any():
            self.sizeless = self.sizeless / self.sizeless.sum()
        # Of each source the lamp, and what fills its place: `stand_in` is given its numbers.
        self.lamps = [*[None for _ in beyond], *spheres, *rectangles, *points, *suns]
        self._begun: list[Any] = [0] * len(self.sources)
        self._sampled, self._sent, self._sent_sizeless = (
            [*map(opaque.number, shares)] for shares in (self.shares, self.emitting, self.sizeless)
        )

    def stand_in(self, numbers: Sequence[int]) -> None:
        """Take the numbers of what fills the place of each of the lamps."""
        self._begun = [dr.opaque(mi.UInt32, number) for number in numbers]

    @property
    def even(self) -> bool:
        """Whether nothing in it is bright enough to be followed from where it begins."""
        return not self.emitting.any()

    @property
    def dark(self) -> bool:
        """Whether there is no light at all."""
        return not self.shares.any()

    def sample(
        self, place: Any, choice: Any, point: Any, active: Any, dim: Any = False,
        wanted: Callable[[Any], Any] | None = None,
    ) -> Sample:  # fmt: skip
        """A direction towards one of the lights, chosen by `choice`, within it by `point` (two numbers from 0 to 1).

        dim : where only what is not `emitted` is wanted
        wanted : of a direction whether it is of use (`LightMap.sample`)
        """
        direction, distance = mi.Vector3f(0, 1, 0), mi.Float(0)
        weight, density, valid = mi.Color3f(0), mi.Float(0), mi.Bool(False)
        low = 0.0
        for index, source in enumerate(self.sources):
            share = self._sampled[index]
            mine = active & (choice >= low) & ((choice < low + share) | (index == len(self.shares) - 1))
            low += share
            found = (
                source.sample(place, point, mine, wanted) if source is self.map else source.sample(place, point, mine)
            )
            if dim is not False:
                kept = self.dimmed(found.weight * found.density) if source is self.map else 0
                found = replace(found, weight=dr.select(dim, found.weight * kept, found.weight))
            direction = dr.select(mine, found.direction, direction)
            distance = dr.select(mine, found.distance, distance)
            weight = dr.select(mine, found.weight / share, weight)
            density = dr.select(mine, found.density * share, density)
            valid = dr.select(mine, found.valid, valid)
        return Sample(direction, distance, weight, density, valid & active)

    def place_on(self, ray: Any, reach: Any, rate: Any, choice: Any, point: Any) -> tuple[Any, Any, Any]:
        """Where on a ray through a medium to look for the light that `choice` is for, the density, per metre, and
        whether that is a near lamp.

        reach : where the ray ends, metres
        rate : of the medium's extinction, per metre
        For lamps that stand near evenly in the angle at which they see the ray (Kulla & Fajardo 2012), for all others
        as the ray's own light is lost.
        """
        ends = 1 - dr.exp(-rate * reach)
        thin = rate * reach < THIN
        along = dr.select(thin, point * reach, -dr.log(1 - point * ends) / dr.maximum(rate, 1e-20))
        density, lamp = self.afar(reach, rate, along), mi.Bool(False)
        low = 0.0
        for index, source in enumerate(self.sources):
            share = self._sampled[index]
            mine = (choice >= low) & ((choice < low + share) | (index == len(self.shares) - 1))
            low += share
            if source.middle is None:
                continue
            # By the angle, about the ray's nearest place to the lamp.
            away = source.middle - ray.o
            nearest = dr.dot(away, ray.d)
            height = dr.maximum(dr.norm(away - nearest * ray.d), 1e-5)
            first, last = dr.atan(-nearest / height), dr.atan((reach - nearest) / height)
            offset = height * dr.tan(dr.lerp(first, last, point))
            chance = height / (dr.maximum(last - first, 1e-9) * (dr.square(height) + dr.square(offset)))
            along = dr.select(mine, dr.clip(nearest + offset, 0, reach), along)
            density = dr.select(mine, chance, density)
            lamp |= mine
        return along, density, lamp

    def afar(self, reach: Any, rate: Any, along: Any) -> Any:
        """The density of that place, per metre, for light from afar."""
        ends = dr.maximum(1 - dr.exp(-rate * reach), 1e-20)
        even = 1 / dr.maximum(reach, 1e-20)
        return dr.select(rate * reach < THIN, even, rate * dr.exp(-rate * along) / ends)

    def arriving(
        self, place: Any, direction: Any, surface: Any, active: Any, density: Any,
        looks: int = 1, beyond: Any = 0, dim: Any = False, passed: Callable[[Any], Any] | None = None,
        lamps: Any = True,
    ) -> Any:  # fmt: skip
        """The radiance that a ray sees before a surface (at infinity for none), weighed against looking for it.

        density : of the ray's direction; 0 where it was the only way, which has all the weight
        looks : directions towards light that were looked in beside it
        beyond : lamps nearer than this are left out
        lamps : where lamps are wanted beside the map
        dim : where only what is not `emitted` is wanted
        passed : the share of light that passes a medium over a distance beyond `beyond`; all unless given

        Lamps hide nothing: what was behind them in the map was left there (`light.free_lamps`). Each light has a weight
        of its own, as each is looked for by itself (the balance heuristic, Veach & Guibas 1995).
        """
        total = mi.Color3f(0)
        if self.map is not None:
            far = active & dr.isinf(surface)
            radiance, chance = self.map.seen(place, direction, far)
            radiance = dr.select(dim, radiance * self.dimmed(radiance), radiance)
            weight = _weight(density, looks * chance * self._sampled[0])
            if passed is not None:
                weight = weight * passed(mi.Float(dr.inf))
            total += dr.select(far, radiance * weight, 0)
        for index, lamp in enumerate(self.sized):
            distance = lamp.distance(place, direction)
            share = self._sampled[index + (self.map is not None)]
            weight = _weight(density, looks * share * lamp.density(place, direction, distance))
            met = active & (distance < surface) & (distance > beyond) & ~mi.Bool(dim) & lamps
            if passed is not None:
                weight = weight * passed(distance - beyond)
            total += dr.select(met, lamp.radiance * weight, 0)
        return total

    def dimmed(self, radiance: Any) -> Any:
        """The share of the map's radiance that paths from the camera find through smooth objects; the rest is sent."""
        brightness = opaque.grey(radiance)
        return dr.select(brightness > self.bright, self.bright / dr.maximum(brightness, 1e-30), 1)

    def emitted(
        self, spheres: Spheres, spread: Spread, active: Any, sizeless: bool = False
    ) -> tuple[Any, Any, Any, Any, Any]:  # fmt: skip
        """Rays from the bright part of the light towards spheres, each with its share of the flux (Σ flux / N), whether
        there is one, whether it comes from infinity, and the number of what fills the place where it begins; of lamps
        that have no size alone where `sizeless`."""
        chosen, point, aim = (spread.pair(number) for number in range(3))
        choice, which = chosen.x, chosen.y
        ray, flux, valid = dr.zeros(mi.Ray3f), mi.Color3f(0), mi.Bool(False)
        far, begun = mi.Bool(False), mi.UInt32(0)
        shares = self.sizeless if sizeless else self.emitting
        low, last = 0.0, int(np.flatnonzero(shares)[-1])
        for index, source in enumerate(self.sources):
            if not shares[index]:
                continue
            share = (self._sent_sizeless if sizeless else self._sent)[index]
            mine = active & (choice >= low) & ((choice < low + share) | (index == last))
            low += share
            begin, sent, fine = source.emit(spheres, which, point, aim, mine)
            ray, flux = dr.select(mine, begin, ray), dr.select(mine, sent / share, flux)
            valid = dr.select(mine, fine, valid)
            far |= mine & source.parallel
            begun = dr.select(mine, self._begun[index], begun)
        return ray, flux, active & valid, far, begun

    def wall(self, place: Any, direction: Any, active: Any) -> Any:
        """How far the distant scene is along a ray."""
        assert self.map is not None  # what is dark has no walls to stick out of
        return self.map.reach(place, direction, active)[0]


def _weight(density: Any, other: Any) -> Any:
    return dr.select(density > 0, density / dr.maximum(density + other, 1e-30), 1)
