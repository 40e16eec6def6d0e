"""Paths of light in Dr.Jit: what comes back along a ray."""

from __future__ import annotations

from typing import Any

import drjit
import mitsuba

from relume.renderers.mitsuba.limits import FAIR, WALK
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.dispersion import joined
from relume.renderers.mitsuba.transport.photons import Photons, counted, reflected
from relume.renderers.mitsuba.transport.sampling import Guide, Numbers, two
from relume.renderers.mitsuba.transport.world import SHORTEN, World

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba

ROULETTE_FROM = 6
"""Bounces after which a path goes on by chance only, as dark paths mostly add nothing more."""


def mitigated(a: Any, b: Any) -> Any:
    """The balance heuristic's weight of the density a beside b (Veach & Guibas 1995)."""
    return dr.select(a + b > 0, a / (a + b), 0)


@dr.syntax
def followed(
    world: World, ray: Any, met: Any, throughput: Any, density: Any, bounces: Any, numbers: Numbers, active: Any,
    objects: bool, parted: Any, hue: Any = -1.0, sent: Any = False,
) -> Any:  # fmt: skip
    """Radiance that comes back along rays.

    met : what each of them meets, valid where `active`; through a medium between bodies also rays that meet nothing
    density : per steradian, of the ray's direction among those beside which light is sampled; 0 for an only way
    objects : whether the added objects are there
    parted : whether the ray comes from a surface that scatters light, seen by the camera itself
    hue : the wavelength that a ray has already, as a place (`Dispersion`)
    sent : whether it comes from a smooth surface whose light `caustics` follows
    """
    spectral = world.dispersion
    hue, own = mi.Float(hue), mi.Float(-1) if spectral is None else numbers.wavelength()
    before, spread, dispersed = mi.Color3f(0), mi.Color3f(1), mi.Bool(False)
    # Whether `caustics` brings the same light; `wide_first`: the first surface scattered it, not nearly one way.
    scattered_first, wide_first, on_surface, sent_on = mi.Bool(parted), mi.Bool(parted), mi.Bool(True), mi.Bool(sent)
    # Whether lamps were looked for where a medium scattered the light, and then the direction's density for the map's.
    looked, turned = mi.Bool(False), mi.Float(0)
    # Whether kept light was counted, for all that follows in a body or for what is bent; the surface met last.
    known, gathered, last_sent = mi.Bool(False), mi.Bool(False), mi.Bool(False)
    entry, facing, context, result = mi.Point3f(0), mi.Normal3f(0, 1, 0), mi.BSDFContext(), mi.Color3f(0)
    inside, walked, ray, rng = mi.UInt32(world.outside), mi.UInt32(0), mi.Ray3f(ray), numbers.stream
    # Where the ray's direction was drawn, as far before as surfaces were crossed that do not bend it.
    begun, gone = mi.Point3f(ray.o), mi.Float(0)
    even_choice, even_point = numbers.towards_light(0, 1)
    while active:
        scattered = mi.Bool(False)
        if world.media is not None:
            lamps, kept = (looked, turned, density, begun, gone), (known, gathered, last_sent)
            scattered, passed, ray, found, lamps, kept = _through_medium(
                world, ray, met, inside, rng, objects, (entry, facing), lamps, kept, active
            )
            (looked, turned, density, begun, gone), (known, gathered, last_sent) = lamps, kept
            result += throughput * found
            throughput, walked = dr.select(active, throughput * passed, throughput), walked + dr.select(scattered, 1, 0)
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active & ~scattered)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        on = active & ~scattered & si.is_valid()
        bsdf = si.bsdf(ray)
        if (world.emitting and objects) or world.shines:
            result += dr.select(on, throughput * _emitted(world, begun, si, density, on), 0)
        straight, tint = world.tint(si.shape, on)
        bent = on & ~straight
        # Light found by looking for it.
        smooth = bent & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (bounces < world.depth)
        first = (even_choice, even_point, bounces == 0)
        narrow = world.is_narrow(si.shape, bent)
        brought = narrow & wide_first & on_surface & (bounces > 0)
        found = _from_lamps(world, si, bsdf, context, rng, first, smooth, ray, inside, objects, brought)
        landed = world.landed if objects else world.landed_without
        if landed is not None:
            unseen = smooth & (((bounces > 0) & ~scattered_first) | ~on_surface)
            found += dr.select(unseen, reflected(landed, context, bsdf, si, unseen), 0)
        result += throughput * found
        # The next direction.
        sample, value = bsdf.sample(context, si, rng.next_float32(), two(rng), bent & (bounces < world.depth))
        onward = si.to_world(sample.wo)
        going = bent & (bounces < world.depth) & (dr.max(value) > 0) & (sample.pdf > 0)
        throughput = dr.select(bent, throughput * value, throughput)
        if spectral is not None:
            parts, whole = spectral.met(si, sample, own, going & (hue < 0))
            before, spread, result, throughput = spectral.parted(before, spread, result, throughput * whole, own, parts)
            hue, dispersed = dr.select(parts, own, hue), dispersed | parts
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        density = dr.select(bent, dr.select(delta, 0, sample.pdf), density)
        looked &= ~bent
        if world.smooth:
            # Camera, a surface that scatters, any others, no medium that does, and a smooth one before the lamp.
            scattered_first = dr.select(bent & (bounces == 0), ~delta, scattered_first)
            on_surface = on_surface & ~scattered
            if narrow is not False:
                wide_first = dr.select(bent & (bounces == 0), ~delta & ~narrow, wide_first)
            one_way = (delta & scattered_first) | (narrow & wide_first)
            sent_on = (bent & one_way & world.sends(si) & on_surface) | (straight & sent_on)
        if (world.photons if objects else world.photons_without) is not None:
            kept = (known, gathered, entry, facing, last_sent)
            known, gathered, entry, facing, last_sent = _met(world, si, bent, delta, kept)
        if world.pierced:
            going &= ~_let_through(bsdf, si, sample, on & (bounces == 0))
        if world.straight:
            onward, throughput = dr.select(straight, ray.d, onward), dr.select(straight, throughput * tint, throughput)
            going, gone = going | straight, dr.select(straight, gone + met.t, dr.select(bent, 0, gone))
        begun = dr.select(bent, si.p, begun)
        # Turned back or let out at the surface of what scatters light is one step more of a walk.
        inner = bent & delta & (False if world.media is None else world.media.keeps(inside))
        walked, bounces = dr.select(inner, walked + 1, walked), dr.select(bent & ~inner, bounces + 1, bounces)
        if world.media is not None:
            inside = dr.select(going, world.beyond(si, onward, -ray.d, inside), inside)
        ray = dr.select(on, si.spawn_ray(onward), ray)
        active = (going | (active & scattered)) & (walked < WALK)
        throughput, active = _survivors(throughput, (bounces > ROULETTE_FROM) | (walked > FAIR), rng, active)
        met = dr.select(active, world.nearest(ray, active, objects), met)
        place = begun if world.straight else ray.o
        dim, drawn = sent_on | (gathered & last_sent), dr.select(looked, turned, density)
        result += throughput * _arriving(world, ray, met, inside, (place, gone), drawn, dim, ~looked, active)
        active &= met.is_valid() | (world.foggy & (inside == world.outside))
    return joined(before, spread, result, dispersed)


