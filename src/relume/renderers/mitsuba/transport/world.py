"""What rays meet in Dr.Jit: real surfaces and objects, what light passes through, and the light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit
import mitsuba
import numpy as np

from relume.renderers.mitsuba.materials import crossed_straight, sends_narrowly
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.dispersion import Dispersion
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.scene.shapes.shapes import AnyMaterial

# Untyped: a type checker would follow every variable round and round the loops.
dr: Any = drjit
mi: Any = mitsuba

SHORTEN = 1 - 1e-4
"""Of a ray to a light: it ends before what the light stands on."""


class World:
    """What rays meet: real surfaces and added objects apart, and the light.

    local, objects : Mitsuba scenes; None where there is nothing of the kind. A picture of all together has all in
        `objects`, which one search finds
    light : everything that objects do not send themselves
    media : what fills the objects and the space between; None where nothing does
    emitting : whether any object shines
    depth : bounces at most
    smooth : whether `caustics` follows the light that smooth objects send on
    sticks_out : whether real surfaces reach out of the distant scene
    materials : of the objects, in order
    dispersion : what bends light by its wavelength; None where nothing does
    pierced : whether any of them has holes, which the camera's rays are let through by chance
    mirrors : whether real surfaces send light on in one direction, apart from objects
    shines : whether any real surface does, apart from objects
    clipped : of endless ones the number, and the centre and radius of the sphere within which `caustics` follows light
    fog : the centre and the radius of the sphere that the medium between bodies ends at; None for the distant scene
    """

    dispersion: Dispersion | None = None
    mirrors: bool = False
    shines: bool = False
    clipped: Sequence[tuple[int, Any, Any]] = ()

    # Not a dataclass: Dr.Jit's loops would take its fields for state and rewrite them.
    def __init__(
        self, local: Any, objects: Any, light: SceneLight, media: Media | None, emitting: bool, depth: int,
        smooth: bool, sticks_out: bool, materials: Sequence[AnyMaterial] = (), fog: tuple[Any, float] | None = None,
        pierced: bool = False,
    ) -> None:  # fmt: skip
        self.local, self.objects, self.light = local, objects, light
        # Of a single real surface: called as it is, while a choice among all surfaces has every kind of them compiled.
        real = [] if local is None else local.shapes()
        self.only_real = real[0].bsdf() if len(real) == 1 else None
        self.media, self.emitting, self.smooth = media, emitting, smooth
        self.depth = dr.opaque(mi.UInt32, depth)
        self.outside = 0 if media is None else media.outside
        self.foggy = self.outside > 0
        # Else what shines is found by chance alone.
        self.looks_for_objects = emitting
        self.sticks_out, self.pierced = sticks_out, pierced
        # Whether there is light that holes let through and no path finds.
        self.holes = pierced and bool(light.sizeless.any())
        self.fog = None if fog is None else opaque.sphere(*fog)
        numbers = np.array(dr.reinterpret_array(mi.UInt32, objects.shapes_dr()))
        added = np.zeros(int(numbers.max(initial=0)) + 1, np.uint32)
        added[numbers] = 1
        self.added = mi.UInt32(added)
        narrow = [sends_narrowly(material) for material in materials]
        self.narrow: Any = None
        if any(narrow):
            table = np.zeros(len(added), np.uint32)
            table[numbers[narrow]] = 1
            self.narrow = mi.UInt32(table)
        # What the light of a pass leaves in media and on surfaces; see `photons`.
        self.photons: Any = None
        self.photons_without: Any = None
        self.landed: Any = None
        # Without the objects, and what is only with them and only without.
        self.landed_without: Any = None
        self.landed_added: Any = None
        self.landed_taken: Any = None
        # What light goes straight through, and its colour.
        tints = [crossed_straight(material) for material in materials]
        self.straight = any(tint is not None for tint in tints)
        self.tints: list[Any] = []
        if self.straight:
            table = np.full((len(added), 3), -1.0, np.float32)
            for number, tint in zip(numbers, tints, strict=True):
                table[number] = -1.0 if tint is None else tint
            self.tints = [mi.Float(np.ascontiguousarray(table[:, channel])) for channel in range(3)]

    def is_object(self, shape: Any) -> Any:
        """Whether a shape is one of the added ones."""
        number = dr.reinterpret_array(mi.UInt32, shape)
        known = number < dr.width(self.added)
        return dr.gather(mi.UInt32, self.added, dr.select(known, number, 0), known) == 1

    def sends(self, si: Any) -> Any:
        """Whether light that a smooth surface sends on there is followed from the lamps."""
        near = mi.Bool(True)
        if self.clipped:
            shape = dr.reinterpret_array(mi.UInt32, si.shape)
            for number, centre, radius in self.clipped:
                near &= (shape != number) | (dr.squared_norm(si.p - centre) <= dr.square(radius))
        return near

    def parts(self, ray: Any, met: Any, active: Any, objects: bool) -> Any:
        """Whether a ray to what it meets is another one with the objects than without.

        objects : whether it is that with the objects
        """
        if objects:
            return active & self.is_object(met.shape)
        way = mi.Ray3f(ray)
        way.maxt = met.t
        return active & self.objects.ray_test(way, active=active)

    def is_narrow(self, shape: Any, active: Any) -> Any:
        """Whether a shape is an object that sends light on nearly one way."""
        if self.narrow is None or not self.smooth:
            return False
        number = dr.reinterpret_array(mi.UInt32, shape)
        known = active & (number < dr.width(self.narrow))
        return dr.gather(mi.UInt32, self.narrow, dr.select(known, number, 0), known) == 1

    def tint(self, shape: Any, active: Any) -> tuple[Any, Any]:
        """Whether light goes straight through a shape's surface, and the share that does."""
        if not self.straight:
            return mi.Bool(False), mi.Color3f(1)
        number = dr.reinterpret_array(mi.UInt32, shape)
        known = active & (number < dr.width(self.added))
        share = mi.Color3f(*(dr.gather(mi.Float, each, dr.select(known, number, 0), known) for each in self.tints))
        through = known & (share.x >= 0)
        return through, dr.select(through, share, 1)

    def nearest(self, ray: Any, active: Any, objects: bool = True) -> Any:
        """The first of all surfaces on a ray."""
        if not objects:
            return self.real(ray, active)
        if self.local is None:
            return self.within_walls(ray, self.objects.ray_intersect_preliminary(ray, active=active), active)
        real = self.real(ray, active)
        added = self.objects.ray_intersect_preliminary(until(ray, real.t), active=active)
        return dr.select(added.t < real.t, added, real)

    def real(self, ray: Any, active: Any) -> Any:
        """The first real surface on a ray; what lies behind the walls of the distant scene is not seen."""
        if self.local is None:
            none = dr.zeros(mi.PreliminaryIntersection3f, dr.width(ray))
            none.t = dr.inf
            return none
        return self.within_walls(ray, self.local.ray_intersect_preliminary(ray, active=active), active)

    def within_walls(self, ray: Any, met: Any, active: Any) -> Any:
        """What a ray meets, but for what lies behind the walls of the distant scene."""
        if self.sticks_out:
            wall = self.light.wall(ray.o, ray.d, active)
            met.t = dr.select(met.t > wall, dr.inf, met.t)
        return met

    def hidden(self, ray: Any, active: Any, objects: bool = True) -> Any:
        """Whether anything stands before a ray's end."""
        found = mi.Bool(False)
        # Real surfaces first, which have far fewer triangles mostly.
        if self.local is not None:
            found |= self.local.ray_test(ray, active=active)
        if objects:
            found |= self.objects.ray_test(ray, active=active & ~found)
        return found

    def sees(self, inside: Any) -> Any:
        """Whether lamps are seen from within what fills a place."""
        return True if self.media is None else self.media.opens(inside)

    def reach(self, ray: Any, distance: Any, inside: Any, active: Any) -> Any:
        """How much of a distance along a ray lies within the medium where the ray begins."""
        if not self.foggy:
            return distance
        if self.fog is None:
            end = self.light.wall(ray.o, ray.d, active)
        else:
            centre, radius = self.fog
            away = ray.o - centre
            along = dr.dot(away, ray.d)
            end = dr.maximum(-along + dr.safe_sqrt(dr.square(along) - dr.squared_norm(away) + dr.square(radius)), 0)
        return dr.select(inside == self.outside, dr.minimum(distance, end), distance)

    def entered(self, ray: Any, met: Any) -> tuple[Any, Any]:
        """A ray from the camera, begun where it enters the medium between the bodies, and how far what it meets is."""
        if self.fog is None:
            return ray, met
        centre, radius = self.fog
        away = ray.o - centre
        along = dr.dot(away, ray.d)
        square = dr.square(along) - dr.squared_norm(away) + dr.square(radius)
        skipped = dr.select(square > 0, dr.maximum(-along - dr.safe_sqrt(square), 0), 0)
        skipped = dr.minimum(skipped, met.t)
        begun = mi.Ray3f(ray)
        begun.o = ray.o + skipped * ray.d
        met.t = met.t - skipped
        return begun, met

    def from_lamp(self, ray: Any, met: Any, far: Any, begun: Any, active: Any) -> Any:
        """The share of light that passes what is about a lamp, from it or from where it enters, to a surface.

        far : whether it comes from infinity
        begun : the number of what fills the place of the lamp
        """
        if self.media is None:
            return mi.Color3f(1)
        back = mi.Ray3f(ray(met.t), -ray.d)
        return self.media.passed(begun, self.reach(back, dr.select(far, dr.inf, met.t), begun, active))

    def passing(self, ray: Any, inside: Any, active: Any) -> Any:
        """A function of a distance along a ray: the share of its light that meets nothing of the medium there.

        None where there is no medium that lamps are seen through.
        """
        if self.media is None or not self.media.open:
            return None
        media = self.media
        return lambda distance: media.passed(inside, self.reach(ray, distance, inside, active))

    def beyond(self, si: Any, direction: Any, backward: Any, inside: Any) -> Any:
        """The number of what fills the side of a surface that a direction leads to."""
        if self.media is None:
            return inside
        through = dr.dot(si.n, direction) * dr.dot(si.n, backward) < 0
        entered = dr.select(dr.dot(si.n, direction) < 0, self.media.number(si.shape), self.outside)
        return dr.select(through, entered, inside)

    def arrives(self, ray: Any, inside: Any, active: Any, objects: bool = True, sizeless: Any = False) -> Any:
        """The share of light that reaches a ray's beginning from its end; 0 where anything stands between.

        sizeless : where it is of a lamp without a size, which no path meets by chance: holes let it through
        """
        if not objects or not (self.straight or self.holes):
            free = active & ~self.hidden(ray, active, objects)
            if self.media is None:
                return dr.select(free, mi.Color3f(1), 0)
            return dr.select(free, self.media.passed(inside, self.reach(ray, ray.maxt, inside, free)), 0)
        return _arrives(self, ray, inside, active, mi.Bool(sizeless))


