"""Lamps with a place of their own in Dr.Jit: sampled from where they shine to, and sent out.

Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.transport.aim import Sample, Spheres, aimed, parallel
from relume.renderers.mitsuba.transport.light_map import FAR
from relume.scene.lights import DistantLight, PointLight, SphereLight


def distance_to(place: Any, direction: Any, sphere: SphereLight) -> Any:
    """How far along a ray a sphere of light begins; infinity where it is missed or left from within."""
    away = mi.Point3f(*map(float, sphere.position)) - place
    along = dr.dot(away, direction)
    square = sphere.radius**2 - dr.squared_norm(away - along * direction)
    distance = along - dr.sqrt(dr.maximum(square, 0))
    return dr.select((square > 0) & (distance > 0), distance, dr.inf)


def cap(place: Any, sphere: SphereLight) -> Any:
    """The solid angle of a sphere as a place sees it: 2π(1 − cos α), exact for small α too."""
    square = sphere.radius**2 / dr.squared_norm(mi.Point3f(*map(float, sphere.position)) - place)
    return 2 * np.pi * square / (1 + dr.safe_sqrt(1 - square))


def sample_sphere(place: Any, point: Any, sphere: SphereLight) -> Sample:
    """Evenly over the solid angle of a sphere that shines."""
    away = mi.Point3f(*map(float, sphere.position)) - place
    square = sphere.radius**2 / dr.squared_norm(away)
    outside = square < 1
    # 1 − cos, so that nothing cancels for a small lamp.
    less = point.x * square / (1 + dr.safe_sqrt(1 - square))
    flat = dr.safe_sqrt(less * (2 - less))
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    direction = mi.Frame3f(dr.normalize(away)).to_world(mi.Vector3f(flat * cosine, flat * sine, 1 - less))
    along = dr.dot(away, direction)
    distance = along - dr.safe_sqrt(sphere.radius**2 - dr.squared_norm(away - along * direction))
    solid_angle = cap(place, sphere)
    weight = mi.Color3f(*map(float, sphere.radiance)) * solid_angle
    return Sample(direction, dr.maximum(distance, 0), dr.select(outside, weight, 0), 1 / solid_angle, outside)


def sample_point(place: Any, light: PointLight) -> Sample:
    way = mi.Point3f(*map(float, light.position)) - place
    distance = dr.norm(way)
    weight = mi.Color3f(*map(float, light.intensity)) / dr.square(distance)
    return Sample(way / distance, distance, weight, mi.Float(0), mi.Bool(True))


def sample_sun(light: DistantLight) -> Sample:
    towards = np.asarray(light.towards, np.float64)
    direction = mi.Vector3f(*map(float, towards / np.linalg.norm(towards)))
    return Sample(direction, mi.Float(FAR), mi.Color3f(*map(float, light.irradiance)), mi.Float(0), mi.Bool(True))


def emit_sphere(spheres: Spheres, which: Any, point: Any, aim: Any, sphere: SphereLight) -> tuple[Any, Any, Any]:
    normal = mi.warp.square_to_uniform_sphere(point)
    place = mi.Point3f(*map(float, sphere.position)) + sphere.radius * normal
    direction, density = aimed(spheres, which, aim, place)
    cosine = dr.dot(normal, direction)
    valid = (cosine > 0) & (density > 0)
    flux = mi.Color3f(*map(float, sphere.radiance)) * (4 * np.pi * sphere.radius**2) * cosine / density
    return mi.Ray3f(place, direction), dr.select(valid, flux, 0), valid


def emit_point(spheres: Spheres, which: Any, aim: Any, light: PointLight) -> tuple[Any, Any, Any]:
    place = mi.Point3f(*map(float, light.position))
    direction, density = aimed(spheres, which, aim, place)
    return mi.Ray3f(place, direction), mi.Color3f(*map(float, light.intensity)) / density, density > 0


def emit_sun(spheres: Spheres, which: Any, aim: Any, light: DistantLight) -> tuple[Any, Any, Any]:
    towards = np.asarray(light.towards, np.float64)
    direction = mi.Vector3f(*map(float, towards / np.linalg.norm(towards)))
    return parallel(spheres, which, aim, direction, mi.Color3f(*map(float, light.irradiance)))
