"""Paths of light in Dr.Jit: what comes back along a ray, and what added objects change of it."""

from __future__ import annotations

from typing import Any

import drjit
import mitsuba
import numpy as np

from relume.renderers.mitsuba.path_tracer import FAIR, WALK
from relume.renderers.mitsuba.transport.dispersion import Dispersion, joined
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers, two

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba

ROULETTE_FROM = 6
"""Bounces after which a path goes on by chance only, as dark paths mostly add nothing more."""
SHORTEN = 1 - 1e-4
"""Of a ray to a light: it ends before what the light stands on."""


class World:
    """What rays meet: real surfaces and added objects apart, and the light.

    local, objects : Mitsuba scenes; None where there is nothing of the kind
    light : everything that objects do not send themselves
    media : what fills the objects; None where nothing does
    emitting : whether any object shines
    depth : bounces at most
    smooth : whether `caustics` follows the light that smooth objects send on
    sticks_out : whether real surfaces reach out of the distant scene
    dispersion : what bends light by its wavelength; None where nothing does
    """

    dispersion: Dispersion | None = None

    # Not a dataclass: Dr.Jit's loops would take its fields for state and rewrite them.
    def __init__(
        self, local: Any, objects: Any, light: SceneLight, media: Media | None, emitting: bool, depth: int,
        smooth: bool, sticks_out: bool,
    ) -> None:  # fmt: skip
        self.local, self.objects, self.light = local, objects, light
        self.media, self.emitting, self.depth, self.smooth = media, emitting, depth, smooth
        # Through a medium the way to a lamp is not straight or not clear; there such lamps are found by chance alone.
        self.looks_for_objects = emitting and media is None
        self.sticks_out = sticks_out
        numbers = np.array(dr.reinterpret_array(mi.UInt32, objects.shapes_dr()))
        added = np.zeros(int(numbers.max()) + 1, np.uint32)
        added[numbers] = 1
        self.added = mi.UInt32(added)

    def is_object(self, shape: Any) -> Any:
        """Whether a shape is one of the added ones."""
        number = dr.reinterpret_array(mi.UInt32, shape)
        known = number < dr.width(self.added)
        return dr.gather(mi.UInt32, self.added, dr.select(known, number, 0), known) == 1

    def nearest(self, ray: Any, active: Any, objects: bool = True) -> Any:
        """The first of all surfaces on a ray."""
        if not objects:
            return self.real(ray, active)
        added = self.objects.ray_intersect_preliminary(ray, active=active)
        if self.local is None:
            return added
        real = self.real(ray, active)
        return dr.select(added.t < real.t, added, real)

    def real(self, ray: Any, active: Any) -> Any:
        """The first real surface on a ray; what lies behind the walls of the distant scene is not seen."""
        met = self.local.ray_intersect_preliminary(ray, active=active)
        if self.sticks_out:
            wall = self.light.wall(ray.o, ray.d, active)
            met.t = dr.select(met.t > wall, dr.inf, met.t)
        return met

    def hidden(self, ray: Any, active: Any, objects: bool = True) -> Any:
        """Whether anything stands before a ray's end."""
        found = mi.Bool(False)
        if objects:
            found |= self.objects.ray_test(ray, active=active)
        if self.local is not None:
            found |= self.local.ray_test(ray, active=active & ~found)
        return found


def mitigated(a: Any, b: Any) -> Any:
    """The balance heuristic's weight of the density a beside b (Veach & Guibas 1995)."""
    return dr.select(a + b > 0, a / (a + b), 0)


