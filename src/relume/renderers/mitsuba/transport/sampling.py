"""Sampling in Dr.Jit: random numbers, and directions drawn by them: towards light, from light towards what bounds the
objects, and from real surfaces towards those, which alone can change anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.arrays import aligned
from relume.renderers.mitsuba.transport import opaque
from relume.scene.shapes.shapes import Solid, bounding_sphere

PLANE = (0.7548776662466927, 0.5698402909980532)
SPACE = (0.8191725133961645, 0.6710436067037893, 0.5497004779019703)
"""Steps of sequences that fill a square and a cube evenly: powers of the roots of x³ = x + 1 and x⁴ = x + 1."""
GOLDEN = 0.6180339887498949
"""The same for a line."""
MOST_CONES = 8
"""Cones that every direction is held against; more objects than that share their nearest neighbour's."""
WIDEST = 0.999999
"""Of the sine of a cone's half angle: from within a bounding sphere every direction of a hemisphere leads to it."""

Spheres = list[tuple[Any, Any]]
"""Centres and radii of what bounds objects."""


class Numbers:
    """Numbers from 0 to 1 for `samples` rays of each pixel and seed; the same whatever the number of threads.

    Seeds of passes should lie far apart (`pass_seed`); `pixels` are the numbers of the pixels, in uint32. A pixel has
    the same numbers for a seed whichever others are traced with it, so that the noise of a sequence stands still. The
    rays of a pixel lie beside each other, those of its first seed first.

    Within a pixel the first numbers of its rays are a lattice, shifted by chance: farther apart than drawn ones.
    """

    def __init__(self, pixels: np.ndarray, samples: int, seeds: Sequence[int]) -> None:
        count = pixels.size * samples * len(seeds)
        a_pass, passes = dr.opaque(mi.UInt32, samples), dr.opaque(mi.UInt32, len(seeds))
        index = dr.arange(mi.UInt32, count)
        row = index // a_pass
        place = row // passes
        self.pixel: Any = dr.gather(mi.UInt32, mi.UInt32(aligned(pixels, np.uint32)), place)
        self.sample = index - row * a_pass
        turn = row - place * passes
        self.seed: Any = dr.gather(mi.UInt32, mi.UInt32(table([each & 0xFFFFFFFF for each in seeds], np.uint32)), turn)
        seed = dr.gather(mi.UInt64, mi.UInt64(table(seeds, np.uint64)), turn)
        # A ray's stream goes by its pixel and not by its place in the list, which PCG32 adds to both.
        place = mi.UInt64(self.pixel) * mi.UInt64(a_pass) + mi.UInt64(self.sample) - mi.UInt64(index)
        state, sequence = seed + place, 1 + seed + place
        self.stream = mi.PCG32(size=count, initstate=state, initseq=sequence)  # pyright: ignore[reportCallIssue]

    def within_pixel(self) -> tuple[Any, Any]:
        """Where in its pixel each ray goes through."""
        index = mi.Float(self.sample)
        across, down = (_fraction(self._shift(axis) + index * step) for axis, step in enumerate(PLANE))
        return across, down

    def towards_light(self, look: Any, looks: int, shifts: tuple[Any, Any, Any] | None = None) -> tuple[Any, Any]:
        """For the first surface of a path: which light, and where in it.

        shifts : `light_shifts`, where a loop is to have them once
        """
        index = mi.Float(self.sample * looks + look)
        choice, u, v = (
            _fraction(shift + index * step) for shift, step in zip(shifts or self.light_shifts(), SPACE, strict=True)
        )
        return choice, mi.Point2f(u, v)

    def light_shifts(self) -> tuple[Any, Any, Any]:
        """By how much the numbers of each pixel are shifted."""
        return self._shift(2), self._shift(3), self._shift(4)

    def onward(self) -> Any:
        """For the first surface of a path: where it goes on to (a point of a sequence as those of `Spread`)."""
        keys = [mi.sample_tea_32(self.pixel, self._own(6 + each), 6)[0] for each in range(3)]
        return _pair(self.sample, keys)

    def wavelength(self) -> Any:
        """The place of each ray's wavelength, spread evenly over those of its pixel (`Dispersion`)."""
        return _fraction(self._shift(5) + mi.Float(self.sample) * GOLDEN)

    def _shift(self, axis: int) -> Any:
        return mi.sample_tea_float32(self.pixel, self._own(axis), 6)

    def _own(self, axis: int) -> Any:
        """The seed of an axis."""
        return self.seed + mi.UInt32(0x9E3779B9 * (axis + 1) & 0xFFFFFFFF)