def _through_medium(
    world: World, ray: Any, met: Any, inside: Any, rng: Any, objects: bool, surface: tuple[Any, Any],
    lamps: tuple[Any, ...], kept: tuple[Any, Any, Any], active: Any,
) -> tuple[Any, Any, Any, Any, tuple[Any, ...], tuple[Any, Any, Any]]:  # fmt: skip
    """A ray's way through what fills a place: whether it is scattered, its weight, the ray that goes on, light found.

    surface : where the path met one last, and its normal
    lamps, kept : what the path knows of lamps and of light that was kept; given back as it is after the way
    """
    media: Any = world.media
    light, found = world.light, mi.Color3f(0)
    way = world.reach(ray, met.t, inside, active)
    if media.looked_for and not light.dark:
        found += _from_between(world, ray, way, inside, rng, active, objects)
    scattered, passed, onward = media.crossed(ray, way, inside, rng, active)
    # Surfaces that shine are not looked for where a medium scatters light: from there chance alone leads to them.
    looked, turned, density, begun, gone = lamps
    lamps = looked, turned, dr.select(scattered, 0, density), begun, gone
    if media.open:
        lamps = _in_the_open(world, ray, way, onward, inside, scattered, lamps)
    photons = world.photons if objects else world.photons_without
    if photons is not None:
        known, gathered, last_sent = kept
        sent, known, deep = _from_photons(world, photons, ray, onward, inside, scattered, known, surface)
        found += dr.select(deep, passed * sent, 0)
        kept = known, gathered | deep, last_sent & ~deep
    return scattered, passed, dr.select(scattered, onward, ray), found, lamps, kept


