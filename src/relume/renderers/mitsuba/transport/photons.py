"""Light that lamps send into bodies of scattering glass, milk or skin, kept where it is scattered, in Dr.Jit.

A path from the camera that leaves such a body is bent at its smooth surface, so that it meets a lamp by chance only,
and a point of light never. Here light is followed from the bright part of the scene into the bodies, and each of its
scatterings there is kept (volume photon mapping, Jensen & Christensen 1998). A path from the camera counts those about
its own first scattering in the body, all orders at once. From there on `dim` takes the same light from it.

What is counted lies in a flat cylinder: wide along the surface, where light changes little, and low across it, where it
changes within a mean free path. The part of it that is outside of the body is left out of its volume.

In smoke and fog, from where lamps are seen straight, only light is kept that glass or mirrors bent on its way from the
lamp to its first scattering: what a glass ball gathers in fog.

On surfaces light of lamps without size is kept too, where `caustics` cannot show it: a caustic that the camera sees in
a mirror, through glass, or that lights a fog. Lamps with a size are found there by chance.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import drjit
import mitsuba
import numpy as np

from relume.renderers.mitsuba.arrays import aligned
from relume.renderers.mitsuba.limits import FAIR, WALK
from relume.renderers.mitsuba.transport.cylinders import Cylinders
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.sampling import Spheres, Spread, two
from relume.renderers.mitsuba.transport.world import World

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba

SLOTS = 8
"""Scatterings of one ray of light that are kept: of more, some by chance, which then count for all."""
MOST_PHOTONS = 200_000
"""Rays of light a pass, at most."""
FEWEST_PHOTONS = 50_000
"""And at least, where a picture is small."""
BUCKETS = 1 << 18
PRIMES = (73856093, 19349663, 83492791)
PARTED = np.uint32(1 << 30)
"""Added to the number of light that is another one with the objects than without."""
TAGS = (2654435761, 2246822519, 3266489917)


class Photons:
    """Light that arrives at places, found by where they are.

    cylinders : what is counted
    number : (N,) of what each lies in and of what bent it, together (`Cylinders`); 0 for none
    place, direction, flux : (N, 3)
    """

    def __init__(
        self, cylinders: Cylinders, number: np.ndarray, place: np.ndarray, direction: np.ndarray, flux: np.ndarray
    ) -> None:  # fmt: skip
        there = np.flatnonzero(number)
        number, place, direction, flux = (values[there] for values in (number, place, direction, flux))
        sizes = cylinders.sizes
        self.half, self.wide = (mi.Float(aligned(sizes[:, axis], np.float32)) for axis in range(2))
        self.step, self.corners = (dr.opaque(mi.UInt32, each) for each in (cylinders.step, 8 * cylinders.levels))
        # Sorted by the cell that each lies in, those of a cell in the order of their rays.
        cells = np.floor(place / (2 * sizes[number, 1:2])).astype(np.int64).astype(np.uint32)
        bucket = _hashed(cells, number, PRIMES) % np.uint32(BUCKETS)
        order = _sorted(bucket)
        starts = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=BUCKETS))])
        self.starts = mi.UInt32(aligned(starts, np.uint32))
        # One that nothing counts, so that there always is one.
        self.tags = mi.UInt32(aligned(np.append(_hashed(cells, number, TAGS)[order], 0), np.uint32))
        self.place, self.direction, self.flux = (
            [mi.Float(aligned(np.append(values[order, axis], 0), np.float32)) for axis in range(3)]
            for values in (place, direction, flux)
        )


def in_media(
    world: World, spheres: Spheres, cylinders: Cylinders, count: int, seed: int, objects: bool = True
) -> Photons:  # fmt: skip
    """What the bright part of the light leaves in media, with the objects or without."""
    return Photons(
        cylinders, *_kept(partial(_walked, objects=objects), world, spheres, cylinders, count, seed + (1 << 41))
    )


def on_surfaces(
    world: World, spheres: Spheres, cylinders: Cylinders, count: int, seed: int, objects: bool = True
) -> tuple[Photons, Photons]:  # fmt: skip
    """What lamps without size send on to surfaces that scatter it: all, and what is another without the objects.

    objects : whether they are there; else all of the light without them, and what is another with them
    """
    follow = partial(_landed, objects=objects)
    number, place, direction, flux = _kept(follow, world, spheres, cylinders, count, seed + (1 << 42))
    parted = number >= PARTED
    number = number % PARTED
    every = Photons(cylinders, number, place, direction, flux)
    return every, Photons(cylinders, number * parted, place, direction, flux) if world.mirrors else every


def _kept(
    follow: Any, world: World, spheres: Spheres, cylinders: Cylinders, count: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Number, place, direction and flux of what is kept."""
    kept = [dr.zeros(mi.Float, count * SLOTS) for _ in range(9)]
    number = dr.zeros(mi.UInt32, count * SLOTS)
    rng = mi.PCG32(size=count, initstate=dr.opaque(mi.UInt64, seed))
    times = follow(
        world, spheres, cylinders, Spread(count, [seed]), rng, dr.full(mi.Bool, True, count), [*kept, number]
    )
    dr.eval(times, kept, number)
    # Those that stand for more than themselves.
    weight = np.maximum(np.broadcast_to(np.array(times, np.float64), count) / SLOTS, 1) / count
    numbers = np.array(number)
    there = np.flatnonzero(numbers)
    columns = [np.array(values)[there] for values in kept]
    place, direction, flux = (np.stack(columns[i : i + 3], axis=1) for i in (0, 3, 6))
    return numbers[there], place, direction, flux * weight[there // SLOTS][:, None]


def _sorted(buckets: np.ndarray) -> np.ndarray:
    """The stable order of whole numbers below 2³², their lower halves first: NumPy sorts 16 bits much faster."""
    order = np.argsort(buckets.astype(np.uint16), kind="stable")
    return order[np.argsort((buckets >> 16).astype(np.uint16)[order], kind="stable")]


def _hashed(cells: np.ndarray, medium: np.ndarray, primes: tuple[int, int, int]) -> np.ndarray:
    with np.errstate(over="ignore"):
        parts = [cells[:, axis] * np.uint32(prime) for axis, prime in enumerate(primes)]
        return parts[0] ^ parts[1] ^ parts[2] ^ (medium.astype(np.uint32) * np.uint32(2654435769))


def counted(
    photons: Photons, media: Media, place: Any, along: Any, depth: Any, normal: Any, inside: Any, active: Any
) -> Any:  # fmt: skip
    """The light that is scattered at a place back along a ray, over what scatters it there.

    along : the ray's direction; depth : below the surface, metres, along its normal
    """
    total = _summed(
        photons, place, normal, inside, active,
        lambda towards, flux, mine: flux * media.phase(inside, along, -towards),
        lambda half, wide: np.pi * wide * wide * (half + dr.minimum(half, depth)),
    )  # fmt: skip
    scattering = media.scatterings(inside)
    return dr.select(scattering > 0, total / dr.maximum(scattering, 1e-20), 0)


def reflected(photons: Photons, context: Any, bsdf: Any, si: Any, active: Any) -> Any:
    """The light of photons about a place on a surface that is scattered there back along the ray that met it."""

    def of(towards: Any, flux: Any, mine: Any) -> Any:
        wo = si.to_local(-towards)
        # The flux over an area has the cosine of its direction already.
        return flux * bsdf.eval(context, si, wo, mine) / dr.maximum(dr.abs(wo.z), 0.02)

    return _summed(photons, si.p, si.n, mi.UInt32(1), active, of, lambda half, wide: np.pi * wide * wide)


@dr.syntax
def _summed(
    photons: Photons, place: Any, normal: Any, number: Any, active: Any, value: Any, measure: Any
) -> Any:  # fmt: skip
    """The sum over what lies in the cylinders about a place of what `value` makes of direction and flux.

    measure : the volume or the area of a cylinder, by half its height and its radius
    """
    total, corner = mi.Color3f(0), mi.UInt32(0)
    looking = mi.Bool(active)
    while looking:
        # Of each level the eight cells about the place that may hold any of it.
        kind = number + (corner >> 3) * photons.step
        half, wide = dr.gather(mi.Float, photons.half, kind, looking), dr.gather(mi.Float, photons.wide, kind, looking)
        x, y, z = (mi.Int32(dr.floor(each / (2 * wide) - 0.5)) for each in (place.x, place.y, place.z))
        share = 1 / measure(half, wide)
        cell = [
            dr.reinterpret_array(mi.UInt32, x + mi.Int32(corner & 1)),
            dr.reinterpret_array(mi.UInt32, y + mi.Int32((corner >> 1) & 1)),
            dr.reinterpret_array(mi.UInt32, z + mi.Int32((corner >> 2) & 1)),
        ]
        bucket = _of_cell(cell, kind, PRIMES) & (BUCKETS - 1)
        tag = _of_cell(cell, kind, TAGS)
        index = dr.gather(mi.UInt32, photons.starts, bucket, looking)
        last = dr.gather(mi.UInt32, photons.starts, bucket + 1, looking)
        more = looking & (index < last)
        while more:
            mine = more & (dr.gather(mi.UInt32, photons.tags, index, more) == tag)
            offset = mi.Vector3f(*(dr.gather(mi.Float, each, index, mine) for each in photons.place)) - place
            across = dr.dot(offset, normal)
            mine &= (dr.abs(across) <= half) & (dr.squared_norm(offset) - across * across <= wide * wide)
            towards = mi.Vector3f(*(dr.gather(mi.Float, each, index, mine) for each in photons.direction))
            flux = mi.Color3f(*(dr.gather(mi.Float, each, index, mine) for each in photons.flux))
            total += dr.select(mine, value(towards, flux, mine) * share, 0)
            index += 1
            more &= index < last
        corner += 1
        looking &= corner < photons.corners
    return total


def _of_cell(cell: list[Any], inside: Any, primes: tuple[int, int, int]) -> Any:
    parts = [each * mi.UInt32(prime) for each, prime in zip(cell, primes, strict=True)]
    return parts[0] ^ parts[1] ^ parts[2] ^ (inside * mi.UInt32(2654435769))


@dr.syntax
def _walked(
    world: World, spheres: Spheres, cylinders: Cylinders, spread: Spread, rng: Any, active: Any, kept: list[Any],
    objects: bool = True,
) -> Any:  # fmt: skip
    """Keep where each ray of light is scattered in bodies; how often each was."""
    media: Any = world.media
    context = mi.BSDFContext(mi.TransportMode.Importance)
    slots = dr.arange(mi.UInt32, dr.width(active)) * SLOTS
    ray, flux, active, far, begun = world.light.emitted(spheres, spread, active)
    met = world.nearest(ray, active, objects)
    active &= met.is_valid()
    begun = begun if objects else mi.UInt32(world.outside)
    flux = flux * world.from_lamp(ray, met, far, begun, active)
    inside, times = mi.UInt32(0), mi.UInt32(0)
    bounces, walked = mi.UInt32(0), mi.UInt32(0)
    starting, level = mi.Bool(True), mi.UInt32(cylinders.levels - 1)
    spectral = world.dispersion
    hue, own = mi.Float(-1), mi.Float(-1) if spectral is None else rng.next_float32()
    while active:
        # Through what fills a body.
        way = world.reach(ray, met.t, inside, active)
        scattered, passed, onward = media.crossed(ray, way, inside, rng, active)
        scattered &= active
        flux = dr.select(active, flux * passed, flux)
        turned = scattered & media.keeps(inside)
        # Where lamps are looked for, only what was bent since it left them, and once; paths do all the rest.
        bent = scattered & ~turned & (bounces > 0) & (times == 0)
        stored = turned | bent
        times += dr.select(stored, 1, 0)
        drawn = mi.UInt32(rng.next_float32() * mi.Float(times))
        slot = dr.select(times <= SLOTS, times - 1, drawn)
        values = [*onward.o, *ray.d, *flux, inside + level * cylinders.step]
        for buffer, value in zip(kept, values, strict=True):
            dr.scatter(buffer, value, slots + slot, stored & (slot < SLOTS))
        # At a surface, which sends it on in one direction or ends the ray.
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active & ~scattered)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        on = active & ~scattered & si.is_valid()
        bsdf = si.bsdf(ray)
        sample, weight = bsdf.sample(context, si, rng.next_float32(), two(rng), on)
        straight, tint = world.tint(si.shape, on)
        ahead = dr.select(straight, ray.d, si.to_world(sample.wo))
        weight = dr.select(straight, tint, weight)
        going = on & (straight | mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta))
        going &= world.sends(si) | (bounces > 0) | straight
        inner = going & media.keeps(inside)
        bounces += dr.select(going & ~inner & ~straight, 1, 0)
        going &= bounces < world.depth
        flux = dr.select(going, flux * weight, flux)
        if spectral is not None:
            parted, whole = spectral.met(si, sample, own, going & (hue < 0))
            flux, hue = spectral.sent(flux * whole, own, parted), dr.select(parted, own, hue)
        # The way to the first surface, which `from_lamp` weighed, counted as empty.
        before = dr.select(starting, begun, inside)
        inside = dr.select(going, world.beyond(si, ahead, -ray.d, before), inside)
        starting, level = mi.Bool(False), cylinders.narrowed(level, si.shape, going & ~straight)
        walked += dr.select(turned | inner, 1, 0)
        ray = dr.select(turned, onward, dr.select(going, si.spawn_ray(ahead), ray))
        # Russian roulette by what is lost at each step.
        left = dr.select(on, dr.max(weight), dr.max(passed))
        most = dr.minimum(left, dr.select((walked > FAIR) | (bounces > 6), 0.95, 1))
        survives = rng.next_float32() < most
        active = (going | turned) & (walked < WALK) & survives & (dr.max(flux) > 0)
        flux = dr.select(active, flux / dr.maximum(most, 1e-6), flux)
        met = dr.select(active, world.nearest(ray, active, objects), met)
        active &= met.is_valid() | (world.foggy & (inside == world.outside))
    return times