@dr.syntax
def followed(
    world: World, ray: Any, met: Any, throughput: Any, density: Any, bounces: Any, numbers: Numbers, active: Any,
    objects: bool, parted: Any, hue: Any = -1.0,
) -> Any:  # fmt: skip
    """Radiance that comes back along rays.

    met : what each of them meets, valid where `active`
    density : per steradian, of the ray's direction among those beside which light is sampled; 0 for an only way
    objects : whether the added objects are there
    parted : whether the ray comes from a surface that scatters light, seen by the camera itself
    hue : the wavelength that a ray has already, as a place (`Dispersion`)
    """
    light = world.light
    spectral = world.dispersion
    hue, own = mi.Float(hue), mi.Float(-1) if spectral is None else numbers.wavelength()
    before, tint, dispersed = mi.Color3f(0), mi.Color3f(1), mi.Bool(False)
    # Whether the light that `caustics` follows from the lamps would be counted twice.
    scattered_first, on_surface, sent_on = mi.Bool(parted), mi.Bool(True), mi.Bool(False)
    context = mi.BSDFContext()
    result = mi.Color3f(0)
    inside = mi.UInt32(0)
    ray = mi.Ray3f(ray)
    walked = mi.UInt32(0)
    rng = numbers.stream
    even_choice, even_point = numbers.towards_light(0, 1)
    while active:
        scattered = mi.Bool(False)
        if world.media is not None:
            scattered, passed, onward = world.media.crossed(ray, met.t, inside, rng, active)
            throughput = dr.select(active, throughput * passed, throughput)
            ray = dr.select(scattered, onward, ray)
            walked += dr.select(scattered, 1, 0)
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active & ~scattered)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        on = active & ~scattered & si.is_valid()
        bsdf = si.bsdf(ray)
        if world.emitting and objects:
            result += dr.select(on, throughput * _emitted(world, ray, si, density, on), 0)
        # Light found by looking for it.
        smooth = on & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (bounces < world.depth)
        if not light.dark:
            # Spread evenly over what the camera sees directly, the objects.
            evenly = bounces == 0
            choice, point = rng.next_float32(), two(rng)
            choice, point = dr.select(evenly, even_choice, choice), dr.select(evenly, even_point, point)
            found = light.sample(si.p, choice, point, smooth)
            wo = si.to_local(found.direction)
            value, chance = bsdf.eval_pdf(context, si, wo, smooth & found.valid)
            lit = smooth & found.valid & (dr.max(value) > 0)
            lit &= ~world.hidden(_towards(si, found.direction, found.distance), lit, objects)
            weight = dr.select(found.density > 0, mitigated(found.density, chance), 1)
            result += dr.select(lit, throughput * value * found.weight * weight, 0)
        if world.looks_for_objects and objects:
            result += throughput * _from_objects(world, si, bsdf, context, rng, smooth)
        # The next direction.
        sample, value = bsdf.sample(context, si, rng.next_float32(), two(rng), on & (bounces < world.depth))
        onward = si.to_world(sample.wo)
        going = on & (bounces < world.depth) & (dr.max(value) > 0) & (sample.pdf > 0)
        throughput = dr.select(on, throughput * value, throughput)
        if spectral is not None:
            first, whole = spectral.met(si, sample, own, going & (hue < 0))
            before, tint, result, throughput = spectral.parted(before, tint, result, throughput * whole, own, first)
            hue, dispersed = dr.select(first, own, hue), dispersed | first
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        density = dr.select(on, dr.select(delta, 0, sample.pdf), density)
        if world.smooth:
            # Camera, a surface that scatters, any others, and at last none but smooth objects.
            scattered_first = dr.select(on & (bounces == 0), ~delta, scattered_first)
            on_surface = dr.select(on & ~delta, True, on_surface) & ~scattered
            sent_on = dr.select(on, delta & world.is_object(si.shape) & scattered_first & on_surface, False)
        # The camera's own rays have been let through holes already.
        going &= ~(mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null) & (bounces == 0))
        if world.media is not None:
            through = going & (dr.dot(si.n, onward) * dr.dot(si.n, -ray.d) < 0)
            entered = dr.select(dr.dot(si.n, onward) < 0, world.media.number(si.shape), 0)
            inside = dr.select(through, entered, inside)
        ray = dr.select(on, si.spawn_ray(onward), ray)
        bounces = dr.select(on, bounces + 1, bounces)
        active = going | (active & scattered & (walked < WALK))
        most = dr.min(mi.Point2f(dr.max(throughput), 0.95))
        risky = active & ((bounces > ROULETTE_FROM) | (walked > FAIR))
        survives = rng.next_float32() < most
        throughput = dr.select(risky, throughput / dr.maximum(most, 1e-6), throughput)
        active &= ~risky | survives
        met = dr.select(active, world.nearest(ray, active, objects), met)
        reached = dr.select(met.is_valid(), met.t, dr.inf)
        seen = light.arriving(ray.o, ray.d, reached, active & (inside == 0), density, dim=sent_on)
        result += dr.select(active, throughput * seen, 0)
        active &= met.is_valid()
    return joined(before, tint, result, dispersed)