class Spread:
    """Points of unit squares for `count` rays of light of each seed, spread evenly over each square, without gaps and
    heaps.

    Each pair is a (0, 2)-sequence of Sobol', its indices and its values scrambled by chance (Owen's scrambling by
    hashing; Burley 2020), so that each point is even by itself, and pairs and seeds know nothing of each other.
    """

    def __init__(self, count: int, seeds: Sequence[int]) -> None:
        every, a_seed = dr.arange(mi.UInt32, count * len(seeds)), dr.opaque(mi.UInt32, count)
        self.turn: Any = every // a_seed
        self.index: Any = every - self.turn * a_seed
        folded = [(seed ^ seed >> 32) & 0xFFFFFFFF for seed in seeds]
        self.seed: Any = dr.gather(mi.UInt32, mi.UInt32(table(folded, np.uint32)), self.turn)

    def pair(self, number: int) -> Any:
        """The points of a pair; rays with the same index have others in another pair."""
        tea: Any = mi.sample_tea_32
        keys = [tea(self.seed, mi.UInt32(3 * number + each))[0] for each in range(3)]
        return _pair(self.index, keys)


def table(values: Sequence[int], kind: type[np.generic]) -> np.ndarray:
    """Values to be gathered, never one alone: Dr.Jit would compile another kernel, without a look-up, for that."""
    return aligned(np.array([*values, 0], kind), kind)


def _pair(index: Any, keys: Sequence[Any]) -> Any:
    """Points of an Owen-scrambled (0, 2)-sequence, by their numbers in it and three keys of the scrambles."""
    index = dr.brev(_scrambled(dr.brev(index), keys[0]))
    # Both coordinates with their bits turned round: what a scramble of the low bits needs.
    return mi.Point2f(_below_1(_scrambled(index, keys[1])), _below_1(_scrambled(_sobol_second(index), keys[2])))


def _sobol_second(index: Any) -> Any:
    """The second coordinate of Sobol's sequence, its bits turned round."""
    value, direction = mi.UInt32(0), 1
    for bit in range(32):
        value = value ^ dr.select((index >> bit) & 1 == 1, mi.UInt32(direction), 0)
        direction = (direction ^ direction << 1) & 0xFFFFFFFF
    return value


def _scrambled(value: Any, key: Any) -> Any:
    """A hash of which each bit depends on lower bits alone (Laine & Karras 2011, as bettered by Vegdahl 2021)."""
    # No operation in place, which would change what was passed.
    value = value ^ value * 0x3D20ADEA
    value = (value + key) * ((key >> 16) | 1)
    value = value ^ value * 0x05526C56
    return value ^ value * 0x53A22864


def _below_1(turned: Any) -> Any:
    """A number from 0 to 1 of bits turned round."""
    return mi.Float(dr.brev(turned) >> 8) * 2.0**-24


def two(stream: Any) -> Any:
    """A point of the unit square."""
    first = stream.next_float32()
    return mi.Point2f(first, stream.next_float32())


def _fraction(value: Any) -> Any:
    return dr.minimum(value - dr.floor(value), 0.99999994)


@dataclass(frozen=True, eq=False)
class Sample:
    """A direction towards light.

    direction : unit vector from the point
    distance : to where the light stands, metres
    weight : radiance over density; irradiance over probability for lamps without size
    density : per steradian; 0 for lamps without size, which no other sampling finds
    valid : whether there is any
    """

    direction: Any
    distance: Any
    weight: Any
    density: Any
    valid: Any