@dr.syntax
def _landed(
    world: World, spheres: Spheres, cylinders: Cylinders, spread: Spread, rng: Any, active: Any, kept: list[Any],
    objects: bool = True,
) -> Any:  # fmt: skip
    """Keep where each ray of light that smooth surfaces sent on meets what scatters it; how often each did."""
    context = mi.BSDFContext(mi.TransportMode.Importance)
    slots = dr.arange(mi.UInt32, dr.width(active)) * SLOTS
    ray, flux, active, far, begun = world.light.emitted(spheres, spread, active, True)
    met = world.nearest(ray, active, objects)
    active &= met.is_valid()
    parted = world.parts(ray, met, active, objects)
    begun = begun if objects else mi.UInt32(world.outside)
    flux = flux * world.from_lamp(ray, met, far, begun, active)
    inside, times, bounces = mi.UInt32(begun), mi.UInt32(0), mi.UInt32(0)
    level = mi.UInt32(cylinders.levels - 1)
    spectral = world.dispersion
    hue, own = mi.Float(-1), mi.Float(-1) if spectral is None else rng.next_float32()
    while active:
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, active)
        if spectral is not None:
            si.time = spectral.index(si.shape, dr.select(hue < 0, own, hue))
        bsdf = si.bsdf(ray)
        landed = active & (bounces > 0) & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth) & (times < SLOTS)
        values = [*si.p, *ray.d, *flux, 1 + level * cylinders.step + dr.select(parted, mi.UInt32(PARTED), 0)]
        for buffer, value in zip(kept, values, strict=True):
            dr.scatter(buffer, value, slots + times, landed)
        times += dr.select(landed, 1, 0)
        # On through what sends it in one direction.
        sample, weight = bsdf.sample(context, si, rng.next_float32(), two(rng), active)
        straight, tint = world.tint(si.shape, active)
        ahead = dr.select(straight, ray.d, si.to_world(sample.wo))
        weight = dr.select(straight, tint, weight)
        delta = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        active &= straight | (delta & (world.sends(si) | (bounces > 0)))
        bounces += dr.select(active & ~straight, 1, 0)
        level = cylinders.narrowed(level, si.shape, active & ~straight)
        flux = dr.select(active, flux * weight, flux)
        if spectral is not None:
            bent, whole = spectral.met(si, sample, own, active & (hue < 0))
            flux, hue = spectral.sent(flux * whole, own, bent), dr.select(bent, own, hue)
        active &= (bounces < world.depth) & (dr.max(flux) > 0)
        inside = dr.select(active, world.beyond(si, ahead, -ray.d, inside), inside)
        ray = dr.select(active, si.spawn_ray(ahead), ray)
        met = dr.select(active, world.nearest(ray, active, objects), met)
        active &= met.is_valid()
        parted |= world.parts(ray, met, active, objects)
        if world.media is not None:
            flux = dr.select(active, flux * world.media.passed(inside, world.reach(ray, met.t, inside, active)), flux)
    return times
