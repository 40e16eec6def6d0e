"""One pass of differential rendering in Dr.Jit: what objects add to each pixel, and what they change beside them."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.materials import bsdf, emission, filling
from relume.renderers.mitsuba.scene import _shape
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.caustics import caustics
from relume.renderers.mitsuba.transport.dispersion import dispersion_of
from relume.renderers.mitsuba.transport.guides import first_scattered
from relume.renderers.mitsuba.transport.lens import Lens
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.paths import World, changed, followed
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers, two
from relume.renderers.raytrace.alpha_coverage import is_pierced
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Enclosure, Infinite, Scene
from relume.scene.shapes.shapes import Plane, Shape, bounding_sphere, bounds

LOOKS = 2
"""Directions towards light from each real surface: a shadow ray costs a third of the rest of a sample."""
RAYS_OF_LIGHT = 8
"""Samples of the picture for each ray that is followed from the light: those few carry its noise easily."""

MOST_RAYS = 1_000_000
"""Rays of light a pass, at most: in a large picture they lie close enough."""
BAND = 2_000_000
"""Samples traced at once, whose values take about a quarter of a gigabyte."""
HOLES = 16
"""Surfaces with holes that a ray from the camera is looked through one behind the other: leaves of a tree."""
STEP = 1e-4
"""Metres from one of them to where the next is looked for."""

Planes = dict[str, np.ndarray]


class Estimator:
    """A scene and a camera, made ready for passes.

    key : the scene's fingerprint, where it was taken
    """

    key: str | None = None

    def __init__(self, scene: Scene, camera: Camera, depth: int) -> None:
        local, objects = _built(scene.local), _built(scene.objects)
        materials = [solid.material for solid in scene.objects]
        media = [filling(material) for material in materials]
        # Which of them send light on in one direction.
        smooth = [bool(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Delta)) for shape in objects.shapes()]
        light = SceneLight(scene)
        self.pierced = any(is_pierced(solid.material) for solid in scene.objects)
        # Where there are holes, what is followed from the light could not be seen through them.
        caught = any(smooth) and not light.even and not self.pierced
        self.world = World(
            local, objects, light,
            Media(objects.shapes_dr(), media) if any(m is not None for m in media) else None,
            any(isinstance(m, Material) and m.emits for m in materials), depth, caught,
            light.map is not None and _sticks_out(scene),
        )  # fmt: skip
        self.world.dispersion = dispersion_of([(local, scene.local), (objects, scene.objects)])
        self.camera, self.lens, self.guide = camera, Lens(camera), Guide(scene.objects)
        round_them = (bounding_sphere(solid) for solid, sent in zip(scene.objects, smooth, strict=True) if sent)
        self.spheres = [opaque.sphere(*each) for each in round_them]
        # What is level never meets itself, in however many pieces: no path goes on without the objects.
        heights = [_corners(shape)[:, 1] for shape in scene.local]
        self.alone = not heights or float(np.ptp(np.concatenate(heights))) == 0

    def seeing(self, camera: Camera) -> Estimator:
        """The same scene, seen by another camera."""
        other = copy(self)
        other.camera, other.lens = camera, Lens(camera)
        return other

    def traced(self, samples: int, seed: int, chosen: np.ndarray | None = None) -> Planes:
        """The planes objects, difference, taken (the part of it below 0) and matte of so many samples a pixel.

        chosen : (H, W) bool, the pixels to trace; the planes are 0 elsewhere. All unless given
        """
        height, width = self.camera.height, self.camera.width
        pixels = np.arange(height * width) if chosen is None else np.flatnonzero(chosen)
        planes = self.on_picture(pixels, self.of_pixels(pixels, samples, seed))
        if self.world.smooth and pixels.size:
            planes = with_light(planes, self.lit(samples, seed), chosen)
        return planes

    def of_pixels(self, pixels: np.ndarray, samples: int, seed: int) -> Planes:
        """The same planes of these pixels alone, (N, …), but for what is followed from the light."""
        if not pixels.size:
            planes = {name: np.zeros((0, 3), np.float32) for name in ("objects", "difference", "taken")}
            return planes | {"matte": np.zeros(0, np.float32)}
        planes = self._over(samples, seed, self._traced, pixels)
        # What is the same in all pixels, as 0 where there is no surface, may come as one value.
        return {
            name: values if len(values) == len(pixels) else np.repeat(values, len(pixels), axis=0)
            for name, values in planes.items()
        }

    def on_picture(self, pixels: np.ndarray, planes: Planes) -> Planes:
        """What `of_pixels` gave of these pixels, in order, in planes of the whole picture that are 0 elsewhere."""
        height, width = self.camera.height, self.camera.width
        whole: Planes = {}
        for name, values in planes.items():
            plane = values
            if len(pixels) < height * width:
                plane = np.zeros((height * width, *values.shape[1:]), np.float32)
                plane[pixels] = values
            whole[name] = plane.reshape(height, width, *values.shape[1:])
        return whole

    def lit(self, samples: int, seed: int) -> Planes:
        """What a pass of so many samples a pixel follows from the light, for `with_light`; of the whole picture."""
        count = max(self.camera.width * self.camera.height * samples // RAYS_OF_LIGHT, 1)
        return self._lit(min(count, MOST_RAYS), seed)

    def _traced(self, numbers: Numbers) -> dict[str, Any]:
        world = self.world
        ray, added, real = self._primary(numbers)
        on_object = added.is_valid() & (added.t < real.t)
        more, taken = mi.Color3f(0), mi.Color3f(0)
        met, weight = added, self._solid(ray, added)
        density, bounces, parted = mi.Float(0), mi.UInt32(0), mi.Bool(False)
        begun, before = on_object, mi.Float(-1)
        if world.local is not None:
            on_real = real.is_valid() & ~on_object
            (more, taken), (way, share, drawn, so_far, first, hue), (hit, missed) = changed(
                world, self.guide, ray, real, numbers, on_real, LOOKS
            )
            if not self.alone:
                taken += followed(
                    world, way, missed, mi.Color3f(share), mi.Float(drawn), mi.UInt32(so_far), numbers,
                    missed.is_valid(), False, mi.Bool(False), hue,
                )  # fmt: skip
            ray, met = dr.select(on_object, ray, way), dr.select(on_object, added, hit)
            weight, density = dr.select(on_object, weight, share), dr.select(on_object, density, drawn)
            bounces, parted = dr.select(on_object, bounces, so_far), ~on_object & first
            begun, before = on_object | hit.is_valid(), dr.select(on_object, -1, hue)
        found = followed(
            world, ray, met, mi.Color3f(weight), mi.Float(density), mi.UInt32(bounces), numbers, begun, True, parted,
            before,
        )  # fmt: skip
        objects = dr.select(on_object, found, 0)
        more += dr.select(on_object, 0, found)
        return {"objects": objects, "difference": more - taken, "taken": taken, "matte": mi.Float(on_object)}

    def guides(self, samples: int, seed: int) -> Planes:
        """Depth, normal and albedo of what is seen first, the share of each pixel that shows anything, and a denoiser's
        guides: albedo and normal of the first thing that scatters light."""
        pixels = np.arange(self.camera.width * self.camera.height)
        return self.on_picture(pixels, self._over(samples, seed, self._seen, pixels))

    def _seen(self, numbers: Numbers) -> dict[str, Any]:
        ray, added, real = self._primary(numbers)
        met = dr.select(added.t < real.t, added, real)
        seen = met.is_valid()
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, seen)
        albedo = si.bsdf(ray).eval_diffuse_reflectance(si, seen)
        along = -(self.lens.back @ (si.p - self.lens.place)).z
        behind_albedo, behind_normal = first_scattered(self.world, ray, met, seen)
        return {
            "depth": dr.select(seen, along, 0), "seen": mi.Float(seen),
            "normal": dr.select(seen, si.sh_frame.n, 0), "albedo": dr.select(seen, albedo, 0),
            "guide_albedo": behind_albedo, "guide_normal": behind_normal,
        }  # fmt: skip

    def _over(self, samples: int, seed: int, trace: Callable[[Numbers], dict[str, Any]], pixels: np.ndarray) -> Planes:
        """The means over the samples of each of these pixels; so many pixels at once as memory allows."""
        most = max(1, BAND // samples)
        bands: dict[str, list[np.ndarray]] = {}
        for first in range(0, len(pixels), most):
            these = pixels[first : first + most].astype(np.uint32)
            for name, means in self._summed(trace(Numbers(these, samples, seed)), samples).items():
                bands.setdefault(name, []).append(np.asarray(means, np.float32))
        return {name: np.concatenate(parts) if len(parts) > 1 else parts[0] for name, parts in bands.items()}

    def _primary(self, numbers: Numbers) -> tuple[Any, Any, Any]:
        """Rays from the camera, and what of the objects and of the real surfaces they meet first."""
        across, down = numbers.within_pixel()
        width = self.camera.width
        column, row = mi.Float(numbers.pixel % width), mi.Float(numbers.pixel // width)
        ray = self.lens.rays(column + across, row + down, two(numbers.stream))
        added = self._seen_object(ray, numbers)
        if self.world.local is None:
            real = dr.zeros(mi.PreliminaryIntersection3f)
            real.t = dr.inf  # pyright: ignore[reportAttributeAccessIssue]
        else:
            real = self.world.local.ray_intersect_preliminary(ray, active=mi.Bool(True))
        return ray, added, real

    def _seen_object(self, ray: Any, numbers: Numbers) -> Any:
        """The first of the objects that a ray from the camera meets, but for holes, which let it through by chance."""
        added = self.world.objects.ray_intersect_preliminary(ray, active=mi.Bool(True))
        if not self.pierced:
            return added
        on, gone, stopped = mi.Ray3f(ray), mi.Float(0), mi.Bool(False)
        for _ in range(HOLES):
            si = added.compute_surface_interaction(on, mi.RayFlags.All, added.is_valid())
            through = dr.mean(si.bsdf(on).eval_null_transmission(si, added.is_valid()))
            passes = added.is_valid() & ~stopped & (numbers.stream.next_float32() < through)
            stopped |= ~passes
            gone += dr.select(passes, added.t, 0)
            # From the camera on: depth and interaction belong to the whole ray.
            on.o = dr.select(passes, ray.o + (gone + STEP) * ray.d, on.o)
            following = self.world.objects.ray_intersect_preliminary(on, active=passes)
            added = dr.select(passes, following, added)
            gone += dr.select(passes, STEP, 0)
        added.t = dr.select(added.is_valid(), added.t + gone, dr.inf)
        return added

    def _solid(self, ray: Any, met: Any) -> Any:
        """What the light of a surface with holes counts where a ray was not let through: its BSDF is of the whole."""
        if not self.pierced:
            return mi.Color3f(1)
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, met.is_valid())
        through = dr.mean(si.bsdf(ray).eval_null_transmission(si, met.is_valid()))
        return mi.Color3f(1 / dr.maximum(1 - through, 1e-4))

    def _summed(self, values: dict[str, Any], samples: int) -> Planes:
        """The mean over the samples of each pixel, which lie beside each other: the same whatever the threads."""
        dr.eval(values)
        planes = {}
        for name, value in values.items():
            channels = [value] if isinstance(value, mi.Float) else [value.x, value.y, value.z]
            means = [np.array(dr.block_sum(channel, samples)) / samples for channel in channels]
            planes[name] = means[0] if len(means) == 1 else np.stack(means, axis=-1)
        return planes

    def _lit(self, count: int, seed: int) -> Planes:
        """Light followed from the lamps through the smooth objects, added up on the picture in a fixed order."""
        rng = mi.PCG32(size=count, initstate=dr.opaque(mi.UInt64, seed + (1 << 40)))  # pyright: ignore[reportCallIssue]
        found = caustics(self.world, self.spheres, self.lens, rng, dr.full(mi.Bool, True, count))
        dr.eval(found)
        height, width = self.camera.height, self.camera.width
        planes = {name: np.zeros((height * width, 3)) for name in ("objects", "difference")}
        for point, flux, on_object in found:
            light = np.array(flux).astype(np.float64) / count
            landed = light.max(axis=0) > 0
            light, at = light[:, landed], np.array(point)[:, landed].astype(np.int64)
            pixel = np.minimum(at[1], height - 1) * width + np.minimum(at[0], width - 1)
            added = np.array(on_object)[landed]
            for name, mine in (("objects", added), ("difference", ~added)):
                for channel in range(3):
                    planes[name][:, channel] += np.bincount(pixel[mine], light[channel][mine], height * width)
        return {name: plane.reshape(height, width, 3) for name, plane in planes.items()}


def with_light(planes: Planes, light: Planes, chosen: np.ndarray | None) -> Planes:
    """The planes of a pass with what was followed from the light, on the pixels that were chosen; None for all."""
    lit = {name: added if chosen is None else added * chosen[..., None] for name, added in light.items()}
    return planes | {name: planes[name] + added for name, added in lit.items()}


def _built(shapes: tuple[Shape, ...]) -> Any:
    """A Mitsuba scene of shapes alone; None for none."""
    if not shapes:
        return None
    parts = {
        f"shape_{index:06d}": _shape(
            mi, shape, bsdf(mi, shape.material, media=True, dispersion=True), emission(mi, shape.material)
        )
        for index, shape in enumerate(shapes)
    }
    return mi.load_dict({"type": "scene", **parts}, optimize=False)


def _sticks_out(scene: Scene) -> bool:
    """Whether real surfaces reach through the walls of a near distant scene."""
    if isinstance(scene.distant, Infinite):
        return False
    if isinstance(scene.distant, Enclosure):
        return bool(scene.local)
    probe = np.array(scene.probe, np.float64)
    for shape in scene.local:
        points = _corners(shape)
        away = np.linalg.norm(points - probe, axis=-1, keepdims=True)
        reach = scene.distant.distances(probe, (points - probe) / np.maximum(away, 1e-12))
        if np.any(away[..., 0] > reach * (1 + 1e-6)):
            return True
    return False


def _corners(shape: Shape) -> np.ndarray:
    """Points (N, 3) that span a shape: its corners, or those of the box round it."""
    if isinstance(shape, Plane):
        x, z = np.array(shape.extent) / 2
        return np.array([[i * x, shape.height, j * z] for i in (-1, 1) for j in (-1, 1)])
    low, high = bounds([shape])
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
