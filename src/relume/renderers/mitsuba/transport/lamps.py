"""Lamps in Dr.Jit: spheres, rectangles, points and suns, seen along rays, sampled, and sent out."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.light_map import FAR
from relume.renderers.mitsuba.transport.sampling import (
    Sample,
    Spheres,
    aimed,
    beside,
    chosen,
    cones_of,
    parallel,
    upright,
    within,
)
from relume.scene.lights import DistantLight, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.sphere.directions import normalised


class SphereLamp:
    """A sphere that shines."""

    parallel = False

    def __init__(self, light: SphereLight) -> None:
        self.centre, self.radius = opaque.sphere(light.position, light.radius)
        self.radiance = mi.Color3f(opaque.point(light.radiance))
        self.middle = self.centre

    def distance(self, place: Any, direction: Any) -> Any:
        """How far along a ray it begins; infinity where it is missed or left from within."""
        away = self.centre - place
        along = dr.dot(away, direction)
        square = self.radius**2 - dr.squared_norm(away - along * direction)
        distance = along - dr.sqrt(dr.maximum(square, 0))
        return dr.select((square > 0) & (distance > 0), distance, dr.inf)

    def density(self, place: Any, direction: Any, distance: Any) -> Any:
        """Per steradian, of `sample`."""
        return 1 / self.solid_angle(place)

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
        # From the part of it that sees anything of the sphere: a little more than half of it towards a larger one.
        caps = []
        for centre, radius in spheres:
            away = centre - self.centre
            distance = dr.maximum(dr.norm(away), 1e-9)
            caps.append((upright(away), 1 + dr.clip((radius - self.radius) / distance, 0, 1)))
        normal = beside(*chosen(caps, which, point))
        place = self.centre + self.radius * normal
        cones = cones_of(spheres, place)
        direction = beside(*chosen(cones, which, aim))
        density = mi.Float(0)
        for cap, cone in zip(caps, cones, strict=True):
            density += within(cap, normal) * within(cone, direction) / (len(spheres) * self.radius**2)
        cosine = dr.dot(normal, direction)
        valid = (cosine > 0) & (density > 0)
        return mi.Ray3f(place, direction), dr.select(valid, self.radiance * cosine / density, 0), valid


class RectangleLamp:
    """A rectangle that shines to one side."""

    parallel = False

    def __init__(self, light: RectangleLight) -> None:
        frame = light.frame
        self.middle = opaque.point(light.position)
        self.across, self.along, self.normal = (mi.Vector3f(opaque.point(frame[:, axis])) for axis in range(3))
        self.width, self.height = map(opaque.number, light.size)
        self.area = self.width * self.height
        self.radiance = mi.Color3f(opaque.point(light.radiance))

    def distance(self, place: Any, direction: Any) -> Any:
        """How far along a ray its front is; infinity where it is missed."""
        facing = -dr.dot(direction, self.normal)
        distance = dr.dot(place - self.middle, self.normal) / facing
        offset = place + distance * direction - self.middle
        on = dr.abs(dr.dot(offset, self.across)) <= self.width / 2
        on &= dr.abs(dr.dot(offset, self.along)) <= self.height / 2
        return dr.select((facing > 0) & (distance > 0) & on, distance, dr.inf)

    def density(self, place: Any, direction: Any, distance: Any) -> Any:
        """Per steradian, of `sample`."""
        facing = dr.maximum(-dr.dot(direction, self.normal), 1e-9)
        return dr.square(distance) / (self.area * facing)

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        """Evenly over its area."""
        way = self._place(point) - place
        distance = dr.maximum(dr.norm(way), 1e-9)
        direction = way / distance
        facing = -dr.dot(direction, self.normal)
        seen = facing > 1e-7  # pyright: ignore[reportOperatorIssue]
        density = self.density(place, direction, distance)
        return Sample(direction, distance, dr.select(seen, self.radiance / density, 0), density, seen)

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        place = self._place(point)
        direction, density = aimed(spheres, which, aim, place)
        cosine = dr.dot(self.normal, direction)
        valid = (cosine > 0) & (density > 0)
        return mi.Ray3f(place, direction), dr.select(valid, self.radiance * self.area * cosine / density, 0), valid

    def _place(self, point: Any) -> Any:
        return self.middle + (point.x - 0.5) * self.width * self.across + (point.y - 0.5) * self.height * self.along


class PointLamp:
    """A point that shines by the square law."""

    parallel = False

    def __init__(self, light: PointLight) -> None:
        if not isinstance(light.falloff, SquareLaw):
            raise UnsupportedScene("points of light fall with the square of the distance here; use the square law")
        self.place = opaque.point(light.position)
        self.intensity = mi.Color3f(opaque.point(light.intensity))
        self.middle = self.place

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        way = self.place - place
        distance = dr.norm(way)
        return Sample(way / distance, distance, self.intensity / dr.square(distance), mi.Float(0), mi.Bool(True))

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        direction, density = aimed(spheres, which, aim, self.place)
        return mi.Ray3f(self.place, direction), self.intensity / density, density > 0


class Sun:
    """Parallel light."""

    middle, parallel = None, True

    def __init__(self, light: DistantLight) -> None:
        self.direction = mi.Vector3f(opaque.point(normalised(light.towards)))
        self.irradiance = mi.Color3f(opaque.point(light.irradiance))

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        return Sample(self.direction, mi.Float(FAR), self.irradiance, mi.Float(0), mi.Bool(True))

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        return parallel(spheres, which, aim, self.direction, self.irradiance)