def beside(axis: Any, less: Any, turn: Any) -> Any:
    """The unit vector whose cosine to an axis is 1 − less, this share of a turn round it; nothing cancels near it."""
    flat = dr.safe_sqrt(less * (2 - less))
    sine, cosine = dr.sincos(2 * np.pi * turn)
    return mi.Frame3f(axis).to_world(mi.Vector3f(flat * cosine, flat * sine, 1 - less))


Cone = tuple[Any, Any]
"""An axis, and 1 − cos of the half angle."""


def cones_of(spheres: Spheres, place: Any) -> list[Cone]:
    """The cones that hold spheres seen from a place; from within a sphere every direction leads to what it bounds."""
    cones = []
    for centre, radius in spheres:
        away = centre - place
        square = dr.minimum(radius**2 / dr.maximum(dr.squared_norm(away), 1e-20), 1)
        # 1 − cos of a whole sphere is 2.
        less = dr.select(square < 1, square / (1 + dr.safe_sqrt(1 - square)), 2)
        cones.append((upright(away), less))
    return cones


def upright(way: Any) -> Any:
    """The unit vector of a way; straight up for one without a length, as from a sphere's own centre."""
    length = dr.norm(way)
    return dr.select(length > 1e-9, way / dr.maximum(length, 1e-9), mi.Vector3f(0, 1, 0))


def chosen(cones: list[Cone], which: Any, point: Any) -> tuple[Any, Any, Any]:
    """What `beside` makes a direction of, evenly within one of the cones."""
    axis, less = cones[0]
    for index, (direction, width) in enumerate(cones):
        mine = which >= index / len(cones)
        axis, less = dr.select(mine, direction, axis), dr.select(mine, width, less)
    return axis, point.x * less, point.y


def within(cone: Cone, direction: Any) -> Any:
    """The density of an even direction of a cone, per steradian."""
    axis, less = cone
    # |d − a|²/2 = 1 − cos, without what cancels in it.
    inside = 0.5 * dr.squared_norm(direction - axis) <= less
    return dr.select(inside, 1 / (2 * np.pi * dr.maximum(less, 1e-20)), 0)


def aimed(spheres: Spheres, which: Any, point: Any, place: Any) -> tuple[Any, Any]:
    """A direction from a place into the cone of one of several spheres, and its density over all of them."""
    cones = cones_of(spheres, place)
    direction = beside(*chosen(cones, which, point))
    density = mi.Float(0)
    for cone in cones:
        density += within(cone, direction) / len(cones)
    return direction, density


def parallel(spheres: Spheres, which: Any, point: Any, towards: Any, radiance: Any) -> tuple[Any, Any, Any]:
    """A ray of parallel light through the disc of one of several spheres, and its flux."""
    frame = mi.Frame3f(towards)
    centre, radius = spheres[0]
    for index, (c, r) in enumerate(spheres):
        mine = which >= index / len(spheres)
        centre, radius = dr.select(mine, c, centre), dr.select(mine, r, radius)
    sine, cosine = dr.sincos(2 * np.pi * point.y)
    flat = radius * dr.sqrt(point.x)
    through = centre + frame.to_world(mi.Vector3f(flat * cosine, flat * sine, 0))
    density = mi.Float(0)
    behind = mi.Float(0)
    for c, r in spheres:
        offset = through - c
        across = dr.squared_norm(offset - dr.dot(offset, towards) * towards)
        density += dr.select(across <= r**2, 1 / (np.pi * r**2 * len(spheres)), 0)
        behind = dr.maximum(behind, dr.norm(offset) + r)
    # Begun before all of the spheres.
    return mi.Ray3f(through + behind * towards, -towards), radiance / density, density > 0


