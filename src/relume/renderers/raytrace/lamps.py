"""Lamps: how they send photons, and how much of their light reaches a point by a shadow ray.

All send photons at a ball: those that would fly past everything are not sent. A lamp at infinity sends them through the
ball's disc; one that is near sends them into the cone that the ball fills, or all round from inside it.

`numbers` of a lamp says how many numbers in [0, 1) `reaching` takes for a point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from relume.image.colour import luminance
from relume.renderers.raytrace.alpha_coverage import repeated
from relume.scene.lights import DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.scene.materials.checks import Colour
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Polygon, Shape, Sphere
from relume.scene.shapes.tessellation import as_mesh
from relume.sphere.directions import normalised
from relume.sphere.mappings.mapping import LatLong
from relume.sphere.sampling import (
    BrightDirections,
    by_cosine,
    chosen,
    in_frames,
    into_ball,
    shuffled,
    turned_evenly,
    within_triangles,
)

Ball = tuple[np.ndarray, float]
"""Centre (3,) and radius, metres, of a sphere."""


class Sent(NamedTuple):
    """N photons on their way: where from and unit directions (N, 3), and the power of each (N, 3).

    Their powers add up to the lamp's flux into the ball.
    """

    origins: np.ndarray
    directions: np.ndarray
    power: np.ndarray


class Reaching(NamedTuple):
    """Light at N points by one sample each: from which unit directions (N, 3), how far away its lamp is, metres (N,),
    and the irradiance (N, 3) on a surface that faces it, where nothing stands between."""

    directions: np.ndarray
    distance: np.ndarray
    irradiance: np.ndarray


@dataclass(frozen=True)
class Point:
    """A point that shines alike in all directions."""

    light: PointLight
    numbers: ClassVar[int] = 0

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        origins = np.tile(np.array(self.light.position, np.float64), (count, 1))
        directions, angle = into_ball(shuffled(random, count, 2), origins, *ball)
        return Sent(origins, directions, np.array(self.light.intensity) * angle[:, None] / count)

    def reaching(self, u: np.ndarray, points: np.ndarray) -> Reaching:
        directions, distance = _towards(np.array(self.light.position) - points)
        return Reaching(directions, distance, np.array(self.light.intensity) * self.light.falloff.at(distance)[:, None])


@dataclass(frozen=True)
class Distant:
    """Parallel light."""

    light: DistantLight
    numbers: ClassVar[int] = 0

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        far = self.reaching(np.empty((count, 0)), np.empty((count, 3)))
        return _through_disc(random, far.directions, far.irradiance, ball)

    def reaching(self, u: np.ndarray, points: np.ndarray) -> Reaching:
        towards = np.tile(normalised(self.light.towards), (len(points), 1))
        return Reaching(towards, np.full(len(points), np.inf), np.tile(self.light.irradiance, (len(points), 1)))


@dataclass(frozen=True)
class Environment:
    """The distant scene."""

    bright: BrightDirections
    numbers: ClassVar[int] = 2

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        return _through_disc(random, *self.bright.drawn(shuffled(random, count, 2)), ball)

    def reaching(self, u: np.ndarray, points: np.ndarray) -> Reaching:
        towards, radiance = self.bright.drawn(u)
        return Reaching(towards, np.full(len(points), np.inf), radiance)


@dataclass(frozen=True, eq=False)
class Surface:
    """A shape that shines: triangles, drawn by their areas, or a sphere.

    emission : a colour or an image, radiance
    """

    shape: Shape
    emission: Colour | np.ndarray
    numbers: ClassVar[int] = 3

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        origins, normal, radiance = self._drawn(shuffled(random, count, 3))
        inside = np.linalg.norm(origins - ball[0], axis=1) <= ball[1] * (1 + 1e-6)
        directions, angle = into_ball(shuffled(random, count, 2), origins, *ball)
        directions = np.where(inside[:, None], by_cosine(shuffled(random, count, 2), normal), directions)
        # Drawn by the cosine where all directions are meant; else weighed by it.
        measure = np.where(inside, np.pi, angle * np.maximum(np.einsum("ij,ij->i", directions, normal), 0))
        return Sent(origins, directions, radiance * measure[:, None] / count)

    def reaching(self, u: np.ndarray, points: np.ndarray) -> Reaching:
        if isinstance(self.shape, Sphere):
            return self._from_ball(u, points, np.array(self.shape.centre), self.shape.radius)
        places, normal, radiance = self._drawn(u)
        directions, distance = _towards(places - points)
        facing = np.maximum(-np.einsum("ij,ij->i", directions, normal), 0)
        return Reaching(directions, distance, radiance * (facing / distance**2)[:, None])

    @property
    def flux(self) -> float:
        """What it sends out, by luminance; of an image by its mean."""
        area = 4 * np.pi * self.shape.radius**2 if isinstance(self.shape, Sphere) else self._triangles[3][-1]
        return float(np.pi * area * luminance(np.asarray(self.emission, np.float64).reshape(-1, 3).mean(axis=0)))

    def _from_ball(self, u: np.ndarray, points: np.ndarray, centre: np.ndarray, radius: float) -> Reaching:
        """The light of a sphere, drawn by the solid angle: its far side is never in view."""
        directions, angle = into_ball(u, points, centre, radius)
        to, middle = centre - points, np.einsum("ij,ij->i", centre - points, directions)
        outside = np.einsum("ij,ij->i", to, to) - radius**2
        distance = middle - np.sqrt(np.maximum(middle**2 - outside, 0))
        normal = (distance[:, None] * directions - to) / radius
        shown = np.where(outside > 0, angle, 0.0)
        return Reaching(
            directions, np.maximum(distance, 0), painted(self.emission)(_uv_of_ball(normal)) * shown[:, None]
        )

    def _drawn(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and their normals (N, 3) by u (N, 3), and their radiance times the shape's area."""
        glow = painted(self.emission)
        if isinstance(self.shape, Sphere):
            normal = turned_evenly(u[:, 1], np.tile([0.0, 0.0, 1.0], (len(u), 1)), 2 * u[:, 0] - 1)
            points = self.shape.centre + self.shape.radius * normal
            return points, normal, glow(_uv_of_ball(normal)) * 4 * np.pi * self.shape.radius**2
        corners, uv, normals, steps = self._triangles
        which = chosen(u[:, 0], steps)
        points, weights = within_triangles(u[:, 1:], corners[which])
        return points, normals[which], glow(np.einsum("nk,nkx->nx", weights, uv[which])) * steps[-1]

    @cached_property
    def _triangles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Of T triangles with an area: corners (T, 3, 3), uv (T, 3, 2), unit normals (T, 3), sums of areas (T,)."""
        mesh = as_mesh(self.shape)
        corners = np.asarray(mesh.vertices, np.float64)[mesh.faces]
        uv = np.zeros((len(corners), 3, 2)) if mesh.uv is None else np.asarray(mesh.uv, np.float64)[mesh.faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * np.linalg.norm(across, axis=1)
        there = area > 0
        return corners[there], uv[there], normalised(across[there]), np.cumsum(area[there])


Lamp = Point | Distant | Environment | Surface


def lamp_of(light: Light) -> Lamp | None:
    """A light of a scene as a lamp; None for light that falls otherwise than by the square law, or is everywhere."""
    if isinstance(light, PointLight) and isinstance(light.falloff, SquareLaw):
        return Point(light)
    if isinstance(light, DistantLight):
        return Distant(light)
    if isinstance(light, SphereLight | RectangleLight):
        shell = Material((0.0, 0.0, 0.0), specular=0.0, emission=light.radiance)
        if isinstance(light, SphereLight):
            return Surface(Sphere(light.position, light.radius, shell), light.radiance)
        across, up = (light.frame[:, i] * light.size[i] / 2 for i in (0, 1))
        corners = light.position + np.array([-across - up, across - up, across + up, up - across])
        return Surface(Polygon(corners, shell), light.radiance)
    return None


def _through_disc(random: np.random.Generator, towards: np.ndarray, strength: np.ndarray, ball: Ball) -> Sent:
    """Photons from infinity, evenly over the disc of the ball across their way; `strength` (N, 3) is to its area."""
    count, (centre, radius) = len(towards), ball
    spread, turn = radius * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    local = np.stack([spread * np.cos(turn), spread * np.sin(turn), np.full(count, radius)], -1)
    return Sent(centre + in_frames(towards, local), -towards, strength * (np.pi * radius**2 / count))


def _towards(way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    distance = np.linalg.norm(way, axis=1)
    distance = np.maximum(distance, 1e-150)
    return way / distance[:, None], distance


def _uv_of_ball(normal: np.ndarray) -> np.ndarray:
    return LatLong().image_points(normal) * [1, -1] + [0, 1]


def painted(value: object) -> Callable[[np.ndarray], np.ndarray]:
    """What gives a colour, or an image's, (P, 3) at texture coordinates (P, 2)."""
    image = np.asarray(value, np.float64)
    if image.ndim == 3:
        return repeated(image)
    return lambda uv: np.broadcast_to(image, (len(uv), 3))
