"""The light of a scene in Dr.Jit: the probe's map projected onto the distant scene, and lamps, looked up and sampled.

Mitsuba's own environment map is at infinity. This one is anywhere: a direction is drawn at the probe, followed to the
distant scene, and what stands there is seen from any place, so that near walls and windows light each place as they do
(Debevec 1998, Fig. 5). Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.errors import UnsupportedScene
from relume.light.convolution import as_latlong
from relume.scene.distant import Box, Dome, Enclosure, Infinite
from relume.scene.lights import DistantLight, PointLight, SphereLight, SquareLaw
from relume.scene.scene import Scene
from relume.sphere.mappings import LatLong

UNIFORM_SHARE = 0.02
"""Of the samples of the map, drawn evenly over all directions: what is next to black pixels is not forgotten."""
BRIGHT = 4.0
"""Of the map's mean radiance: what is brighter is followed from the light where objects are smooth."""
FAR = 1e7
"""Metres: how far away what is at infinity is taken to be."""


Spheres = list[tuple[Any, float]]
"""Centres and radii of what bounds objects."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A direction towards light.

    direction : unit vector from the point
    distance : to where the light stands, metres
    weight : radiance over density; irradiance over probability for lamps without size
    density : per steradian; 0 for lamps without size, which no other sampling finds
    valid : whether there is any
    """

    direction: Any
    distance: Any
    weight: Any
    density: Any
    valid: Any


class SceneLight:
    """All the light of a scene that objects do not send themselves."""

    def __init__(self, scene: Scene) -> None:
        self.map = _Map(scene) if np.any(scene.light.radiance) else None
        # Python's own numbers: one of NumPy's times a symbolic one would be evaluated.
        self.spheres = tuple(
            replace(light, radius=float(light.radius)) for light in scene.lights if isinstance(light, SphereLight)
        )
        self.points = tuple(light for light in scene.lights if isinstance(light, PointLight))
        self.suns = tuple(light for light in scene.lights if isinstance(light, DistantLight))
        for light in self.points:
            if not isinstance(light.falloff, SquareLaw):
                raise UnsupportedScene("points of light fall with the square of the distance here; use the square law")
        middle = np.mean([(o := _bounds(s)) for s in scene.objects], axis=0) if scene.objects else np.zeros(3)
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
        if self.spheres and self.map is not None:
            # A lamp that stands before what was drawn hides it.
            from_map = density * 0 + (choice < float(self.shares[0]))
            nearest, _ = self._nearest_sphere(place, direction)
            valid &= ~((from_map > 0) & (nearest < distance))
        return Sample(direction, distance, weight, density, valid & active)

    def seen(self, place: Any, direction: Any, surface: Any, active: Any, dim: Any = False) -> tuple[Any, Any, Any]:
        """What a ray sees of light before a surface at a distance (infinity for none): radiance, density, whether any.

        dim : where only what is not `emitted` is wanted
        """
        radiance, density, any_light = mi.Color3f(0), mi.Float(0), mi.Bool(False)
        if self.map is not None:
            beyond = active & dr.isinf(surface)
            radiance, density = self.map.seen(place, direction, beyond)
            radiance, density = dr.select(beyond, radiance, 0), dr.select(beyond, density * float(self.shares[0]), 0)
            radiance = dr.select(dim, radiance * self.dimmed(radiance), radiance)
            any_light = beyond
        if self.spheres:
            nearest, which = self._nearest_sphere(place, direction)
            before = active & (nearest < surface)
            for index, sphere in enumerate(self.spheres):
                mine = before & (which == index)
                share = float(self.shares[index + (self.map is not None)])
                radiance = dr.select(mine, dr.select(dim, 0, mi.Color3f(*map(float, sphere.radiance))), radiance)
                density = dr.select(mine, share / _cap(place, sphere), density)
            any_light |= before
        return radiance, density, any_light

    def dimmed(self, radiance: Any) -> Any:
        """The share of the map's radiance that paths from the camera find through smooth objects; the rest is emitted."""
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
        found += [lambda k, w, a, b, m, s=s: _emit_sphere(k, w, a, b, s) for s in self.spheres]
        found += [lambda k, w, a, b, m, s=s: _emit_point(k, w, b, s) for s in self.points]
        found += [lambda k, w, a, b, m, s=s: _emit_sun(k, w, b, s) for s in self.suns]
        return found

    def _sources(self) -> list[Any]:
        found: list[Any] = [] if self.map is None else [self.map.sample]
        found += [lambda p, u, a, s=s: _sample_sphere(p, u, s) for s in self.spheres]
        found += [lambda p, u, a, s=s: _sample_point(p, s) for s in self.points]
        found += [lambda p, u, a, s=s: _sample_sun(s) for s in self.suns]
        return found

    def _nearest_sphere(self, place: Any, direction: Any) -> tuple[Any, Any]:
        nearest, which = mi.Float(dr.inf), mi.UInt32(0)
        for index, sphere in enumerate(self.spheres):
            away = mi.Point3f(*map(float, sphere.position)) - place
            along = dr.dot(away, direction)
            # Of the two roots the nearer; a place inside sees nothing of it.
            square = sphere.radius**2 - dr.squared_norm(away - along * direction)
            distance = along - dr.sqrt(dr.maximum(square, 0))
            closer = (square > 0) & (distance > 0) & (distance < nearest)
            nearest, which = dr.select(closer, distance, nearest), dr.select(closer, index, which)
        return nearest, which