@dr.syntax
def _arrives(world: World, ray: Any, inside: Any, active: Any, sizeless: Any) -> Any:
    """The same, through surfaces that do not bend it, and through holes."""
    media = world.media
    share, ray = mi.Color3f(dr.select(active, 1, 0)), mi.Ray3f(ray)
    inside = mi.UInt32(inside)
    walking = mi.Bool(active)
    while walking:
        met = world.nearest(ray, walking)
        hit = walking & met.is_valid() & (met.t < ray.maxt)
        if media is not None:
            way = world.reach(ray, dr.select(hit, met.t, ray.maxt), inside, walking)
            share = dr.select(walking, share * media.passed(inside, way), share)
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, hit)
        through, tint = world.tint(si.shape, hit)
        if world.holes:
            clear = si.bsdf(ray).eval_null_transmission(si, hit & sizeless)
            pierced = hit & sizeless & ~through & (dr.max(clear) > 0)
            through, tint = through | pierced, dr.select(pierced, clear, tint)
        share = dr.select(hit, dr.select(through, share * tint, 0), share)
        if media is not None:
            inside = dr.select(through, world.beyond(si, ray.d, -ray.d, inside), inside)
        onward = si.spawn_ray(ray.d)
        onward.maxt = ray.maxt - met.t
        ray = dr.select(through, onward, ray)
        walking &= through & (dr.max(share) > 0) & (ray.maxt > 0)
    return share


def until(ray: Any, distance: Any) -> Any:
    """A ray that ends there, or where it did if that is nearer."""
    shorter = mi.Ray3f(ray)
    shorter.maxt = dr.minimum(shorter.maxt, distance)
    return shorter
