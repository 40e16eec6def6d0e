"""Paths of light in Dr.Jit with objects and without: what added objects change of the light of real surfaces."""

from __future__ import annotations

from typing import Any

import drjit
import mitsuba

from relume.renderers.mitsuba.transport.paths import from_objects, hidden_real, mitigated, way_to
from relume.renderers.mitsuba.transport.photons import reflected
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers, two
from relume.renderers.mitsuba.transport.world import World

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba


@dr.syntax
def changed(
    world: World, guide: Guide, ray: Any, met: Any, numbers: Numbers, active: Any, looks: tuple[int, int]
) -> tuple[Any, Any, Any]:
    """What the objects change of the radiance of real surfaces, up to where paths with and without them part.

    met : the real surface that each ray meets
    looks : directions towards light from the first surface, and from each after it
    Returns the light added and the light taken so far, both 0 or more; the parted ray with the weight of what it
    brings; and what it meets with the objects, and without.
    """
    light = world.light
    hue, hue_parted, own = mi.Float(-1), mi.Float(-1), numbers.wavelength()
    context, rng = mi.BSDFContext(), numbers.stream
    even_way, shifts = numbers.onward(), numbers.light_shifts()
    added_light, taken, weight_parted = mi.Color3f(0), mi.Color3f(0), mi.Color3f(0)
    throughput, bounces, bounces_parted, density_parted = mi.Color3f(1), mi.UInt32(0), mi.UInt32(0), mi.Float(0)
    first_scatters, ray = mi.Bool(False), mi.Ray3f(ray)
    sent_on, sent_parted = mi.Bool(False), mi.Bool(False)
    parted = dr.zeros(mi.Ray3f, dr.width(active))
    added_parted = dr.zeros(mi.PreliminaryIntersection3f, dr.width(active))
    added_parted.t = dr.inf
    real_parted = dr.zeros(mi.PreliminaryIntersection3f, dr.width(active))
    real_parted.t = dr.inf
    while active:
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
        if world.dispersion is not None:
            si.time = world.dispersion.index(si.shape, dr.select(hue < 0, own, hue))
        bsdf = si.bsdf(ray) if world.only_real is None else world.only_real
        smooth = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (bounces < world.depth)
        cones = guide.cones(si.p, dr.select(dr.dot(si.n, ray.d) < 0, si.n, -si.n))
        guided = _guided(cones, smooth)
        many = mi.Float(dr.select(bounces == 0, looks[0], looks[1]))
        if not light.dark:
            even = numbers, shifts, bounces == 0
            hidden, rng = _hidden_lamps(world, guide, (si, bsdf), even, rng, smooth, looks, (cones, guided))
            taken += throughput * hidden
        if world.looks_for_objects:
            added_light += throughput * from_objects(
                world, si, bsdf, context, rng, smooth, ray, mi.UInt32(0), guide, cones, guided
            )
        if world.shines:
            taken += throughput * hidden_real(world, si, bsdf, context, rng, smooth, guide, cones, guided)
        if world.landed_added is not None:
            unseen = smooth & (bounces > 0) & ~first_scatters
            added_light += throughput * reflected(world.landed_added, context, bsdf, si, unseen)
            taken += throughput * reflected(world.landed_taken, context, bsdf, si, unseen)
        # A direction by the surface's reflectance or towards an object.
        point = two(rng)
        point = dr.select(bounces == 0, even_way, point)
        towards = active & (point.x < guided)
        # Both halves of a square that is cut there are as even as the whole.
        within = mi.Point2f(
            dr.select(towards, point.x / dr.maximum(guided, 1e-6), (point.x - guided) / (1 - guided)), point.y
        )
        sample, mirrored = bsdf.sample(context, si, rng.next_float32(), within, active & ~towards)
        aimed = guide.sample(cones, within)
        onward = dr.select(towards, aimed, si.to_world(sample.wo))
        delta = ~towards & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        value, chance = bsdf.eval_pdf(context, si, si.to_local(onward), active & ~delta)
        density = (1 - guided) * chance + guided * guide.density(cones, onward)
        weight = dr.select(delta, mirrored / dr.maximum(1 - guided, 1e-6), dr.select(density > 0, value / density, 0))
        density = dr.select(delta, 0, density)
        first_scatters = dr.select(active & (bounces == 0), ~delta, first_scatters)
        sent_on = active & delta & first_scatters & world.sends(si) & (world.smooth and world.mirrors)
        throughput = dr.select(active, throughput * weight, throughput)
        if world.dispersion is not None:
            bent, whole = world.dispersion.met(si, sample, own, active & ~towards & (hue < 0))
            throughput, hue = world.dispersion.weighed(throughput * whole, own, bent), dr.select(bent, own, hue)
        going = active & (dr.max(throughput) > 0) & (bounces < world.depth)
        ray = dr.select(active, si.spawn_ray(onward), ray)
        added = world.objects.ray_intersect_preliminary(ray, active=going)
        real = world.real(ray, going)
        bounces += 1
        far = dr.select(real.is_valid(), real.t, dr.inf)
        near = dr.select(added.is_valid(), added.t, dr.inf)
        parting = going & (near < far)
        # What the object hides of the light; a lamp before it is seen in both scenes.
        hidden = light.arriving(ray.o, ray.d, far, parting, density, many, beyond=near, dim=sent_on)
        taken += dr.select(parting, throughput * hidden, 0)
        parted = dr.select(parting, ray, parted)
        added_parted = dr.select(parting, added, added_parted)
        real_parted = dr.select(parting, real, real_parted)
        weight_parted = dr.select(parting, throughput, weight_parted)
        density_parted = dr.select(parting, density, density_parted)
        bounces_parted = dr.select(parting, bounces, bounces_parted)
        hue_parted, sent_parted = dr.select(parting, hue, hue_parted), dr.select(parting, sent_on, sent_parted)
        met = dr.select(going & ~parting, real, met)
        active = going & ~parting & real.is_valid()
        # What is changed of a change is faint: such paths end early.
        survives = rng.next_float32() < 0.5
        throughput = dr.select(active, throughput * 2, throughput)
        active &= survives
    way = (parted, weight_parted, density_parted, bounces_parted, first_scatters, hue_parted, sent_parted)
    return (added_light, taken), way, (added_parted, real_parted)