class _Map:
    """The probe's map over its distant scene."""

    def __init__(self, scene: Scene) -> None:
        light = as_latlong(scene.light)
        pixels = light.radiance.astype(np.float32)
        rows, columns = pixels.shape[:2]
        half = columns // 2
        # A row more at each pole is the other side's, as in `IlluminationMap.look_up`.
        tall = np.concatenate([np.roll(pixels[:1], half, 1), pixels, np.roll(pixels[-1:], half, 1)])
        self.rows, self.columns = rows, columns
        self.texture = mi.Texture2f(
            mi.TensorXf(np.ascontiguousarray(tall)), wrap_mode=dr.WrapMode.Repeat, use_accel=False
        )
        flux = _between(tall).mean(-1) * LatLong().solid_angles(rows)
        self.tall, self.flux = tall, flux.sum()
        chance = flux / max(flux.sum(), 1e-300)
        self.chances = mi.DiscreteDistribution2D(chance.astype(np.float32))
        density = chance / LatLong().solid_angles(rows)
        self.density = mi.Float(np.ascontiguousarray(density, np.float32).ravel())
        self.distant = scene.distant
        self.probe = mi.Point3f(*map(float, scene.probe))
        self.enclosure = _enclosure(scene.distant) if isinstance(scene.distant, Enclosure) else None

    def prepare_emission(self, bright: float) -> float:
        """The share of the map's flux that is brighter than `bright`, whose pixels are then drawn by `emit`."""
        scale = np.maximum(1 - bright / np.maximum(self.tall.mean(-1), 1e-30), 0)
        flux = _between(self.tall * scale[..., None]).mean(-1) * LatLong().solid_angles(self.rows)
        if not flux.any():
            return 0.0
        self.bright, self.emissions = bright, mi.DiscreteDistribution2D((flux / flux.sum()).astype(np.float32))
        self.emission = mi.Float(
            np.ascontiguousarray(flux / flux.sum() / LatLong().solid_angles(self.rows), np.float32).ravel()
        )
        return float(flux.sum() / max(float(self.flux), 1e-300))

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        """A ray from the bright part of the distant scene."""
        pixel, _, within = self.emissions.sample(point, active)
        top, bottom = dr.cos(pixel.y * (np.pi / self.rows)), dr.cos((pixel.y + 1) * (np.pi / self.rows))
        up = dr.lerp(top, bottom, within.y)
        sine, cosine = dr.sincos((pixel.x + within.x) / self.columns * (2 * np.pi) - np.pi)
        flat = dr.safe_sqrt(1 - up**2)
        outward = mi.Vector3f(flat * sine, up, -flat * cosine)
        radiance = self.look_up(outward, active)
        radiance *= dr.maximum(1 - self.bright / dr.maximum(dr.mean(radiance), 1e-30), 0)
        density = dr.gather(
            mi.Float, self.emission, mi.UInt32(mi.Int32(pixel.y) * self.columns + mi.Int32(pixel.x)), active
        )
        if isinstance(self.distant, Infinite):
            return _parallel(spheres, which, aim, outward, radiance / density)
        reach, normal = self._reach(self.probe, outward, active)
        place = self.probe + reach * outward
        direction, chance = _aimed(spheres, which, aim, place)
        density *= dr.abs(dr.dot(normal, outward)) / dr.square(reach)
        flux = radiance * dr.abs(dr.dot(normal, direction)) / (density * chance)
        valid = chance > 0
        if self.enclosure is not None:
            # What a wall of the distant scene hides from an object does not light it.
            begin = place + 1e-3 * reach * direction
            first, _ = self._reach(begin, direction, active)
            nearest = mi.Float(dr.inf)
            for centre, radius in spheres:
                nearest = dr.minimum(nearest, dr.maximum(dr.norm(centre - begin) - radius, 0))
            valid &= first > nearest
        return mi.Ray3f(place, direction), dr.select(valid, flux, 0), valid

    def look_up(self, direction: Any, active: Any) -> Any:
        u = dr.atan2(direction.x, -direction.z) * dr.inv_two_pi + 0.5
        v = dr.acos(dr.clip(direction.y, -1, 1)) * dr.inv_pi
        found = self.texture.eval(mi.Point2f(u, (v * self.rows + 1) / (self.rows + 2)), active)
        return mi.Color3f(*found)

    def chance(self, direction: Any, active: Any) -> Any:
        """Density per steradian at the probe."""
        u = dr.atan2(direction.x, -direction.z) * dr.inv_two_pi + 0.5
        v = dr.acos(dr.clip(direction.y, -1, 1)) * dr.inv_pi
        column = dr.clip(mi.Int32(u * self.columns), 0, self.columns - 1)
        row = dr.clip(mi.Int32(v * self.rows), 0, self.rows - 1)
        found = dr.gather(mi.Float, self.density, mi.UInt32(row * self.columns + column), active)
        return (1 - UNIFORM_SHARE) * found + UNIFORM_SHARE / (4 * np.pi)

    def sample(self, place: Any, point: Any, active: Any) -> Sample:
        evenly = point.x < UNIFORM_SHARE
        x = dr.select(evenly, point.x / UNIFORM_SHARE, (point.x - UNIFORM_SHARE) / (1 - UNIFORM_SHARE))
        pixel, _, within = self.chances.sample(mi.Point2f(dr.minimum(x, 0.9999999), point.y), active)
        # Even in solid angle within the pixel: in its azimuth and in the cosine over its row.
        top, bottom = dr.cos(pixel.y * (np.pi / self.rows)), dr.cos((pixel.y + 1) * (np.pi / self.rows))
        up = dr.select(evenly, 1 - 2 * point.y, dr.lerp(top, bottom, within.y))
        turn = dr.select(evenly, x, (pixel.x + within.x) / self.columns) * (2 * np.pi) - np.pi
        sine, cosine = dr.sincos(turn)
        flat = dr.safe_sqrt(1 - up**2)
        ray = mi.Vector3f(flat * sine, up, -flat * cosine)
        radiance = self.look_up(ray, active)
        density = self.chance(ray, active)
        if isinstance(self.distant, Infinite):
            return Sample(ray, mi.Float(FAR), radiance / density, density, mi.Bool(True))
        reach, normal = self._reach(self.probe, ray, active)
        way = self.probe + reach * ray - place
        distance = dr.norm(way)
        direction = way / distance
        facing = dr.abs(dr.dot(normal, direction))
        density = density * dr.abs(dr.dot(normal, ray)) / dr.square(reach) * dr.square(distance) / facing
        valid = facing > 1e-6
        if self.enclosure is not None:
            # What a wall of the distant scene hides from this place is not seen from it.
            first, _ = self._reach(place, direction, active)
            valid &= first > distance * (1 - 1e-3)
        return Sample(direction, distance, dr.select(valid, radiance / density, 0), density, valid)

    def seen(self, place: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """Radiance along a ray, and the density with which `sample` would have drawn it."""
        if isinstance(self.distant, Infinite):
            return self.look_up(direction, active), self.chance(direction, active)
        distance, normal = self._reach(place, direction, active)
        way = place + distance * direction - self.probe
        reach = dr.norm(way)
        ray = way / reach
        density = self.chance(ray, active) * dr.abs(dr.dot(normal, ray)) / dr.square(reach)
        density *= dr.square(distance) / dr.maximum(dr.abs(dr.dot(normal, direction)), 1e-6)
        if self.enclosure is not None:
            first, _ = self._reach(self.probe, ray, active)
            density = dr.select(first > reach * (1 - 1e-3), density, 0)
        return self.look_up(ray, active), density

    def _reach(self, place: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """How far the distant scene is along a ray, and its normal there."""
        if isinstance(self.distant, Box):
            low, high = mi.Point3f(*map(float, self.distant.low)), mi.Point3f(*map(float, self.distant.high))
            wall = dr.select(direction > 0, high, low)
            ways = dr.select(dr.abs(direction) > 1e-9, (wall - place) / direction, FAR)
            distance = dr.min(ways)
            normal = mi.Vector3f(dr.select(ways.x == distance, 1, 0), 0, 0)
            normal.y = dr.select((ways.y == distance) & (normal.x == 0), 1, 0)
            normal.z = dr.select(normal.x + normal.y == 0, 1, 0)
            return dr.maximum(distance, 1e-6), normal
        if isinstance(self.distant, Dome):
            away = place - mi.Point3f(*map(float, self.distant.centre))
            along = dr.dot(away, direction)
            distance = -along + dr.safe_sqrt(along**2 - dr.squared_norm(away) + self.distant.radius**2)
            distance = dr.maximum(distance, 1e-6)
            return distance, (away + distance * direction) / self.distant.radius
        assert self.enclosure is not None
        ray = mi.Ray3f(place, direction)
        met = self.enclosure.ray_intersect_preliminary(ray, active=active)
        surface = met.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        hit = met.is_valid() & active
        # Through a hole the light is as from far away.
        return dr.select(hit, dr.maximum(met.t, 1e-6), FAR), dr.select(hit, surface.n, direction)


def _between(tall: np.ndarray) -> np.ndarray:
    """The mean of the bilinear look-up over each pixel: it takes an eighth of each neighbour's side."""
    wide = np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1).astype(np.float64)
    down = 0.125 * wide[:-2] + 0.75 * wide[1:-1] + 0.125 * wide[2:]
    return 0.125 * down[:, :-2] + 0.75 * down[:, 1:-1] + 0.125 * down[:, 2:]


def _enclosure(distant: Enclosure) -> Any:
    mesh = mi.Mesh("distant", len(distant.vertices), len(distant.faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(distant.vertices).astype(np.float32)
    parameters["faces"] = np.ravel(distant.faces).astype(np.uint32)
    parameters.update()
    return mi.load_dict({"type": "scene", "mesh": mesh})


def _cap(place: Any, sphere: SphereLight) -> Any:
    """The solid angle of a sphere as a place sees it: 2π(1 − cos α), exact for small α too."""
    square = sphere.radius**2 / dr.squared_norm(mi.Point3f(*map(float, sphere.position)) - place)
    return 2 * np.pi * square / (1 + dr.safe_sqrt(1 - square))


def _sample_sphere(place: Any, point: Any, sphere: SphereLight) -> Sample:
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
    cap = _cap(place, sphere)
    weight = mi.Color3f(*map(float, sphere.radiance)) * cap
    return Sample(direction, dr.maximum(distance, 0), dr.select(outside, weight, 0), 1 / cap, outside)


def _sample_point(place: Any, light: PointLight) -> Sample:
    way = mi.Point3f(*map(float, light.position)) - place
    distance = dr.norm(way)
    weight = mi.Color3f(*map(float, light.intensity)) / dr.square(distance)
    return Sample(way / distance, distance, weight, mi.Float(0), mi.Bool(True))


def _sample_sun(light: DistantLight) -> Sample:
    towards = np.asarray(light.towards, np.float64)
    direction = mi.Vector3f(*map(float, towards / np.linalg.norm(towards)))
    return Sample(direction, mi.Float(FAR), mi.Color3f(*map(float, light.irradiance)), mi.Float(0), mi.Bool(True))


def _aimed(spheres: Spheres, which: Any, point: Any, place: Any) -> tuple[Any, Any]:
    """A direction from a place into the cone of one of several spheres, and its density over all of them."""
    cones = []
    for centre, radius in spheres:
        away = centre - place
        square = dr.minimum(radius**2 / dr.squared_norm(away), 0.999999)
        cones.append((dr.normalize(away), square / (1 + dr.sqrt(1 - square))))
    axis, less = cones[0]
    for index, (direction, width) in enumerate(cones):
        mine = which >= index / len(cones)
        axis, less = dr.select(mine, direction, axis), dr.select(mine, width, less)
    down = point.x * less
    flat = dr.safe_sqrt(down * (2 - down))
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    direction = mi.Frame3f(axis).to_world(mi.Vector3f(flat * cosine, flat * sine, 1 - down))
    density = mi.Float(0)
    for axis, less in cones:
        inside = 0.5 * dr.squared_norm(direction - axis) <= less
        density += dr.select(inside, 1 / (2 * np.pi * less * len(cones)), 0)
    return direction, density


def _parallel(spheres: Spheres, which: Any, point: Any, towards: Any, radiance: Any) -> tuple[Any, Any, Any]:
    """A ray of parallel light through the disc of one of several spheres, and its flux."""
    frame = mi.Frame3f(towards)
    centre, radius = spheres[0][0], mi.Float(spheres[0][1])
    for index, (c, r) in enumerate(spheres):
        mine = which >= index / len(spheres)
        centre, radius = dr.select(mine, c, centre), dr.select(mine, r, radius)
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    flat = radius * dr.sqrt(point.x)
    through = centre + frame.to_world(mi.Vector3f(flat * cosine, flat * sine, 0))
    density = mi.Float(0)
    behind = mi.Float(0)
    for c, r in spheres:
        offset = through - c
        across = dr.squared_norm(offset - dr.dot(offset, towards) * towards)
        density += dr.select(across <= r**2, 1 / (np.pi * r**2 * len(spheres)), 0)
        behind = dr.maximum(behind, dr.norm(offset) + r)
    # Begun before all of the spheres.
    return mi.Ray3f(through + behind * towards, -towards), radiance / density, density > 0


def _emit_sphere(spheres: Spheres, which: Any, point: Any, aim: Any, sphere: SphereLight) -> tuple[Any, Any, Any]:
    normal = mi.warp.square_to_uniform_sphere(point)
    place = mi.Point3f(*map(float, sphere.position)) + sphere.radius * normal
    direction, density = _aimed(spheres, which, aim, place)
    cosine = dr.dot(normal, direction)
    valid = (cosine > 0) & (density > 0)
    flux = mi.Color3f(*map(float, sphere.radiance)) * (4 * np.pi * sphere.radius**2) * cosine / density
    return mi.Ray3f(place, direction), dr.select(valid, flux, 0), valid


def _emit_point(spheres: Spheres, which: Any, aim: Any, light: PointLight) -> tuple[Any, Any, Any]:
    place = mi.Point3f(*map(float, light.position))
    direction, density = _aimed(spheres, which, aim, place)
    return mi.Ray3f(place, direction), mi.Color3f(*map(float, light.intensity)) / density, density > 0


def _emit_sun(spheres: Spheres, which: Any, aim: Any, light: DistantLight) -> tuple[Any, Any, Any]:
    towards = np.asarray(light.towards, np.float64)
    direction = mi.Vector3f(*map(float, towards / np.linalg.norm(towards)))
    return _parallel(spheres, which, aim, direction, mi.Color3f(*map(float, light.irradiance)))


def _bounds(solid: Any) -> np.ndarray:
    from relume.scene.bounds import bounding_sphere

    return bounding_sphere(solid)[0]
