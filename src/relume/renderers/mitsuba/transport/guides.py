"""What a denoiser is guided by: the first surface that scatters light, seen in mirrors and through glass, in Dr.Jit.

A smooth mirror or a piece of clear glass has no colour and no edges of its own; what it shows has. Open Image Denoise
therefore asks for the albedo and the normal of what is seen in them (its documentation, "Auxiliary Images").
"""

from __future__ import annotations

from typing import Any

import drjit
import mitsuba

from relume.renderers.mitsuba.transport.light import BRIGHT
from relume.renderers.mitsuba.transport.world import World

dr: Any = drjit
mi: Any = mitsuba

DEEP = 8
"""Smooth surfaces in a row that are looked through: four of them are a hollow ball of glass."""


@dr.syntax
def first_scattered(world: World, ray: Any, met: Any, active: Any) -> tuple[Any, Any]:
    """Albedo, 0 to 1, and normal of the first thing on each ray that scatters light; 0 for none.

    met : what each ray meets, valid where `active`
    Glass is looked through where it lets through more than it mirrors.
    The colours of smooth surfaces on the way are multiplied in. The distant scene has no albedo: seen in a mirror its
    radiance L counts as L / (L + mean), which keeps its edges and ends at 1; it has no normal, which OIDN takes as 0.
    """
    context = mi.BSDFContext()
    albedo, normal, tint = mi.Color3f(0), mi.Normal3f(0), mi.Color3f(1)
    # Copies, for the loop rewrites its state.
    ray, active, surfaces = mi.Ray3f(ray), mi.Bool(active), mi.UInt32(0)
    while active:
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
        bsdf = si.bsdf(ray)
        scatters = active & (mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) | (surfaces >= DEEP))
        own = bsdf.eval_diffuse_reflectance(si, scatters)
        albedo = dr.select(scatters, tint * own, albedo)
        normal = dr.select(scatters, si.sh_frame.n, normal)
        active &= ~scatters
        # Of two directions the likelier, so that no chance makes noise of its own.
        sample, weight = bsdf.sample(context, si, mi.Float(0.5), mi.Point2f(0.5, 0.5), active)
        active &= dr.max(weight) > 0
        tint = dr.select(active, tint * weight, tint)
        ray = dr.select(active, si.spawn_ray(si.to_world(sample.wo)), ray)
        met = dr.select(active, world.nearest(ray, active), met)
        surfaces += 1
        # What leaves the scene shows its light.
        leaves = active & ~met.is_valid()
        seen = world.light.arriving(ray.o, ray.d, dr.inf, leaves, mi.Float(0))
        albedo = dr.select(leaves, tint * (seen / dr.maximum(seen + world.light.bright / BRIGHT, 1e-30)), albedo)
        active &= met.is_valid()
    return dr.minimum(albedo, 1), normal
