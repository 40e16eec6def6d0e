"""One pass of differential rendering in Dr.Jit: what objects add to each pixel, and what they change beside them."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.materials import crossed_straight, filling
from relume.renderers.mitsuba.scene import warn_of_holes
from relume.renderers.mitsuba.transport.changes import changed
from relume.renderers.mitsuba.transport.dispersion import dispersion_of
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.passes import Planes, Tracing, bodies_of, built, senders
from relume.renderers.mitsuba.transport.paths import followed
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers
from relume.renderers.mitsuba.transport.world import World
from relume.renderers.raytrace.alpha_coverage import is_pierced
from relume.renderers.raytrace.extent import corners, sticks_out
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene

LOOKS = 2
"""Directions towards light from each real surface: a shadow ray costs a third of the rest of a sample."""


class Estimator(Tracing):
    """A scene and a camera, made ready for passes.

    key : the scene's fingerprint, where it was taken
    """

    key: str | None = None

    def __init__(self, scene: Scene, camera: Camera, depth: int) -> None:
        local, objects = built(scene.local) if scene.local else None, built(scene.objects)
        materials = [solid.material for solid in scene.objects]
        media = [filling(material) for material in materials]
        straight = [crossed_straight(material) is not None for material in materials]
        # Which of them send light on in one direction.
        spheres = senders(scene.objects, objects)
        light = SceneLight(scene)
        pierced = any(is_pierced(solid.material) for solid in scene.objects)
        # Where there are holes, what is followed from the light could not be seen through them.
        caught = bool(spheres[0]) and not light.even and not pierced
        if pierced:
            warn_of_holes(scene)
        world = World(
            local, objects, light,
            Media(objects.shapes_dr(), media, straight) if any(m is not None for m in media) else None,
            any(isinstance(m, Material) and m.emits for m in materials), depth, caught,
            light.map is not None and sticks_out(scene), materials, pierced=pierced,
        )  # fmt: skip
        world.dispersion = dispersion_of((local, scene.local), (objects, scene.objects))
        super().__init__(world, camera, spheres, pierced, bodies_of(scene.objects, objects, world.media))
        self.guide = Guide(scene.objects)
        # What is level never meets itself, in however many pieces: no path goes on without the objects.
        heights = [corners(shape)[:, 1] for shape in scene.local]
        self.alone = not heights or float(np.ptp(np.concatenate(heights))) == 0

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
        self.flooded(samples, seed)
        planes = self._over(samples, seed, self._traced, pixels)
        # What is the same in all pixels, as 0 where there is no surface, may come as one value.
        return {
            name: values if len(values) == len(pixels) else np.repeat(values, len(pixels), axis=0)
            for name, values in planes.items()
        }

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

    def _first(self, numbers: Numbers) -> tuple[Any, Any]:
        ray, added, real = self._primary(numbers)
        return ray, dr.select(added.t < real.t, added, real)

    def _primary(self, numbers: Numbers) -> tuple[Any, Any, Any]:
        """Rays from the camera, and what of the objects and of the real surfaces they meet first."""
        ray = self._rays(numbers)
        added = self._seen_object(ray, numbers)
        if self.world.local is None:
            real = dr.zeros(mi.PreliminaryIntersection3f)
            real.t = dr.inf  # pyright: ignore[reportAttributeAccessIssue]
        else:
            real = self.world.local.ray_intersect_preliminary(ray, active=mi.Bool(True))
        return ray, added, real


def with_light(planes: Planes, light: Planes, chosen: np.ndarray | None) -> Planes:
    """The planes of a pass with what was followed from the light, on the pixels that were chosen; None for all."""
    lit = {name: added if chosen is None else added * chosen[..., None] for name, added in light.items()}
    return planes | {name: planes[name] + added for name, added in lit.items()}