def _met(world: World, si: Any, bent: Any, delta: Any, before: tuple[Any, ...]) -> tuple[Any, ...]:
    """What a path knows of light that was kept after a surface, which ends that where it scatters."""
    known, gathered, entry, facing, last_sent = before
    rough = bent & ~delta
    return (
        known & ~rough, gathered & ~rough, dr.select(bent, si.p, entry), dr.select(bent, si.n, facing),
        dr.select(bent, world.sends(si), last_sent),
    )  # fmt: skip


def _in_the_open(
    world: World, ray: Any, way: Any, onward: Any, inside: Any, scattered: Any, before: tuple[Any, ...]
) -> tuple[Any, ...]:  # fmt: skip
    """What a path knows of lamps after a scattering from where they are seen: all of them were looked for there."""
    media: Any = world.media
    looked, turned, density, begun, gone = before
    free = scattered & media.opens(inside)
    drawn = _of_walk(world, ray, way, dr.norm(onward.o - ray.o), onward.d, inside)
    return (
        looked | free, dr.select(free, drawn, turned), dr.select(free, 0, density),
        dr.select(free, onward.o, begun), dr.select(free, 0, gone),
    )  # fmt: skip


def _from_photons(
    world: World, photons: Photons, ray: Any, onward: Any, inside: Any, scattered: Any, known: Any,
    surface: tuple[Any, Any],
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Light kept about a scattering, whether it stands for all that follows in a body, and where any was counted.

    In bodies once for all that follows; in the open at each scattering, for light that was bent.
    surface : where the path met one last, and its normal
    """
    media: Any = world.media
    entry, facing = surface
    kept = media.keeps(inside)
    deep = scattered & (~known | ~kept)
    depth = dr.select(kept, dr.abs(dr.dot(onward.o - entry, facing)), dr.inf)
    sent = counted(photons, media, onward.o, ray.d, depth, facing, inside, deep)
    return dr.select(deep, sent, 0), dr.select(deep, kept, known), deep


def _from_lamps(
    world: World, si: Any, bsdf: Any, context: Any, rng: Any, first: tuple[Any, Any, Any], active: Any, ray: Any,
    inside: Any, objects: bool, sent: Any,
) -> Any:  # fmt: skip
    """Light that a surface scatters back along a ray, found by looking for lamps and for objects that shine.

    first : numbers spread evenly over what the camera sees directly, the objects, and where that is
    sent : where `caustics` brings what the bright part of the light sends
    """
    light, result = world.light, mi.Color3f(0)
    if not light.dark:
        even_choice, even_point, evenly = first
        choice, point = rng.next_float32(), two(rng)
        choice, point = dr.select(evenly, even_choice, choice), dr.select(evenly, even_point, point)
        found = light.sample(si.p, choice, point, active, sent)
        value, chance = bsdf.eval_pdf(context, si, si.to_local(found.direction), active & found.valid)
        lit = active & found.valid & (dr.max(value) > 0)
        around = world.beyond(si, found.direction, -ray.d, inside)
        share = world.arrives(way_to(si, found.direction, found.distance), around, lit, objects, found.density == 0)
        weight = dr.select(found.density > 0, mitigated(found.density, chance), 1)
        result = dr.select(lit, value * found.weight * weight * share, 0)
    if world.looks_for_objects and objects:
        # A scene that has both kinds of light looks in places of its own for each.
        even = first if light.dark else None
        result += from_objects(world, si, bsdf, context, rng, active, ray, inside, first=even)
    elif world.looks_for_objects and world.foggy:
        # As many numbers as with the objects, so that both paths are one until an object parts them.
        two(rng)
    if world.shines:
        result += from_real(world, si, bsdf, context, rng, active, ray, inside, objects)
    return result


def _let_through(bsdf: Any, si: Any, sample: Any, active: Any) -> Any:
    """Whether a path goes on through a hole, which the camera's own rays did already; through thin glass they did not.

    active : paths of the camera's own rays
    """
    holes = active & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
    return holes & (dr.max(bsdf.eval_null_transmission(si, holes)) > 0)


def _survivors(throughput: Any, risky: Any, rng: Any, active: Any) -> tuple[Any, Any]:
    """Russian roulette: those that go on have the weight of those that do not."""
    most = dr.min(mi.Point2f(dr.max(throughput), 0.95))
    risky = active & risky
    survives = rng.next_float32() < most
    throughput = dr.select(risky, throughput / dr.maximum(most, 1e-6), throughput)
    return throughput, active & (~risky | survives)


def _arriving(
    world: World, ray: Any, met: Any, inside: Any, begun: tuple[Any, Any], density: Any, dim: Any, lamps: Any,
    active: Any,
) -> Any:  # fmt: skip
    """The light of lamps and of the map that a ray meets by chance.

    begun : where its direction was drawn, and how far before the ray's own beginning
    """
    place, gone = begun
    reached = dr.select(met.is_valid(), met.t, dr.inf) + gone
    free = active & world.sees(inside)
    seen = world.light.arriving(
        place, ray.d, reached, free, density,
        beyond=gone, dim=dim, passed=world.passing(ray, inside, free), lamps=lamps,
    )  # fmt: skip
    return dr.select(free, seen, 0)


def _from_between(world: World, ray: Any, way: Any, inside: Any, rng: Any, active: Any, objects: bool) -> Any:
    """Light that a medium scatters once on the way of a ray, found by looking for lamps from one place on it."""
    media, light = world.media, world.light
    assert media is not None
    within = active & media.opens(inside) & (inside > 0)
    extinction = media.extinction(inside)
    choice, where, point = rng.next_float32(), rng.next_float32(), two(rng)
    way = dr.minimum(way, 1e6)
    along, chance, lamp = light.place_on(ray, way, opaque.grey(extinction), choice, where)
    place = ray(along)
    found = light.sample(place, choice, point, within)
    lit = within & found.valid & (chance > 0)
    shadow = mi.Ray3f(place, found.direction)
    shadow.maxt = found.distance * SHORTEN
    share = world.arrives(shadow, inside, lit, objects, sizeless=found.density == 0)
    value = media.scattered_share(inside, ray.d, found.direction) * dr.exp(-extinction * along) / chance
    # The map's light is found by the walk's own directions too.
    other = _of_walk(world, ray, way, along, found.direction, inside)
    weight = dr.select(lamp | (found.density == 0), 1, mitigated(found.density, other))
    return dr.select(lit, value * found.weight * share * weight, 0)


def _of_walk(world: World, ray: Any, way: Any, along: Any, direction: Any, inside: Any) -> Any:
    """Density with which a walk scatters at a place into a direction, over that with which lamps are looked for there.

    Per steradian; of light from afar, which is looked for as extinction has it.
    """
    media = world.media
    assert media is not None
    rate = opaque.grey(media.extinction(inside))
    drawn = media.drawn(inside, along) * media.phase(inside, ray.d, direction)
    return drawn / dr.maximum(world.light.afar(dr.minimum(way, 1e6), rate, along), 1e-20)


def way_to(si: Any, direction: Any, distance: Any) -> Any:
    """The ray from a surface to a light."""
    ray = si.spawn_ray(direction)
    ray.maxt = distance * SHORTEN
    return ray


def _emitted(world: World, before: Any, si: Any, density: Any, active: Any) -> Any:
    """What a surface shines itself, weighed against having looked for it from `before`."""
    emitter = si.shape.emitter()
    radiance = emitter.eval(si, active)
    if not world.looks_for_objects and not world.shines:
        return radiance
    place = dr.zeros(mi.SurfaceInteraction3f)
    place.p = before
    looked = active & (density > 0) & (dr.max(radiance) > 0)
    chance, added = mi.Float(0), world.is_object(si.shape)
    if world.looks_for_objects:
        direction = mi.DirectionSample3f(world.objects, si, place)
        chance += world.objects.pdf_emitter_direction(place, direction, looked & added)
    if world.shines:
        direction = mi.DirectionSample3f(world.local, si, place)
        chance += world.local.pdf_emitter_direction(place, direction, looked & ~added)
    return dr.select(density > 0, mitigated(density, chance), 1) * radiance


def from_objects(
    world: World, si: Any, bsdf: Any, context: Any, rng: Any, active: Any, ray: Any, inside: Any,
    guide: Guide | None = None, cones: Any = None, guided: Any = 0, first: tuple[Any, Any, Any] | None = None,
) -> Any:  # fmt: skip
    """Light from objects that shine, found by looking for it.

    first : numbers spread evenly over what the camera sees directly, and where that is
    ray : that met the surface, inside of what the number `inside` says
    """
    return _from_shining(
        world.objects, si, bsdf, context, rng, active,
        lambda way, lit: world.arrives(way, world.beyond(si, way.d, -ray.d, inside), lit), guide, cones, guided, first,
    )  # fmt: skip


def from_real(
    world: World, si: Any, bsdf: Any, context: Any, rng: Any, active: Any, ray: Any, inside: Any, objects: bool
) -> Any:  # fmt: skip
    """The same from real surfaces that shine, past objects or as if there were none."""
    return _from_shining(
        world.local, si, bsdf, context, rng, active,
        lambda way, lit: world.arrives(way, world.beyond(si, way.d, -ray.d, inside), lit, objects),
    )  # fmt: skip


def hidden_real(
    world: World, si: Any, bsdf: Any, context: Any, rng: Any, active: Any,
    guide: Guide | None = None, cones: Any = None, guided: Any = 0,
) -> Any:  # fmt: skip
    """What objects hide of the light of real surfaces that shine, at a real surface between empty space."""

    def hidden(way: Any, lit: Any) -> Any:
        lit &= world.objects.ray_test(way, active=lit)
        none = mi.UInt32(world.outside)
        return world.arrives(way, none, lit, False) - world.arrives(way, none, lit)

    return _from_shining(world.local, si, bsdf, context, rng, active, hidden, guide, cones, guided)


def _from_shining(
    shapes: Any, si: Any, bsdf: Any, context: Any, rng: Any, active: Any, arrives: Any,
    guide: Guide | None = None, cones: Any = None, guided: Any = 0, first: tuple[Any, Any, Any] | None = None,
) -> Any:  # fmt: skip
    """Light of a scene of Mitsuba's whose shapes shine.

    arrives : of a ray to one and where it is wanted: the share of its light that counts
    """
    point = two(rng)
    if first is not None:
        _, even_point, evenly = first
        point = dr.select(evenly, even_point, point)
    direction, weight = shapes.sample_emitter_direction(si, point, False, active)
    wo = si.to_local(direction.d)
    value, chance = bsdf.eval_pdf(context, si, wo, active & (direction.pdf > 0))
    lit = active & (direction.pdf > 0) & (dr.max(value) > 0)
    # Mitsuba's own way to a point ends far enough before the surface that shines.
    share = arrives(si.spawn_ray_to(direction.p), lit)
    if guide is not None:
        chance = (1 - guided) * chance + guided * guide.density(cones, direction.d)
    return dr.select(lit, value * weight * mitigated(direction.pdf, chance) * share, 0)
