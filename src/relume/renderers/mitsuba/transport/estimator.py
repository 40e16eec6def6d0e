"""One pass of differential rendering in Dr.Jit: what objects add to each pixel, and what they change beside them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.materials import crossed_straight, filling
from relume.renderers.mitsuba.scene import warn_of_holes, warn_of_specks
from relume.renderers.mitsuba.transport.changes import changed
from relume.renderers.mitsuba.transport.dispersion import dispersion_of
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.passes import (
    MIRRORED,
    Planes,
    Tracing,
    bodies_of,
    built,
    fog_of,
    real_senders,
    senders,
    stand_in_bodies,
)
from relume.renderers.mitsuba.transport.paths import followed
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers
from relume.renderers.mitsuba.transport.world import World
from relume.renderers.progressive.convergence import LIGHT
from relume.renderers.raytrace.alpha_coverage import is_pierced
from relume.renderers.raytrace.extent import corners, sticks_out
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene

LOOKS = 8, 2
"""Directions towards light from the first real surface, of which only those towards objects need a shadow ray, and from
those after it: what is changed there is faint."""


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
        # What sends light on in one direction.
        nearly, bent = senders(scene.objects, objects)
        mirrors, clipped = real_senders(scene, local)
        spheres = nearly + mirrors, bent + mirrors
        light = SceneLight(scene)
        pierced = any(is_pierced(solid.material) for solid in scene.objects)
        # Where there are holes, what is followed from the light could not be seen through them.
        caught = bool(spheres[0]) and not light.even and not pierced
        if pierced:
            warn_of_holes(scene, len(spheres[1]))
        warn_of_specks(scene)
        filled = scene.medium is not None or any(medium is not None for medium in media)
        world = World(
            local, objects, light,
            Media(objects.shapes_dr(), media, straight, scene.medium) if filled else None,
            any(isinstance(m, Material) and m.emits for m in materials), depth, caught,
            light.map is not None and sticks_out(scene), materials,
            fog_of(scene, light), pierced,
        )  # fmt: skip
        world.shines = any(isinstance(m := shape.material, Material) and m.emits for shape in scene.local)
        world.mirrors, world.clipped = bool(mirrors), clipped
        world.dispersion = dispersion_of((local, scene.local), (objects, scene.objects))
        bodies = bodies_of(scene.objects, objects, world.media)
        stand_in_bodies(world, scene.objects, bodies)
        floors = bodies
        if mirrors:
            # What objects change of a mirror's light on surfaces is no wider than they are; in fog it is soft.
            widest = max(body.radius for body in bodies)
            real = [body for body in bodies_of(scene.local, local, None) if body.bends]
            floors = bodies + [replace(body, radius=min(body.radius, widest)) for body in real]
            bodies = bodies + [replace(body, radius=min(body.radius, MIRRORED * widest)) for body in real]
        super().__init__(world, camera, spheres, pierced, bodies, floors)
        self.guide = Guide(scene.objects)
        # What is level never meets itself, in however many pieces: no path goes on without the objects.
        heights = [corners(shape)[:, 1] for shape in scene.local]
        self.alone = not heights or float(np.ptp(np.concatenate(heights))) == 0

    def traced(self, samples: int, seed: int, chosen: np.ndarray | None = None, apart: bool = False) -> Planes:
        """The planes objects, difference, taken (the part of it below 0) and matte of so many samples a pixel.

        chosen : (H, W) bool, the pixels to trace; the planes are 0 elsewhere. All unless given
        apart : give what is followed from the light in planes of its own, of all pixels (`convergence.LIGHT`)
        """
        return self.traced_together(samples, [seed], chosen, apart)[0]

    def traced_together(
        self, samples: int, seeds: Sequence[int], chosen: np.ndarray | None = None, apart: bool = False
    ) -> list[Planes]:
        """The same of several passes at once, with the same bits; at most as many as `together` says."""
        height, width = self.camera.height, self.camera.width
        pixels = np.arange(height * width) if chosen is None else np.flatnonzero(chosen)
        every = [self.on_picture(pixels, planes) for planes in self._of_pixels(pixels, samples, seeds)]
        if self.world.smooth and pixels.size:
            lights = self.lit_together(samples, seeds, apart)
            joined = with_light_apart if apart else partial(with_light, chosen=chosen)
            every = [joined(planes, light) for planes, light in zip(every, lights, strict=True)]
        return every

    def of_pixels(self, pixels: np.ndarray, samples: int, seed: int) -> Planes:
        """The same planes of these pixels alone, (N, …), but for what is followed from the light."""
        return self._of_pixels(pixels, samples, [seed])[0]

    def _of_pixels(self, pixels: np.ndarray, samples: int, seeds: Sequence[int]) -> list[Planes]:
        if not pixels.size:
            planes = {name: np.zeros((0, 3), np.float32) for name in ("objects", "difference", "taken")}
            return [planes | {"matte": np.zeros(0, np.float32)} for _ in seeds]
        self.flooded(samples, seeds[0])
        return self._over(samples, seeds, self._traced, pixels)

    def _traced(self, numbers: Numbers) -> dict[str, Any]:
        world = self.world
        ray, added, real = self._primary(numbers)
        on_object = added.is_valid() & (added.t < real.t)
        if world.foggy:
            return self._through_fog(numbers, ray, added, real, on_object)
        more, taken = mi.Color3f(0), mi.Color3f(0)
        met, weight = added, self._solid(ray, added)
        density, bounces, parted = mi.Float(0), mi.UInt32(0), mi.Bool(False)
        begun, before, sent_on = on_object, mi.Float(-1), mi.Bool(False)
        if world.local is not None:
            on_real = real.is_valid() & ~on_object
            (more, taken), (way, share, drawn, so_far, first, hue, sent), (hit, missed) = changed(
                world, self.guide, ray, real, numbers, on_real, LOOKS
            )
            if not self.alone:
                taken += followed(
                    world, way, missed, mi.Color3f(share), mi.Float(drawn), mi.UInt32(so_far), numbers,
                    missed.is_valid(), False, first, hue, sent,
                )  # fmt: skip
            ray, met = dr.select(on_object, ray, way), dr.select(on_object, added, hit)
            weight, density = dr.select(on_object, weight, share), dr.select(on_object, density, drawn)
            bounces, parted = dr.select(on_object, bounces, so_far), ~on_object & first
            begun, before = on_object | hit.is_valid(), dr.select(on_object, -1, hue)
            sent_on = ~on_object & sent
        found = followed(
            world, ray, met, mi.Color3f(weight), mi.Float(density), mi.UInt32(bounces), numbers, begun, True, parted,
            before, sent_on,
        )  # fmt: skip
        objects = dr.select(on_object, found, 0)
        more += dr.select(on_object, 0, found)
        return {"objects": objects, "difference": more - taken, "taken": taken, "matte": mi.Float(on_object)}

    def _through_fog(self, numbers: Numbers, ray: Any, added: Any, real: Any, on_object: Any) -> dict[str, Any]:
        """The planes of a scene that fog fills: all of its paths meet some, so both are followed from the camera on.

        They have the same random numbers, and are one path until an object parts them.
        """
        world, always = self.world, mi.Bool(True)
        without: Any = copy(numbers)
        weight = dr.select(on_object, self._solid(ray, added), 1)
        without.stream = mi.PCG32(numbers.stream)  # pyright: ignore[reportCallIssue]
        begun, met = world.entered(ray, dr.select(on_object, added, real))
        found = followed(
            world, begun, met, mi.Color3f(weight), mi.Float(0), mi.UInt32(0), numbers, always, True, ~always
        )
        begun, met = world.entered(ray, dr.select(always, real, added))
        bare = followed(
            world, begun, met, mi.Color3f(1), mi.Float(0), mi.UInt32(0), without, ~on_object, False, ~always
        )
        more = dr.select(on_object, 0, found - bare)
        return {
            "objects": dr.select(on_object, found, 0), "difference": more, "taken": dr.maximum(-more, 0),
            "matte": mi.Float(on_object),
        }  # fmt: skip

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


def with_light_apart(planes: Planes, light: Planes) -> Planes:
    """The planes of a pass, and those of what was followed from the light, of all pixels whichever it traced."""
    return planes | {LIGHT + name: np.asarray(plane, np.float32) for name, plane in light.items()}
