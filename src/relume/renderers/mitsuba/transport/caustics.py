"""Light followed from the lamps through smooth glass and mirrors to where the camera sees it (caustics), in Dr.Jit.

A path from the camera finds a small lamp behind glass by chance only, and then blindingly. Here such light is followed
forwards, as what is to the side of Whitted's rays had to wait for (Arvo 1986): from the brighter part of the scene's
light to the objects that send it on in one direction, and from the first surface that scatters it straight to the
camera. `World.dimmed` takes the same light from the paths that begin at the camera.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from relume.renderers.mitsuba.transport.lens import Lens
from relume.renderers.mitsuba.transport.sampling import Spheres, Spread, two
from relume.renderers.mitsuba.transport.world import World

SEEN = 4
"""Surfaces of one ray of light that the camera may see it on; light that has scattered more often is faint."""


@dr.syntax
def caustics(
    world: World, spheres: Spheres, lens: Lens, spread: Spread, rng: Any, active: Any, objects: bool = True
) -> list[tuple[Any, Any, Any]]:  # fmt: skip
    """Of each ray of light, for each surface that scatters it: where it is seen, its flux, whether on an object.

    spheres : that bound what sends light on in one direction
    lens : the camera
    objects : whether the added objects are there
    The flux is 0 where nothing is seen, and where it is the same with the objects as without.
    """
    context = mi.BSDFContext(mi.TransportMode.Importance)
    ray, flux, active, far, begun = world.light.emitted(spheres, spread, active)
    met = world.nearest(ray, active, objects)
    active &= met.is_valid()
    parted = world.parts(ray, met, active, objects)
    inside, bounces = mi.UInt32(begun), mi.UInt32(0)
    spectral = world.dispersion
    hue, own = mi.Float(-1), mi.Float(-1) if spectral is None else rng.next_float32()
    begun = begun if objects else mi.UInt32(world.outside)
    flux = flux * world.from_lamp(ray, met, far, begun, active)
    seen_so_far = mi.UInt32(0)
    sent_on, glossy = mi.Bool(False), mi.Bool(False)
    points = [mi.Point2f(-1) for _ in range(SEEN)]
    colours = [mi.Color3f(0) for _ in range(SEEN)]
    added = [mi.Bool(False) for _ in range(SEEN)]
    while active:
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        bsdf = si.bsdf(ray)
        on_object = world.is_object(met.shape)
        # What has been sent on is seen where it is scattered.
        narrow = world.is_narrow(si.shape, active)
        smooth = active & sent_on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & ~(glossy & narrow)
        at, factor, back = lens.seen_at(si, two(rng), smooth)
        seen = smooth & (factor > 0)
        value = bsdf.eval(context, si, si.to_local(back.d), seen)
        seen &= dr.max(value) > 0
        around = world.beyond(si, back.d, -ray.d, inside)
        arrived = world.arrives(back, around, seen, objects)
        if objects:
            # Through smoke that is an object light is seen that it does not meet otherwise.
            differs = parted | world.objects.ray_test(back, active=seen & ~parted) if world.straight else parted
        else:
            differs = parted & ~world.objects.ray_test(back, active=seen & parted)
        arrived = dr.select(differs, arrived, 0)
        for index in range(SEEN):
            here = seen & (seen_so_far == index)
            points[index] = dr.select(here, at, points[index])
            colours[index] = dr.select(here, flux * value * factor * arrived, colours[index])
            added[index] = dr.select(here, on_object, added[index])
        seen_so_far += dr.select(smooth, 1, 0)
        # The next direction.
        sample, weight = bsdf.sample(context, si, rng.next_float32(), two(rng), active)
        onward = si.to_world(sample.wo)
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        one_way = delta | narrow
        straight, tint = world.tint(si.shape, active)
        onward, weight = dr.select(straight, ray.d, onward), dr.select(straight, tint, weight)
        scattered = seen_so_far > 0
        sends = world.sends(si) | sent_on
        active &= (one_way & sends) | scattered | straight
        # Of two that send light on nearly one way, the path from the camera finds the glow of one in the other.
        glossy |= active & ~sent_on & one_way & ~delta
        sent_on |= active & one_way & sends & ~straight
        flux = dr.select(active, flux * weight, flux)
        if spectral is not None:
            bent, whole = spectral.met(si, sample, own, active & (hue < 0))
            flux, hue = spectral.sent(flux * whole, own, bent), dr.select(bent, own, hue)
        # Russian roulette, once something has scattered the light.
        brightness = dr.max(weight)
        active &= (dr.max(flux) > 0) & (bounces < world.depth) & (seen_so_far < SEEN)
        survives = rng.next_float32() < dr.minimum(brightness, 0.95)
        risky = active & scattered
        flux = dr.select(risky, flux / dr.clip(brightness, 1e-6, 0.95), flux)
        active &= ~risky | survives
        bounces += 1
        if world.media is not None:
            inside = dr.select(active, world.beyond(si, onward, -ray.d, inside), inside)
        # On to what the ray meets next.
        ray = dr.select(active, si.spawn_ray(onward), ray)
        met = dr.select(active, world.nearest(ray, active, objects), met)
        active &= met.is_valid()
        parted |= world.parts(ray, met, active, objects)
        if world.media is not None:
            way = world.reach(ray, met.t, inside, active)
            flux = dr.select(active, flux * world.media.passed(inside, way), flux)
    return list(zip(points, colours, added, strict=True))
