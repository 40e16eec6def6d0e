"""One pass of differential rendering in Dr.Jit: what objects add to each pixel, and what they change beside them.

Imported only where something is rendered: it imports Mitsuba.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.render.mitsuba_caustics import caustics
from relume.render.mitsuba_guide import Guide
from relume.render.mitsuba_lens import Lens
from relume.render.mitsuba_light import SceneLight
from relume.render.mitsuba_materials import emission
from relume.render.mitsuba_media import Media
from relume.render.mitsuba_numbers import Numbers, two
from relume.render.mitsuba_paths import World, changed, followed
from relume.render.mitsuba_scene import _bsdf, _shape
from relume.scene.bounds import bounding_sphere
from relume.scene.camera import Camera
from relume.scene.materials import Material
from relume.scene.scene import Scene
from relume.scene.shapes import Plane, Shape

LOOKS = 2
"""Directions towards light from each real surface: a shadow ray costs a third of the rest of a sample."""
RAYS_OF_LIGHT = 8
"""Samples of the picture for each ray that is followed from the light: those few carry its noise easily."""

Planes = dict[str, np.ndarray]


class Estimator:
    """A scene and a camera, made ready for passes."""

    def __init__(self, scene: Scene, camera: Camera, depth: int) -> None:
        local, objects = _built(scene.local), _built(scene.objects)
        materials = [solid.material for solid in scene.objects]
        media = [m.medium if isinstance(m, Material) else None for m in materials]
        smooth = [_sends_on(shape.bsdf()) for shape in objects.shapes()]
        light = SceneLight(scene)
        caught = any(smooth) and not light.even
        self.world = World(
            local, objects, light,
            Media(objects.shapes_dr(), media) if any(m is not None for m in media) else None,
            any(isinstance(m, Material) and m.emits for m in materials), depth, caught,
        )  # fmt: skip
        self.camera, self.lens, self.guide = camera, Lens(camera), Guide(scene.objects)
        round_them = (bounding_sphere(solid) for solid, sent in zip(scene.objects, smooth, strict=True) if sent)
        self.spheres = [(mi.Point3f(*map(float, centre)), float(radius)) for centre, radius in round_them]
        # A lone plane never meets itself: no path goes on without the objects.
        self.alone = len(scene.local) == 1 and isinstance(scene.local[0], Plane)

    def traced(self, samples: int, seed: int) -> Planes:
        """The planes objects, difference and matte of so many samples a pixel."""
        camera, world = self.camera, self.world
        count = camera.width * camera.height * samples
        numbers = Numbers(count, samples, seed)
        ray, added, real = self._primary(numbers)
        on_object = added.is_valid() & (added.t < real.t)
        difference = mi.Color3f(0)
        met, weight, density, bounces, parted = added, mi.Color3f(1), mi.Float(0), mi.UInt32(0), mi.Bool(False)
        begun = on_object
        if world.local is not None:
            on_real = real.is_valid() & ~on_object
            difference, (way, share, drawn, so_far, first), (hit, missed) = changed(
                world, self.guide, ray, real, numbers, on_real, LOOKS
            )
            if not self.alone:
                difference -= followed(
                    world, way, missed, mi.Color3f(share), mi.Float(drawn), mi.UInt32(so_far), numbers,
                    missed.is_valid(), False, mi.Bool(False),
                )  # fmt: skip
            ray, met = dr.select(on_object, ray, way), dr.select(on_object, added, hit)
            weight, density = dr.select(on_object, weight, share), dr.select(on_object, density, drawn)
            bounces, parted = dr.select(on_object, bounces, so_far), ~on_object & first
            begun = on_object | hit.is_valid()
        found = followed(
            world, ray, met, mi.Color3f(weight), mi.Float(density), mi.UInt32(bounces), numbers, begun, True, parted
        )
        objects = dr.select(on_object, found, 0)
        difference += dr.select(on_object, 0, found)
        planes = self._summed({"objects": objects, "difference": difference, "matte": mi.Float(on_object)}, samples)
        if world.smooth:
            for name, light in self._lit(max(count // RAYS_OF_LIGHT, 1), seed).items():
                planes[name] = planes[name] + light
        return planes

    def guides(self, samples: int, seed: int) -> Planes:
        """Depth, normal and albedo of what is seen first, and the share of each pixel that shows anything."""
        camera = self.camera
        ray, added, real = self._primary(Numbers(camera.width * camera.height * samples, samples, seed))
        met = dr.select(added.t < real.t, added, real)
        seen = met.is_valid()
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, seen)
        albedo = si.bsdf(ray).eval_diffuse_reflectance(si, seen)
        along = -(self.lens.back @ (si.p - self.lens.place)).z
        values = {
            "depth": dr.select(seen, along, 0), "seen": mi.Float(seen),
            "normal": dr.select(seen, si.sh_frame.n, 0), "albedo": dr.select(seen, albedo, 0),
        }  # fmt: skip
        return self._summed(values, samples)

    def _primary(self, numbers: Numbers) -> tuple[Any, Any, Any]:
        """Rays from the camera, and what of the objects and of the real surfaces they meet first."""
        across, down = numbers.within_pixel()
        width = self.camera.width
        column, row = mi.Float(numbers.pixel % width), mi.Float(numbers.pixel // width)
        ray = self.lens.rays(column + across, row + down, two(numbers.stream))
        added = self.world.objects.ray_intersect_preliminary(ray, active=mi.Bool(True))
        if self.world.local is None:
            real = dr.zeros(mi.PreliminaryIntersection3f)
            real.t = dr.inf  # pyright: ignore[reportAttributeAccessIssue]
        else:
            real = self.world.local.ray_intersect_preliminary(ray, active=mi.Bool(True))
        return ray, added, real

    def _summed(self, values: dict[str, Any], samples: int) -> Planes:
        """The mean over the samples of each pixel, which lie beside each other: the same whatever the threads."""
        dr.eval(values)
        shape, planes = (self.camera.height, self.camera.width), {}
        for name, value in values.items():
            channels = [np.array(dr.block_sum(c, samples)) / samples for c in _channels(value)]
            planes[name] = (
                channels[0].reshape(shape) if len(channels) == 1 else np.stack(channels, -1).reshape(*shape, 3)
            )
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


def _built(shapes: tuple[Shape, ...]) -> Any:
    """A Mitsuba scene of shapes alone; None for none."""
    if not shapes:
        return None
    parts = {
        f"shape_{index:06d}": _shape(mi, shape, _bsdf(mi, shape.material, media=True), emission(mi, shape.material))
        for index, shape in enumerate(shapes)
    }
    return mi.load_dict({"type": "scene", **parts}, optimize=False)


def _sends_on(surface: Any) -> bool:
    """Whether a surface sends light on in one direction."""
    return bool(mi.has_flag(surface.flags(), mi.BSDFFlags.Delta))


def _channels(value: Any) -> list[Any]:
    return [value] if isinstance(value, mi.Float) else [value.x, value.y, value.z]
