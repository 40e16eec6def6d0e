"""Lamps: how they send photons, and how much of their light reaches a point by a shadow ray.

All send photons at a ball: those that would fly past everything are not sent. A lamp at infinity sends them through the
ball's disc; one that is near sends them into the cone that the ball fills, or all round from inside it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.renderers.raytrace.alpha_coverage import repeated
from relume.scene.lights import DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.scene.materials.checks import Colour
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh, Plane, Polygon, Shape, Sphere
from relume.scene.shapes.tessellation import triangulated
from relume.sphere.directions import normalised
from relume.sphere.mappings.mapping import LatLong
from relume.sphere.sampling import BrightDirections, by_cosine, chosen, in_frames, into_ball, spread, turned_evenly

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

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        origins = np.tile(np.array(self.light.position, np.float64), (count, 1))
        directions, angle = into_ball(random, origins, *ball)
        return Sent(origins, directions, np.array(self.light.intensity) * angle[:, None] / count)

    def reaching(self, random: np.random.Generator, points: np.ndarray) -> Reaching:
        directions, distance = _towards(np.array(self.light.position) - points)
        return Reaching(directions, distance, np.array(self.light.intensity) / distance[:, None] ** 2)


@dataclass(frozen=True)
class Distant:
    """Parallel light."""

    light: DistantLight

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        far = self.reaching(random, np.empty((count, 3)))
        return _through_disc(random, far.directions, far.irradiance, ball)

    def reaching(self, random: np.random.Generator, points: np.ndarray) -> Reaching:
        towards = np.tile(normalised(self.light.towards), (len(points), 1))
        return Reaching(towards, np.full(len(points), np.inf), np.tile(self.light.irradiance, (len(points), 1)))


@dataclass(frozen=True)
class Environment:
    """The distant scene."""

    bright: BrightDirections

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        return _through_disc(random, *self.bright.drawn(random, count), ball)

    def reaching(self, random: np.random.Generator, points: np.ndarray) -> Reaching:
        towards, radiance = self.bright.drawn(random, len(points))
        return Reaching(towards, np.full(len(points), np.inf), radiance)


@dataclass(frozen=True, eq=False)
class Surface:
    """A shape that shines: triangles, drawn by their areas, or a sphere.

    emission : a colour or an image, radiance
    """

    shape: Shape
    emission: Colour | np.ndarray

    def sent(self, random: np.random.Generator, count: int, ball: Ball) -> Sent:
        origins, normal, radiance = self._drawn(random, count)
        inside = np.linalg.norm(origins - ball[0], axis=1) <= ball[1] * (1 + 1e-6)
        directions, angle = into_ball(random, origins, *ball)
        directions = np.where(inside[:, None], by_cosine(random, normal), directions)
        # Drawn by the cosine where all directions are meant; else weighed by it.
        measure = np.where(inside, np.pi, angle * np.maximum(np.einsum("ij,ij->i", directions, normal), 0))
        return Sent(origins, directions, radiance * measure[:, None] / count)

    def reaching(self, random: np.random.Generator, points: np.ndarray) -> Reaching:
        if isinstance(self.shape, Sphere):
            return self._from_ball(random, points, np.array(self.shape.centre), self.shape.radius)
        places, normal, radiance = self._drawn(random, len(points))
        directions, distance = _towards(places - points)
        facing = np.maximum(-np.einsum("ij,ij->i", directions, normal), 0)
        return Reaching(directions, distance, radiance * (facing / distance**2)[:, None])

    def _from_ball(
        self, random: np.random.Generator, points: np.ndarray, centre: np.ndarray, radius: float
    ) -> Reaching:
        """The light of a sphere, drawn by the solid angle: its far side is never in view."""
        directions, angle = into_ball(random, points, centre, radius)
        to, middle = centre - points, np.einsum("ij,ij->i", centre - points, directions)
        outside = np.einsum("ij,ij->i", to, to) - radius**2
        distance = middle - np.sqrt(np.maximum(middle**2 - outside, 0))
        normal = (distance[:, None] * directions - to) / radius
        shown = np.where(outside > 0, angle, 0.0)
        return Reaching(
            directions, np.maximum(distance, 0), painted(self.emission)(_uv_of_ball(normal)) * shown[:, None]
        )

    def _drawn(self, random: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points and their normals (N, 3), and their radiance times the shape's area."""
        glow = painted(self.emission)
        if isinstance(self.shape, Sphere):
            normal = turned_evenly(random, np.tile([0.0, 0.0, 1.0], (count, 1)), 2 * random.random(count) - 1)
            points = self.shape.centre + self.shape.radius * normal
            return points, normal, glow(_uv_of_ball(normal)) * 4 * np.pi * self.shape.radius**2
        mesh = _mesh_of(self.shape)
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = 0.5 * np.linalg.norm(across, axis=1)
        which = chosen(random, area, count)
        root, along = np.sqrt(spread(random, count)), spread(random, count)
        weights = np.stack([1 - root, root * (1 - along), root * along], -1)[:, :, None]
        points = (weights * corners[which]).sum(1)
        uv = np.zeros((count, 2)) if mesh.uv is None else (weights * mesh.uv[mesh.faces][which]).sum(1)
        return points, normalised(across[which]), glow(uv) * area.sum()


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
    return way / np.maximum(distance, 1e-300)[:, None], distance


def _uv_of_ball(normal: np.ndarray) -> np.ndarray:
    return LatLong().image_points(normal) * [1, -1] + [0, 1]


def _mesh_of(shape: Shape) -> Mesh:
    """A shape that is no sphere as triangles."""
    if isinstance(shape, Polygon):
        return triangulated(shape)
    if isinstance(shape, Plane):
        corners = np.array([[-0.5, 0, 0.5], [0.5, 0, 0.5], [0.5, 0, -0.5], [-0.5, 0, -0.5]])
        vertices = corners * [shape.extent[0], 0, shape.extent[1]] + [0, shape.height, 0]
        uv = corners[:, ::2] * [1, -1] + 0.5
        return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]]), shape.material, uv=uv)
    assert isinstance(shape, Mesh)
    return shape


def painted(value: object) -> Callable[[np.ndarray], np.ndarray]:
    """What gives a colour, or an image's, (P, 3) at texture coordinates (P, 2)."""
    image = np.asarray(value, np.float64)
    if image.ndim == 3:
        return repeated(image)
    return lambda uv: np.broadcast_to(image, (len(uv), 3))