@dr.syntax
def _hidden_lamps(
    world: World, guide: Guide, at: tuple[Any, Any], even: tuple[Numbers, Any, Any], rng: Any, active: Any,
    looks: tuple[int, int], towards: tuple[Any, Any],
) -> tuple[Any, Any]:  # fmt: skip
    """What objects hide of the light of lamps and of the map that a real surface scatters back; the stream after it.

    at : the surface and its BSDF
    even : numbers that are spread evenly over the first surfaces, and where those are
    towards : the cones of the objects, and the share of the directions that go there
    """
    (si, bsdf), (numbers, shifts, evenly), (cones, guided) = at, even, towards
    light, context, total = world.light, mi.BSDFContext(), mi.Color3f(0)
    look, many, looking = mi.UInt32(0), dr.select(evenly, looks[0], looks[1]), mi.Bool(active)
    count = mi.Float(many)

    def wanted(way: Any) -> Any:
        # What no object hides is the same in both scenes.
        return guide.may_meet(si.p, way)

    while looking:
        choice, point = rng.next_float32(), two(rng)
        even_choice, even_point = numbers.towards_light(look, looks[0], shifts)
        choice, point = dr.select(evenly, even_choice, choice), dr.select(evenly, even_point, point)
        found = light.sample(si.p, choice, point, looking, wanted=wanted)
        shadow = way_to(si, found.direction, found.distance)
        dark = looking & found.valid & wanted(found.direction)
        dark &= world.objects.ray_test(shadow, active=dark)
        value, chance = bsdf.eval_pdf(context, si, si.to_local(found.direction), dark)
        dark &= dr.max(value) > 0
        dark &= ~world.local.ray_test(shadow, active=dark)
        other = (1 - guided) * chance + guided * guide.density(cones, found.direction)
        weight = dr.select(found.density > 0, mitigated(count * found.density, other), 1) / count
        lost = mi.Color3f(1)
        if world.straight or world.holes:
            lost = 1 - world.arrives(shadow, mi.UInt32(0), dark, sizeless=found.density == 0)
        total += dr.select(dark, value * found.weight * weight * lost, 0)
        look += 1
        looking &= look < many
    return total, rng


def _guided(cones: Any, active: Any) -> Any:
    """Half of the directions go towards the objects, where there are any over the surface's horizon."""
    any_cone = mi.Float(0)
    for _, _, share in cones:
        any_cone += share
    return dr.select(active & (any_cone > 0), 0.5, 0)
