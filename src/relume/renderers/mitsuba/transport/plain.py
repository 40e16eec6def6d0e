"""One pass over the picture of a whole scene in Dr.Jit, by the paths that differential rendering takes."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.enclosing import camera_in_a_body
from relume.renderers.mitsuba.materials import crossed_straight, filling
from relume.renderers.mitsuba.scene import warn_of_holes, warn_of_specks
from relume.renderers.mitsuba.transport.dispersion import dispersion_of
from relume.renderers.mitsuba.transport.light import BRIGHT, SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.passes import (
    Planes,
    Tracing,
    bodies_of,
    built,
    fog_of,
    senders,
    stand_in_bodies,
)
from relume.renderers.mitsuba.transport.paths import followed
from relume.renderers.mitsuba.transport.sampling import Numbers
from relume.renderers.mitsuba.transport.world import World
from relume.renderers.raytrace.alpha_coverage import is_pierced
from relume.renderers.raytrace.extent import sticks_out
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene


class Plain(Tracing):
    """A scene and a camera, made ready for passes; all its shapes are searched together."""

    def __init__(self, scene: Scene, camera: Camera, depth: int) -> None:
        shapes = (*scene.local, *scene.objects)
        together = built(shapes)
        materials = [shape.material for shape in shapes]
        media = [filling(material) for material in materials]
        straight = [crossed_straight(material) is not None for material in materials]
        spheres = senders(shapes, together)
        light = SceneLight(scene)
        pierced = any(is_pierced(material) for material in materials)
        caught = bool(spheres[0]) and not light.even and not pierced
        if pierced:
            warn_of_holes(scene, len(spheres[1]))
        warn_of_specks(scene)
        filled = scene.medium is not None or any(medium is not None for medium in media)
        if filled and (reason := camera_in_a_body(camera.position, shapes)) is not None:
            raise UnsupportedScene(reason)
        world = World(
            None, together, light,
            Media(together.shapes_dr(), media, straight, scene.medium) if filled else None,
            any(isinstance(material, Material) and material.emits for material in materials), depth, caught,
            light.map is not None and sticks_out(scene), materials,
            fog_of(scene, light), pierced,
        )  # fmt: skip
        world.dispersion = dispersion_of((together, shapes))
        bodies = bodies_of(shapes, together, world.media)
        stand_in_bodies(world, shapes, bodies)
        super().__init__(world, camera, spheres, pierced, bodies)
        numbers = np.array(dr.reinterpret_array(mi.UInt32, together.shapes_dr()))
        table = np.zeros(int(numbers.max(initial=0)) + 1, np.uint32)
        table[numbers[len(scene.local) :]] = 1
        self.objects = mi.UInt32(table)

    def traced(self, samples: int, seed: int) -> Planes:
        """The planes radiance and matte of so many samples a pixel."""
        pixels = np.arange(self.camera.height * self.camera.width)
        self.flooded(samples, seed)
        whole = self.on_picture(pixels, self._over(samples, [seed], self._traced, pixels)[0])
        if self.world.smooth:
            light = self.lit(samples, seed)
            whole["radiance"] = whole["radiance"] + light["objects"] + light["difference"]
        return whole

    def _traced(self, numbers: Numbers) -> dict[str, Any]:
        world = self.world
        ray, met = self._first(numbers)
        weight = self._solid(ray, met)
        begun = met.is_valid()
        if world.foggy:
            ray, met = world.entered(ray, met)
            begun = mi.Bool(True)
        outside = mi.UInt32(world.outside)
        behind = world.light.arriving(
            ray.o, ray.d, met.t, mi.Bool(True), mi.Float(0), passed=world.passing(ray, outside, mi.Bool(True))
        )
        found = followed(
            world, ray, met, mi.Color3f(weight), mi.Float(0), mi.UInt32(0), numbers, begun, True, mi.Bool(False)
        )
        number: Any = dr.reinterpret_array(mi.UInt32, met.shape)
        known = met.is_valid() & (number < dr.width(self.objects))
        added = dr.gather(mi.UInt32, self.objects, dr.select(known, number, 0), known)
        return {"radiance": behind + found, "matte": mi.Float(added)}

    def _first(self, numbers: Numbers) -> tuple[Any, Any]:
        ray = self._rays(numbers)
        return ray, self.world.within_walls(ray, self._seen_object(ray, numbers), mi.Bool(True))

    def _beyond(self, ray: Any, active: Any) -> Any:
        # The distant scene has edges, as it has in a mirror.
        light = self.world.light
        seen = light.arriving(ray.o, ray.d, dr.inf, active, mi.Float(0))
        return dr.select(active, seen / dr.maximum(seen + light.bright / BRIGHT, 1e-30), 0)
