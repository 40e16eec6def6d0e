"""What surfaces send towards given places under the scene's light, for one material after the other.

The directions are drawn once and kept: towards the light, and in lobes of two widths. What a material reflects is then
a sum over them of Mitsuba's own BSDF, which changes smoothly with the material, so that its derivatives are those of
the picture and can be descended.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.materials import bsdf
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.mitsuba.scene import scene_dictionary
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene

TOWARDS_LIGHT = 96
"""Directions a point drawn towards the light."""
LOBES = ((0.4, 64), (0.15, 32))
"""Roughness of the lobes that directions are drawn in, and how many a point in each."""


@dataclass(frozen=True, eq=False)
class Arriving:
    """Light at points, as seen from somewhere: N points, K directions each.

    towards_viewer : (N·K, 3) float32 in the frame of the surface, whose z is its normal
    towards_light : (N·K, 3) float32, the same
    weight : (N·K, 3) float32, radiance over the density of all the ways to draw the direction, times their number
    points : N
    """

    towards_viewer: np.ndarray
    towards_light: np.ndarray
    weight: np.ndarray
    points: int

    def reflected(self, material: Diffuse | Material) -> np.ndarray:
        """(N, 3) radiance that points of this material send to the viewer."""
        with _mitsuba(None, None) as mi:
            response = self._response(mi, material)
            return self._summed(mi, [[response.x, response.y, response.z]])[0]

    def gloss_and_base(self, material: Material) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3) radiance of a material's colourless gloss, and (N, 3) of the diffuse base under it for an albedo of 1.

        material : whose base colour is not used; its gloss must be alike in red and green
        """
        # One look at the BSDF is enough where red has a white base and green a black one.
        with _mitsuba(None, None) as mi:
            response = self._response(mi, replace(material, base_color=(1.0, 0.0, 0.0)))
            gloss, base = self._summed(mi, [[response.y] * 3, [response.x - response.y] * 3])
        return gloss, base

    def _summed(self, mi: Any, parts: list[list[Any]]) -> list[np.ndarray]:
        """(N, 3) of each part, by channel what is sent on of the light: the sums over a point's directions."""
        import drjit as dr

        # Multiplied in single precision and added up in double, in the order of the directions.
        light = self._evaluated[2]
        sent = [mi.Float64(part[channel] * light[channel]) for part in parts for channel in range(3)]
        # Once for all: a sum evaluates what it is of, and each would look at the BSDF again.
        dr.eval(sent)
        each = len(self.weight) // self.points
        sums = np.array([np.array(dr.block_sum(values, each)) for values in sent])
        return list(sums.reshape(len(parts), 3, self.points).transpose(0, 2, 1))

    def _response(self, mi: Any, material: Diffuse | Material) -> Any:
        """Of each direction the BSDF times the cosine at the light."""
        import drjit as dr

        surface = bsdf(mi, material)
        surface = mi.load_dict(surface) if isinstance(surface, dict) else surface
        towards_viewer, towards_light, _ = self._evaluated
        si = dr.zeros(mi.SurfaceInteraction3f, len(self.weight))
        si.wi = towards_viewer
        si.t = 1.0
        return surface.eval(mi.BSDFContext(), si, towards_light)

    @cached_property
    def _evaluated(self) -> tuple[Any, Any, Any]:
        """Directions and weights as Dr.Jit has them, for one material after the other."""
        with _mitsuba(None, None) as mi:
            import drjit as dr

            found = mi.Vector3f(self.towards_viewer.T), mi.Vector3f(self.towards_light.T), mi.Color3f(self.weight.T)
            dr.eval(found)
            return found


@dataclass(frozen=True, eq=False)
class Ready:
    """A scene's light and local surfaces as Mitsuba has them, for `arriving` to be asked several times."""

    world: Any


def ready(scene: Scene) -> Ready:
    """Make a scene ready; raises UnsupportedScene in Mitsuba's scalar variants."""
    with _mitsuba(None, None) as mi:
        if "_ad_" not in mi.variant():
            raise UnsupportedScene(
                "the scalar variant of Mitsuba cannot find a gloss; install LLVM 16 or newer, or give the gloss"
            )
        eye = Camera(1, 1, 1.0, np.array(scene.probe, np.float64), np.eye(3))
        return Ready(mi.load_dict(scene_dictionary(mi, scene.without_objects(), eye)))


def arriving(scene: Ready, points: np.ndarray, normals: np.ndarray, viewers: np.ndarray, *, seed: int = 0) -> Arriving:
    """Draw directions at points (N, 3) with unit normals (N, 3) that are seen from `viewers`, (3,) or (N, 3), metres.

    Other local surfaces hide light and send what they shine.
    """
    with _mitsuba(None, None) as mi:
        import drjit as dr

        world = scene.world
        lobes = [(mi.load_dict(_lobe(mi, roughness)), count) for roughness, count in LOBES]
        way = np.asarray(viewers, np.float64) - points
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        found = []
        for index, count in enumerate((TOWARDS_LIGHT, *(count for _, count in LOBES))):
            many = [np.repeat(a, count, axis=0).astype(np.float32).T for a in (points, normals, way)]
            si = dr.zeros(mi.SurfaceInteraction3f, len(points) * count)
            si.p, si.n, si.t = mi.Point3f(many[0]), mi.Normal3f(many[1]), 1.0
            si.sh_frame = mi.Frame3f(mi.Vector3f(many[1]))
            si.wi = si.to_local(mi.Vector3f(many[2]))
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed(int(np.random.SeedSequence([seed, index]).generate_state(1)[0]), len(points) * count)
            if index == 0:
                drawn, over_density = world.sample_emitter_direction(si, sampler.next_2d(), True)
                direction, radiance = drawn.d, mi.Color3f(over_density) * drawn.pdf
            else:
                drawn, direction, radiance = _in_lobe(mi, dr, world, si, sampler, lobes[index - 1][0])
            local = si.to_local(direction)
            density = TOWARDS_LIGHT * world.pdf_emitter_direction(si, drawn)
            for lobe, number in lobes:
                density += number * lobe.pdf(mi.BSDFContext(), si, local)
            weight = dr.select(density > 0, radiance / dr.maximum(density, 1e-30), 0)
            # Once for all three: each by itself would draw the directions again.
            dr.eval(si.wi, local, weight)
            found.append([np.array(v).T.reshape(len(points), count, 3) for v in (si.wi, local, weight)])
        joined = [np.concatenate(parts, axis=1).reshape(-1, 3).astype(np.float32) for parts in zip(*found, strict=True)]
    return Arriving(joined[0], joined[1], np.nan_to_num(joined[2]), len(points))


def _lobe(mi: Any, roughness: float) -> dict[str, Any]:
    # A metal: all of its samples are gloss.
    return {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness**2}


def _in_lobe(mi: Any, dr: Any, world: Any, si: Any, sampler: Any, lobe: Any) -> tuple[Any, Any, Any]:
    sample, _ = lobe.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
    direction = si.to_world(sample.wo)
    hit = world.ray_intersect(si.spawn_ray(direction))
    emitter = hit.emitter(world)
    shines = (emitter != None) & (sample.pdf > 0)  # noqa: E711 (an array of pointers)
    radiance = dr.select(shines, mi.Color3f(emitter.eval(hit, shines)), 0)
    drawn = mi.DirectionSample3f(world, hit, si)
    return drawn, direction, radiance
