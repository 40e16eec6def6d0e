"""One pass over a picture in Dr.Jit: rays from its pixels, what they meet first, and sums that no thread changes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from relume.renderers.mitsuba.enclosing import filled_with, require_edges
from relume.renderers.mitsuba.materials import bsdf, crossed_straight, emission, sends_narrowly
from relume.renderers.mitsuba.scene import _shape, material_on
from relume.renderers.mitsuba.transport import opaque
from relume.renderers.mitsuba.transport.caustics import caustics
from relume.renderers.mitsuba.transport.cylinders import Body, Cylinders, in_bodies, on_floors
from relume.renderers.mitsuba.transport.guides import first_scattered
from relume.renderers.mitsuba.transport.lens import Lens
from relume.renderers.mitsuba.transport.light import SceneLight
from relume.renderers.mitsuba.transport.media import Media
from relume.renderers.mitsuba.transport.photons import FEWEST_PHOTONS, MOST_PHOTONS, in_media, on_surfaces
from relume.renderers.mitsuba.transport.sampling import Numbers, Spheres, Spread, table, two
from relume.renderers.mitsuba.transport.world import World
from relume.renderers.raytrace.extent import sphere_round, sphere_round_all, sphere_round_shapes
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Infinite, Scene
from relume.scene.shapes.shapes import Plane, Shape

RAYS_OF_LIGHT = 8
"""Samples of the picture for each ray that is followed from the light: those few carry its noise easily."""
RAYS_OF_LIGHT_APART = 24
"""The same where pixels are traced unequally often: all of the light is of use to each of them then."""
SAMPLES_A_PHOTON = 2
"""The same into bodies that scatter light, where paths from the camera walk far longer."""
MOST_RAYS = 1_000_000
"""Rays of light a pass, at most: in a large picture they lie close enough."""
FEWEST_RAYS = 50_000
"""And at least, where real surfaces send light on."""
BAND = 4_000_000
"""Samples traced at once, of one pass or of several: as many as `PASS_RAYS`, whose values take half a gigabyte."""
HOLES = 16
"""Surfaces with holes that a ray from the camera is looked through one behind the other: leaves of a tree."""
STREAM = 0xDA3E39CB94B95BDB
"""PCG32's own stream, unless another is given."""
MIRRORED = 16.0
"""Of the radius about all objects: how much of an endless mirror about them lamps send light to. What farther parts of
it send on is found by chance, and of lamps without size not at all."""
STEP = 1e-4
"""Metres from one of them to where the next is looked for."""

Planes = dict[str, np.ndarray]


