"""The probe's map over its distant scene in Dr.Jit: looked up, sampled, and sent out.

Mitsuba's own environment map is at infinity. This one is anywhere: a direction is drawn at the probe, followed to the
distant scene, and what stands there is seen from any place, so that near walls and windows light each place as they do
(Debevec 1998, Fig. 5).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.light.reflection.convolution import as_latlong
from relume.renderers.mitsuba.arrays import triangles
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.sampling import Sample, Spheres, aimed, parallel
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Dome, Enclosure, Infinite, Scene
from relume.scene.shapes.shapes import Mesh
from relume.sphere.mappings.mapping import LatLong, continued_round

UNIFORM_SHARE = 0.02
"""Of the samples of the map, drawn evenly over all directions: what is next to black pixels is not forgotten."""
FAR = 1e7
"""Metres: how far away what is at infinity is taken to be."""

SMALL = (128, 256)
"""Rows and columns up to which the pixels of all maps are drawn by the same kernels."""


class LightMap:
    """The probe's map over its distant scene."""

    middle = None

    def __init__(self, scene: Scene) -> None:
        # A row more at each pole is the other side's, as in `EnvironmentMap.lookup`.
        self.tall = np.ascontiguousarray(continued_round(as_latlong(scene.light).radiance)[:, 1:-1])
        self._remember_size(len(self.tall) - 2, self.tall.shape[1])
        colours = mi.TensorXf(self.tall)
        self.texture = mi.Texture2f(  # pyright: ignore[reportCallIssue]
            colours, wrap_mode=dr.WrapMode.Repeat, use_accel=False
        )
        self.grey = _mean_of_channels(self.tall)
        self.flux, self.chances, self.density = _by_flux(self.grey)
        self.distant = scene.distant
        self.parallel = isinstance(scene.distant, Infinite)
        self.probe = opaque.point(scene.probe)
        if isinstance(scene.distant, Box):
            self.low, self.high = opaque.point(scene.distant.low), opaque.point(scene.distant.high)
        if isinstance(scene.distant, Dome):
            self.centre, self.radius = opaque.sphere(scene.distant.centre, scene.distant.radius)
        self.enclosure = None
        if isinstance(scene.distant, Enclosure):
            mesh = Mesh(scene.distant.vertices, scene.distant.faces, Diffuse((0.0, 0.0, 0.0)), name="distant")
            self.enclosure = mi.load_dict({"type": "scene", "mesh": triangles(mi, mesh, {})})

    def _remember_size(self, rows: int, columns: int) -> None:
        """Without the rows at the poles: a map of another size would else have kernels of its own."""
        self.rows, self.tall_rows, self.columns = map(opaque.number, (rows, rows + 2, columns))
        self.row_angle = opaque.number(np.pi / rows)
        self.last_row, self.stride = (dr.opaque(mi.Int32, each) for each in (rows - 1, columns))

    def prepare_emission(self, bright: float) -> float:
        """The share of the map's flux that is brighter than `bright`, whose pixels are then drawn by `emit`."""
        beyond = np.maximum(self.grey - bright, 0)
        if not beyond.any():
            return 0.0
        flux, self.emissions, self.emission = _by_flux(beyond)
        self.bright = opaque.number(bright)
        return flux / max(self.flux, 1e-300)

    def emit(self, spheres: Spheres, which: Any, point: Any, aim: Any, active: Any) -> tuple[Any, Any, Any]:
        """A ray from the bright part of the distant scene."""
        pixel, _, within = self.emissions.sample(point, active)
        outward = _outward(*self._within(pixel, within))
        radiance = self.lookup(outward, active)
        radiance *= dr.maximum(1 - self.bright / dr.maximum(opaque.grey(radiance), 1e-30), 0)
        density = dr.gather(
            mi.Float, self.emission, mi.UInt32(mi.Int32(pixel.y) * self.stride + mi.Int32(pixel.x)), active
        )
        if isinstance(self.distant, Infinite):
            return parallel(spheres, which, aim, outward, radiance / density)
        reach, normal = self.reach(self.probe, outward, active)
        place = self.probe + reach * outward
        direction, chance = aimed(spheres, which, aim, place)
        density *= dr.abs(dr.dot(normal, outward)) / dr.square(reach)
        flux = radiance * dr.abs(dr.dot(normal, direction)) / (density * chance)
        valid = chance > 0
        if self.enclosure is not None:
            # What a wall of the distant scene hides from an object does not light it.
            begin = place + 1e-3 * reach * direction
            first, _ = self.reach(begin, direction, active)
            nearest = mi.Float(dr.inf)
            for centre, radius in spheres:
                nearest = dr.minimum(nearest, dr.maximum(dr.norm(centre - begin) - radius, 0))
            valid &= first > nearest
        return mi.Ray3f(place, direction), dr.select(valid, flux, 0), valid

    def _within(self, pixel: Any, within: Any) -> tuple[Any, Any]:
        """Even in solid angle within a pixel: the cosine over its row, and the azimuth as a share of a turn."""
        top, bottom = dr.cos(pixel.y * self.row_angle), dr.cos((pixel.y + 1) * self.row_angle)
        return dr.lerp(top, bottom, within.y), (pixel.x + within.x) / self.columns

    def lookup(self, direction: Any, active: Any) -> Any:
        u, v = _image_point(direction)
        found = self.texture.eval(mi.Point2f(u, (v * self.rows + 1) / self.tall_rows), active)
        return mi.Color3f(*found)

    def chance(self, direction: Any, active: Any) -> Any:
        """Density per steradian at the probe."""
        u, v = _image_point(direction)
        column = dr.clip(mi.Int32(u * self.columns), 0, self.stride - 1)
        row = dr.clip(mi.Int32(v * self.rows), 0, self.last_row)
        found = dr.gather(mi.Float, self.density, mi.UInt32(row * self.stride + column), active)
        return (1 - UNIFORM_SHARE) * found + UNIFORM_SHARE / (4 * np.pi)

    def sample(self, place: Any, point: Any, active: Any, wanted: Callable[[Any], Any] | None = None) -> Sample:
        """A direction towards the distant scene.

        wanted : of a direction whether it is of use; what it shows is not looked up elsewhere
        """
        evenly = point.x < UNIFORM_SHARE
        x = dr.select(evenly, point.x / UNIFORM_SHARE, (point.x - UNIFORM_SHARE) / (1 - UNIFORM_SHARE))
        pixel, _, within = self.chances.sample(mi.Point2f(dr.minimum(x, 0.9999999), point.y), active)
        up, turn = self._within(pixel, within)
        ray = _outward(dr.select(evenly, 1 - 2 * point.y, up), dr.select(evenly, x, turn))
        if isinstance(self.distant, Infinite):
            active = active if wanted is None else active & wanted(ray)
            density = self.chance(ray, active)
            return Sample(ray, mi.Float(FAR), self.lookup(ray, active) / density, density, mi.Bool(True))
        reach, normal = self.reach(self.probe, ray, active)
        way = self.probe + reach * ray - place
        distance = dr.norm(way)
        direction = way / distance
        active = active if wanted is None else active & wanted(direction)
        radiance, density = self.lookup(ray, active), self.chance(ray, active)
        facing = dr.abs(dr.dot(normal, direction))
        density = density * dr.abs(dr.dot(normal, ray)) / dr.square(reach) * dr.square(distance) / facing
        valid = facing > 1e-6  # pyright: ignore[reportOperatorIssue]
        if self.enclosure is not None:
            # What a wall of the distant scene hides from this place is not seen from it.
            first, _ = self.reach(place, direction, active)
            valid &= first > distance * (1 - 1e-3)
        return Sample(direction, distance, dr.select(valid, radiance / density, 0), density, valid)

    def seen(self, place: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """Radiance along a ray, and the density with which `sample` would have drawn it."""
        if isinstance(self.distant, Infinite):
            return self.lookup(direction, active), self.chance(direction, active)
        distance, normal = self.reach(place, direction, active)
        way = place + distance * direction - self.probe
        reach = dr.norm(way)
        ray = way / reach
        density = self.chance(ray, active) * dr.abs(dr.dot(normal, ray)) / dr.square(reach)
        density *= dr.square(distance) / dr.maximum(dr.abs(dr.dot(normal, direction)), 1e-6)
        if self.enclosure is not None:
            first, _ = self.reach(self.probe, ray, active)
            density = dr.select(first > reach * (1 - 1e-3), density, 0)
        return self.lookup(ray, active), density

    def reach(self, place: Any, direction: Any, active: Any) -> tuple[Any, Any]:
        """How far the distant scene is along a ray, and its normal there."""
        if isinstance(self.distant, Box):
            wall = dr.select(direction > 0, self.high, self.low)
            ways = dr.select(dr.abs(direction) > 1e-9, (wall - place) / direction, FAR)
            distance = dr.min(ways)
            normal = mi.Vector3f(dr.select(ways.x == distance, 1, 0), 0, 0)
            normal.y = dr.select((ways.y == distance) & (normal.x == 0), 1, 0)
            normal.z = dr.select(normal.x + normal.y == 0, 1, 0)
            return dr.maximum(distance, 1e-6), normal
        if isinstance(self.distant, Dome):
            away = place - self.centre
            along = dr.dot(away, direction)
            distance = -along + dr.safe_sqrt(along**2 - dr.squared_norm(away) + self.radius**2)
            distance = dr.maximum(distance, 1e-6)
            return distance, (away + distance * direction) / self.radius
        assert self.enclosure is not None
        ray = mi.Ray3f(place, direction)
        met = self.enclosure.ray_intersect_preliminary(ray, active=active)
        surface = met.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        hit = met.is_valid() & active
        # Through a hole the light is as from far away.
        return dr.select(hit, dr.maximum(met.t, 1e-6), FAR), dr.select(hit, surface.n, direction)


def _image_point(direction: Any) -> tuple[Any, Any]:
    u = dr.atan2(direction.x, -direction.z) * dr.inv_two_pi + 0.5
    return u, dr.acos(dr.clip(direction.y, -1, 1)) * dr.inv_pi


def _outward(up: Any, turn: Any) -> Any:
    """The direction of a height and a share of a turn from the map's left edge."""
    sine, cosine = dr.sincos(turn * (2 * np.pi) - np.pi)
    flat = dr.safe_sqrt(1 - up**2)
    return mi.Vector3f(flat * sine, up, -flat * cosine)


def _by_flux(tall: np.ndarray) -> tuple[float, Any, Any]:
    """A map's flux, its pixels to be drawn by their share of it, and the density of that per steradian.

    tall : (H + 2, W) the mean of its channels
    """
    areas = LatLong().solid_angles(len(tall) - 2)
    flux = _between(tall) * areas
    chance = flux / max(flux.sum(), 1e-300)
    density = np.ascontiguousarray(chance / areas, np.float32).ravel()
    return float(flux.sum()), mi.DiscreteDistribution2D(_padded(chance.astype(np.float32))), mi.Float(density)


def _padded(chance: np.ndarray) -> np.ndarray:
    """A small map's chances with pixels of none beside and below: what draws by them has their number compiled in."""
    missing = [least - size for least, size in zip(SMALL, chance.shape, strict=True)]
    return chance if min(missing) < 0 else np.pad(chance, [(0, each) for each in missing])


def _between(tall: np.ndarray) -> np.ndarray:
    """The mean of the bilinear look-up over each pixel: it takes an eighth of each neighbour's side."""
    wide = np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1)
    down = 0.125 * (wide[:-2] + wide[2:]) + 0.75 * wide[1:-1]
    return 0.125 * (down[:, :-2] + down[:, 2:]) + 0.75 * down[:, 1:-1]


def _mean_of_channels(pixels: np.ndarray) -> np.ndarray:
    """(H, W) float64: a sum of three planes, a tenth of the time of a mean over so short an axis."""
    red, green, blue = (pixels[..., channel].astype(np.float64) for channel in range(3))
    return (red + green + blue) / 3