@dr.syntax
def changed(
    world: World, guide: Guide, ray: Any, met: Any, numbers: Numbers, active: Any, looks: int
) -> tuple[Any, Any, Any]:
    """What the objects change of the radiance of real surfaces, up to where paths with and without them part.

    met : the real surface that each ray meets
    looks : directions towards light a vertex
    Returns the light added and the light taken so far, both 0 or more; the parted ray with the weight of what it
    brings; and what it meets with the objects, and without.
    """
    light = world.light
    spectral = world.dispersion
    hue, own = mi.Float(-1), mi.Float(-1) if spectral is None else numbers.wavelength()
    hue_parted = mi.Float(-1)
    context = mi.BSDFContext()
    rng = numbers.stream
    even = [numbers.towards_light(look, looks) for look in range(looks)]
    added_light, taken = mi.Color3f(0), mi.Color3f(0)
    weight_parted, density_parted = mi.Color3f(0), mi.Float(0)
    throughput = mi.Color3f(1)
    bounces, bounces_parted = mi.UInt32(0), mi.UInt32(0)
    first_scatters = mi.Bool(False)
    ray = mi.Ray3f(ray)
    parted = dr.zeros(mi.Ray3f, dr.width(active))
    added_parted = dr.zeros(mi.PreliminaryIntersection3f, dr.width(active))
    added_parted.t = dr.inf
    real_parted = dr.zeros(mi.PreliminaryIntersection3f, dr.width(active))
    real_parted.t = dr.inf
    while active:
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        bsdf = si.bsdf(ray)
        smooth = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (bounces < world.depth)
        cones = guide.cones(si.p, dr.select(dr.dot(si.n, ray.d) < 0, si.n, -si.n))
        any_cone = mi.Float(0)
        for _, _, share in cones:
            any_cone += share
        # Half of the directions go towards the objects, where there are any over the surface's horizon.
        guided = dr.select(smooth & (any_cone > 0), 0.5, 0)
        for look in range(looks if not light.dark else 0):
            evenly = bounces == 0
            choice, point = rng.next_float32(), two(rng)
            choice, point = dr.select(evenly, even[look][0], choice), dr.select(evenly, even[look][1], point)
            found = light.sample(si.p, choice, point, smooth)
            wo = si.to_local(found.direction)
            shadow = _towards(si, found.direction, found.distance)
            # What no object hides is the same in both scenes.
            dark = smooth & found.valid & world.objects.ray_test(shadow, active=smooth & found.valid)
            value, chance = bsdf.eval_pdf(context, si, wo, dark)
            dark &= dr.max(value) > 0
            dark &= ~world.local.ray_test(shadow, active=dark)
            other = (1 - guided) * chance + guided * guide.density(cones, found.direction)
            weight = dr.select(found.density > 0, mitigated(looks * found.density, other), 1) / looks
            taken += dr.select(dark, throughput * value * found.weight * weight, 0)
        if world.looks_for_objects:
            added_light += throughput * _from_objects(world, si, bsdf, context, rng, smooth, guide, cones, guided)
        # A direction by the surface's reflectance or towards an object.
        towards = active & (rng.next_float32() < guided)
        sample, mirrored = bsdf.sample(context, si, rng.next_float32(), two(rng), active & ~towards)
        aimed = guide.sample(cones, rng.next_float32(), two(rng))
        onward = dr.select(towards, aimed, si.to_world(sample.wo))
        delta = ~towards & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        value, chance = bsdf.eval_pdf(context, si, si.to_local(onward), active & ~delta)
        density = (1 - guided) * chance + guided * guide.density(cones, onward)
        weight = dr.select(delta, mirrored / dr.maximum(1 - guided, 1e-6), dr.select(density > 0, value / density, 0))
        density = dr.select(delta, 0, density)
        first_scatters = dr.select(active & (bounces == 0), ~delta, first_scatters)
        throughput = dr.select(active, throughput * weight, throughput)
        if spectral is not None:
            bent, whole = spectral.met(si, sample, own, active & ~towards & (hue < 0))
            throughput = spectral.weighed(throughput * whole, own, bent)
            hue = dr.select(bent, own, hue)
        going = active & (dr.max(throughput) > 0) & (bounces < world.depth)
        ray = dr.select(active, si.spawn_ray(onward), ray)
        added = world.objects.ray_intersect_preliminary(ray, active=going)
        real = world.real(ray, going)
        bounces += 1
        far = dr.select(real.is_valid(), real.t, dr.inf)
        near = dr.select(added.is_valid(), added.t, dr.inf)
        parting = going & (near < far)
        # What the object hides of the light; a lamp before it is seen in both scenes.
        hidden = light.arriving(ray.o, ray.d, far, parting, density, looks, beyond=near)
        taken += dr.select(parting, throughput * hidden, 0)
        parted = dr.select(parting, ray, parted)
        added_parted = dr.select(parting, added, added_parted)
        real_parted = dr.select(parting, real, real_parted)
        weight_parted = dr.select(parting, throughput, weight_parted)
        density_parted = dr.select(parting, density, density_parted)
        bounces_parted = dr.select(parting, bounces, bounces_parted)
        hue_parted = dr.select(parting, hue, hue_parted)
        met = dr.select(going & ~parting, real, met)
        active = going & ~parting & real.is_valid()
        # What is changed of a change is faint: such paths end early.
        survives = rng.next_float32() < 0.5
        throughput = dr.select(active, throughput * 2, throughput)
        active &= survives
    way = (parted, weight_parted, density_parted, bounces_parted, first_scatters, hue_parted)
    return (added_light, taken), way, (added_parted, real_parted)