class Tracing(ABC):
    """A world and a camera, made ready for passes.

    spheres : round the shapes that send light on in one direction or nearly so, and those in one alone (`senders`)
    pierced : whether shapes have holes
    bodies : the shapes, as light meets them
    floors : the same for light that is kept on surfaces, where their radius is another
    """

    def __init__(
        self, world: World, camera: Camera, spheres: tuple[Spheres, Spheres], pierced: bool,
        bodies: Sequence[Body] = (), floors: Sequence[Body] | None = None,
    ) -> None:  # fmt: skip
        self.world, self.spheres, self.benders, self.pierced = world, *spheres, pierced
        self.camera, self.lens = camera, Lens(camera)
        # Whether light is followed to where it is scattered: in bodies, and where it was bent before in smoke or fog.
        media = world.media
        self.floods = media is not None and media.scatters and bool(self.benders) and not world.light.even
        # Whether a lamp that no path meets sends light on to surfaces.
        self.lands = bool(self.benders) and world.smooth and bool(world.light.sizeless.any())
        self.in_bodies = in_bodies(media, bodies) if media is not None and self.floods else None
        self.on_floors = on_floors(bodies if floors is None else floors) if self.lands else None

    def flooded(self, samples: int, seed: int) -> None:
        """Follow a pass's light to where it is scattered, for the paths of this seed."""
        wanted = self.camera.width * self.camera.height * samples // SAMPLES_A_PHOTON
        count = min(max(wanted, FEWEST_PHOTONS), MOST_PHOTONS)
        self.world.photons = self.world.photons_without = None
        self.world.landed = self.world.landed_without = None
        self.world.landed_added = self.world.landed_taken = None
        if self.floods and self.in_bodies is not None:
            made = (self.world, self.benders, self.in_bodies, count, seed)
            self.world.photons = in_media(*made)
            if self.world.mirrors and self.world.foggy:
                self.world.photons_without = in_media(*made, objects=False)
        if self.lands and self.on_floors is not None:
            self._landed(self.on_floors, count, seed)

    def _landed(self, floors: Cylinders, count: int, seed: int) -> None:
        """Follow the light of lamps without size to surfaces, and what objects change of it where real ones send it."""
        world, made = self.world, (self.world, self.benders, floors, count, seed)
        if not world.mirrors:
            world.landed = on_surfaces(*made)[0]
            return
        world.landed, world.landed_added = on_surfaces(*made)
        world.landed_without, world.landed_taken = on_surfaces(*made, objects=False)

    def seeing(self, camera: Camera) -> Self:
        """The same scene, seen by another camera."""
        other = copy(self)
        other.camera, other.lens = camera, Lens(camera)
        return other

    @property
    def one_by_one(self) -> bool:
        """Whether passes are not traced at once, for each keeps light of its own."""
        return self.floods or self.lands

    def together(self, samples: int) -> int:
        """How many passes of so many samples a pixel are traced at once: starting takes as long for one as for some."""
        if self.one_by_one:
            return 1
        return max(1, BAND // (samples * self.camera.width * self.camera.height))

    def lit(self, samples: int, seed: int, apart: bool = False) -> Planes:
        """What a pass of so many samples a pixel follows from the light, for `with_light`; of the whole picture.

        apart : whether it is kept apart, for pixels that are traced unequally often
        """
        return self.lit_together(samples, [seed], apart)[0]

    def lit_together(self, samples: int, seeds: Sequence[int], apart: bool = False) -> list[Planes]:
        """The same of several passes at once, with the same bits."""
        a_ray = RAYS_OF_LIGHT_APART if apart else RAYS_OF_LIGHT
        count = max(self.camera.width * self.camera.height * samples // a_ray, 1)
        if self.world.mirrors:
            # Of a real mirror the objects are a small part.
            count = max(count, FEWEST_RAYS)
        return self._lit(min(count, MOST_RAYS), seeds)

    def on_picture(self, pixels: np.ndarray, planes: Planes) -> Planes:
        """What `of_pixels` gave of these pixels, in order, in planes of the whole picture that are 0 elsewhere."""
        height, width = self.camera.height, self.camera.width
        whole: Planes = {}
        for name, values in planes.items():
            plane = values
            if len(pixels) < height * width:
                plane = np.zeros((height * width, *values.shape[1:]), np.float32)
                plane[pixels] = values
            whole[name] = plane.reshape(height, width, *values.shape[1:])
        return whole

    def guides(self, samples: int, seed: int) -> Planes:
        """Depth, normal and albedo of what is seen first, the share of each pixel that shows anything, and a denoiser's
        guides: albedo and normal of the first thing that scatters light."""
        pixels = np.arange(self.camera.width * self.camera.height)
        return self.on_picture(pixels, self._over(samples, [seed], self._seen, pixels)[0])

    @abstractmethod
    def _first(self, numbers: Numbers) -> tuple[Any, Any]:
        """Rays from the camera, and what they meet first."""

    def _seen(self, numbers: Numbers) -> dict[str, Any]:
        ray, met = self._first(numbers)
        seen = met.is_valid()
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, seen)
        albedo = si.bsdf(ray).eval_diffuse_reflectance(si, seen)
        behind_albedo, behind_normal = first_scattered(self.world, ray, met, seen)
        return {
            "depth": dr.select(seen, self._depth(si), 0), "seen": mi.Float(seen),
            "normal": dr.select(seen, si.sh_frame.n, 0), "albedo": dr.select(seen, albedo, 0),
            "guide_albedo": behind_albedo + self._beyond(ray, ~seen), "guide_normal": behind_normal,
        }  # fmt: skip

    def _depth(self, si: Any) -> Any:
        """Metres along the ray, as all renderers have it."""
        return dr.norm(si.p - self.lens.place)

    def _beyond(self, ray: Any, active: Any) -> Any:
        """What guides a denoiser where a ray from the camera meets nothing."""
        return mi.Color3f(0)

    def _over(
        self, samples: int, seeds: Sequence[int], trace: Callable[[Numbers], dict[str, Any]], pixels: np.ndarray
    ) -> list[Planes]:
        """For each seed the means over the samples of these pixels; so many pixels at once as memory allows."""
        most = max(1, BAND // (samples * len(seeds)))
        bands: dict[str, list[np.ndarray]] = {}
        for first in range(0, len(pixels), most):
            these = pixels[first : first + most].astype(np.uint32)
            for name, means in self._summed(trace(Numbers(these, samples, seeds)), samples).items():
                # What is the same in all pixels, as 0 where there is no surface, may come as one value.
                rows = np.broadcast_to(means, (len(these) * len(seeds), *means.shape[1:]))
                bands.setdefault(name, []).append(rows.reshape(len(these), len(seeds), *means.shape[1:]))
        whole = {name: np.concatenate(parts) if len(parts) > 1 else parts[0] for name, parts in bands.items()}
        return [
            {name: np.ascontiguousarray(values[:, turn], np.float32) for name, values in whole.items()}
            for turn in range(len(seeds))
        ]

    def _rays(self, numbers: Numbers) -> Any:
        """Rays from the camera."""
        across, down = numbers.within_pixel()
        width = dr.opaque(mi.UInt32, self.camera.width)
        line = numbers.pixel // width
        column, row = mi.Float(numbers.pixel - line * width), mi.Float(line)
        return self.lens.rays(column + across, row + down, two(numbers.stream))

    def _seen_object(self, ray: Any, numbers: Numbers) -> Any:
        """The first of the objects that a ray from the camera meets, but for holes, which let it through by chance."""
        added = self.world.objects.ray_intersect_preliminary(ray, active=mi.Bool(True))
        if not self.pierced:
            return added
        on, gone, stopped = mi.Ray3f(ray), mi.Float(0), mi.Bool(False)
        for _ in range(HOLES):
            si = added.compute_surface_interaction(on, mi.RayFlags.All, added.is_valid())
            through = opaque.grey(si.bsdf(on).eval_null_transmission(si, added.is_valid()))
            passes = added.is_valid() & ~stopped & (numbers.stream.next_float32() < through)
            stopped |= ~passes
            gone += dr.select(passes, added.t, 0)
            # From the camera on: depth and interaction belong to the whole ray.
            on.o = dr.select(passes, ray.o + (gone + STEP) * ray.d, on.o)
            following = self.world.objects.ray_intersect_preliminary(on, active=passes)
            added = dr.select(passes, following, added)
            gone += dr.select(passes, STEP, 0)
        added.t = dr.select(added.is_valid(), added.t + gone, dr.inf)
        return added

    def _solid(self, ray: Any, met: Any) -> Any:
        """What the light of a surface with holes counts where a ray was not let through: its BSDF is of the whole."""
        if not self.pierced:
            return mi.Color3f(1)
        si = met.compute_surface_interaction(ray, mi.RayFlags.All, met.is_valid())
        through = opaque.grey(si.bsdf(ray).eval_null_transmission(si, met.is_valid()))
        return mi.Color3f(1 / dr.maximum(1 - through, 1e-4))

    def _summed(self, values: dict[str, Any], samples: int) -> Planes:
        """The mean over the samples of each pixel, which lie beside each other: the same whatever the threads."""
        dr.eval(values)
        planes = {}
        for name, value in values.items():
            channels = [value] if isinstance(value, mi.Float) else [value.x, value.y, value.z]
            means = [np.array(dr.block_sum(channel, samples)) / samples for channel in channels]
            planes[name] = means[0] if len(means) == 1 else np.stack(means, axis=-1)
        return planes

    def _lit(self, count: int, seeds: Sequence[int]) -> list[Planes]:
        """Light followed from the lamps through the smooth objects, added up on the picture in a fixed order."""
        every = self._sent(count, seeds, True)
        if self.world.mirrors:
            # What it would be without the objects; both follow the same rays until one meets an object.
            for planes, without in zip(every, self._sent(count, seeds, False), strict=True):
                taken = without["difference"]
                planes |= {"difference": planes["difference"] - taken, "taken": taken}
        return every

    def _sent(self, count: int, seeds: Sequence[int], objects: bool) -> list[Planes]:
        spread, size = Spread(count, seeds), count * len(seeds)
        # Of each seed the streams that it has alone: PCG32 adds a ray's place in the list to both.
        turned = mi.UInt64(spread.index) - mi.UInt64(dr.arange(mi.UInt32, size))
        begun = dr.gather(mi.UInt64, mi.UInt64(table([seed + (1 << 40) for seed in seeds], np.uint64)), spread.turn)
        rng = mi.PCG32(size=size, initstate=begun + turned, initseq=turned + STREAM)  # pyright: ignore[reportCallIssue]
        found = caustics(self.world, self.spheres, self.lens, spread, rng, dr.full(mi.Bool, True, size), objects)
        dr.eval(found)
        return [self._splatted(found, count, turn) for turn in range(len(seeds))]

    def _splatted(self, found: list[tuple[Any, Any, Any]], count: int, turn: int) -> Planes:
        """What the rays of one of the seeds bring, added up in their order."""
        height, width = self.camera.height, self.camera.width
        planes = {name: np.zeros(height * width * 3) for name in ("objects", "difference")}
        mine = slice(turn * count, (turn + 1) * count)
        for point, flux, on_object in found:
            light = np.array(flux)[:, mine]
            landed = light.max(axis=0) > 0
            light = light[:, landed].astype(np.float64) / count
            at = np.array(point)[:, mine][:, landed].astype(np.int64)
            pixel = np.minimum(at[1], height - 1) * width + np.minimum(at[0], width - 1)
            added = np.array(on_object)[mine][landed]
            for name, chosen in (("objects", added), ("difference", ~added)):
                # All channels in one go, as they lie in the picture.
                values = 3 * pixel[chosen, None] + np.arange(3)
                planes[name] += np.bincount(values.ravel(), light[:, chosen].T.ravel(), height * width * 3)
        return {name: plane.reshape(height, width, 3) for name, plane in planes.items()}


def built(shapes: Sequence[Shape]) -> Any:
    """A Mitsuba scene of shapes alone."""
    parts = {}
    for index, shape in enumerate(shapes):
        material = material_on(shape)
        surface, glow = bsdf(mi, material, media=True, dispersion=True), emission(mi, material)
        parts[f"shape_{index:06d}"] = _shape(mi, shape, surface, glow)
    return mi.load_dict({"type": "scene", **parts}, optimize=False)


def bodies_of(shapes: Sequence[Shape], scene: Any, media: Media | None) -> list[Body]:
    """The shapes as light meets them; `scene` as Mitsuba has it, `media` what fills them."""
    made = scene.shapes_dr()
    numbers = np.array(dr.reinterpret_array(mi.UInt32, made))
    filled = np.zeros(len(shapes)) if media is None else np.array(media.number(made))
    bends = _bending(shapes, scene)
    return [
        Body(int(numbers[index]), int(filled[index]), sphere_round(shape)[1], bends[index])
        for index, shape in enumerate(shapes)
    ]


def stand_in_bodies(world: World, shapes: Sequence[Shape], bodies: Sequence[Body]) -> None:
    """Give the world's lamps the numbers of what fills their places."""
    numbers = [body.medium for body in bodies]
    world.light.stand_in([filled_with(lamp, shapes, numbers, world.outside) for lamp in world.light.lamps])


def senders(shapes: Sequence[Shape], scene: Any) -> tuple[Spheres, Spheres]:
    """Spheres round the shapes that send light on nearly in one direction, and round those that do so in just one and
    bend it there; `scene` as Mitsuba has it."""
    bends = _bending(shapes, scene)
    round_all = [opaque.sphere(*sphere_round(shape)) for shape in shapes]
    narrowly = [sends_narrowly(shape.material) for shape in shapes]
    nearly = [each for each, *sends in zip(round_all, bends, narrowly, strict=True) if any(sends)]
    return nearly, [each for each, bent in zip(round_all, bends, strict=True) if bent]


def real_senders(scene: Scene, local: Any) -> tuple[Spheres, list[tuple[int, Any, Any]]]:
    """The same round real surfaces; and which planes reach farther, by number, with their sphere.

    local : the real surfaces as Mitsuba has them; None for none
    """
    if local is None:
        return [], []
    spheres, clipped = [], []
    around, widest = sphere_round_shapes(scene.objects)
    numbers = np.array(dr.reinterpret_array(mi.UInt32, local.shapes_dr()))
    for shape, bent, number in zip(scene.local, _bending(scene.local, local), numbers, strict=True):
        if not bent:
            continue
        centre, radius = sphere_round(shape)
        if isinstance(shape, Plane):
            side = np.array(shape.extent) / 2
            foot = np.array(
                [np.clip(around[0], -side[0], side[0]), shape.height, np.clip(around[2], -side[1], side[1])]
            )
            reach = MIRRORED * widest + 2 * float(np.linalg.norm(around - foot))
            if reach < radius:
                centre, radius = foot, reach
                clipped.append((int(number), *opaque.sphere(centre, radius)))
        spheres.append(opaque.sphere(centre, radius))
    return spheres, clipped


def fog_of(scene: Scene, light: SceneLight) -> tuple[np.ndarray, float] | None:
    """The sphere that a scene's medium ends at; None where it has none, or ends at the walls of the distant scene.

    An infinite distant scene has no walls, and neither has a dark one. Raises UnsupportedScene (`require_edges`).
    """
    if scene.medium is None or (light.map is not None and not isinstance(scene.distant, Infinite)):
        return None
    require_edges(scene)
    return sphere_round_all(scene)


def _bending(shapes: Sequence[Shape], scene: Any) -> list[bool]:
    """Whether each shape sends light on in one direction, and not straight."""
    sent = [bool(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Delta)) for shape in scene.shapes()]
    return [bends and crossed_straight(shape.material) is None for shape, bends in zip(shapes, sent, strict=True)]