class Guide:
    """Cones about the spheres that bound the objects."""

    def __init__(self, objects: Sequence[Solid]) -> None:
        self.spheres = [opaque.sphere(*each) for each in _grouped(objects)]

    def cones(self, place: Any, normal: Any) -> list[tuple[Any, Any, Any]]:
        """Of each sphere seen from a place: axis, 1 − cos of the half angle, and its share of the samples."""
        found = []
        total = mi.Float(0)
        for centre, radius in self.spheres:
            away = centre - place
            square = dr.squared_norm(away)
            distance = dr.sqrt(dr.maximum(square, 1e-20))
            sine = dr.minimum(radius / distance, WIDEST)
            less = sine * sine / (1 + dr.sqrt(1 - sine * sine))
            axis = away / distance
            # Light that comes along the surface counts little; the cone's upper edge shows whether any comes at all.
            height = dr.dot(axis, normal)
            cosine = dr.sqrt(1 - sine * sine)
            upper = dr.select(height > cosine, 1, height * cosine + dr.safe_sqrt(1 - height * height) * sine)
            share = less * dr.maximum(upper, 0)
            found.append((axis, less, share))
            total += share
        return [(axis, less, dr.select(total > 0, share / total, 0)) for axis, less, share in found]

    def may_meet(self, place: Any, way: Any) -> Any:
        """Whether a ray may meet an object: those into no cone may too, behind a pane or from within a sphere."""
        found = mi.Bool(False)
        for centre, radius in self.spheres:
            away, bound = centre - place, dr.square(radius) * 1.00001
            square, along = dr.squared_norm(away), dr.dot(away, way)
            found |= (square <= bound) | ((along > 0) & (square - dr.square(along) <= bound))
        return found

    def sample(self, cones: list[tuple[Any, Any, Any]], point: Any) -> Any:
        """A unit vector into one of the cones, chosen by the first number of a point; even points stay even in each."""
        axis, less, along = mi.Vector3f(0, 1, 0), mi.Float(0), mi.Float(0)
        low = mi.Float(0)
        for direction, width, share in cones:
            mine = (point.x >= low) & (share > 0)
            axis, less = dr.select(mine, direction, axis), dr.select(mine, width, less)
            along = dr.select(mine, (point.x - low) / dr.maximum(share, 1e-20), along)
            low += share
        return beside(axis, dr.clip(along, 0, 1) * less, point.y)

    def density(self, cones: list[tuple[Any, Any, Any]], direction: Any) -> Any:
        """Per steradian, of `sample`."""
        density = mi.Float(0)
        for axis, less, share in cones:
            # |d − a|²/2 = 1 − cos, without what cancels in it.
            inside = 0.5 * dr.squared_norm(direction - axis) <= less
            density += dr.select(inside & (share > 0), share / (2 * np.pi * dr.maximum(less, 1e-12)), 0)
        return density


def _grouped(objects: Sequence[Solid]) -> list[tuple[np.ndarray, float]]:
    """A bounding sphere an object; where they are many, one for each of a few groups that lie together."""
    spheres = [bounding_sphere(solid) for solid in objects]
    groups = [spheres]
    while len(groups) < MOST_CONES and len(spheres) > MOST_CONES:
        # The widest group is cut in half across its longest side.
        widest = max(groups, key=lambda group: np.ptp([c for c, _ in group], axis=0).max())
        centres = np.array([c for c, _ in widest])
        order = np.argsort(centres[:, np.ptp(centres, axis=0).argmax()], kind="stable")
        groups.remove(widest)
        half = len(widest) // 2
        groups += [[widest[i] for i in order[:half]], [widest[i] for i in order[half:]]]
    return spheres if len(spheres) <= MOST_CONES else [_around(group) for group in groups]


def _around(spheres: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, float]:
    """A sphere that holds all of them, about the middle of their box."""
    low = np.min([c - r for c, r in spheres], axis=0)
    high = np.max([c + r for c, r in spheres], axis=0)
    centre = (low + high) / 2
    return centre, max(float(np.linalg.norm(c - centre)) + r for c, r in spheres)