def _towards(si: Any, direction: Any, distance: Any) -> Any:
    ray = si.spawn_ray(direction)
    ray.maxt = distance * SHORTEN
    return ray


def _emitted(world: World, ray: Any, si: Any, density: Any, active: Any) -> Any:
    """What a surface shines itself, weighed against having looked for it."""
    emitter = si.shape.emitter()
    radiance = emitter.eval(si, active)
    if not world.looks_for_objects:
        return radiance
    before = dr.zeros(mi.SurfaceInteraction3f)
    before.p = ray.o
    direction = mi.DirectionSample3f(world.objects, si, before)
    chance = world.objects.pdf_emitter_direction(before, direction, active & (density > 0) & (dr.max(radiance) > 0))
    return dr.select(density > 0, mitigated(density, chance), 1) * radiance


def _from_objects(
    world: World, si: Any, bsdf: Any, context: Any, rng: Any, active: Any,
    guide: Guide | None = None, cones: Any = None, guided: Any = 0,
) -> Any:  # fmt: skip
    """Light from objects that shine, found by looking for it."""
    direction, weight = world.objects.sample_emitter_direction(si, two(rng), False, active)
    wo = si.to_local(direction.d)
    value, chance = bsdf.eval_pdf(context, si, wo, active & (direction.pdf > 0))
    lit = active & (direction.pdf > 0) & (dr.max(value) > 0)
    # Mitsuba's own way to a point ends far enough before the surface that shines.
    lit &= ~world.hidden(si.spawn_ray_to(direction.p), lit)
    if guide is not None:
        chance = (1 - guided) * chance + guided * guide.density(cones, direction.d)
    return dr.select(lit, value * weight * mitigated(direction.pdf, chance), 0)
