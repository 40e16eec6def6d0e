"""The renderer `PhotonMap`: light is followed from the lamps and kept where it lands, then looked up by what is seen.

A teaching renderer: global and caustic photon map, final gathering, fog (Jensen 1996, 2001; Jensen and Christensen
1998), in passes whose radius shrinks (Knaus and Zwicker 2011), so that the picture's bias goes as the passes go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import warn
from relume.renderers.diffuse.checks import require_pinhole, require_whole
from relume.renderers.photon_map.density import Maps
from relume.renderers.photon_map.gathering import Gathering
from relume.renderers.photon_map.stage import EVEN, WHOSE, Stage, lamps_of
from relume.renderers.photon_map.tracing import Flight, followed
from relume.renderers.raytrace.extent import sphere_round_all
from relume.renderers.raytrace.lamps import Ball, Environment, Lamp, Point, Sent, Surface
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene

AT_ONCE = 1 << 14
"""Pixels whose rays are followed together."""


@dataclass(frozen=True, eq=False)
class PhotonStep:
    """A picture by photons as far as it is.

    render : the mean of the passes so far
    flight, caustics : where this pass's photons went: of the global map and fog, and of the caustic map
    radius : (H, W) metres, of the disc of photons at what each pixel shows; 0 where there was none
    """

    render: Render
    flight: Flight
    caustics: Flight
    radius: np.ndarray


@dataclass(frozen=True)
class PhotonMap(Renderer):
    """Photon mapping (Jensen 1996), for teaching and comparison: even surfaces, smooth mirrors and glass, fog.

    photons : sent in each pass for the global map; where glass or mirrors are, as many at them for the caustic map
    neighbours : photons in the disc of a density estimate; fewer are noisier, more blur
    gather : rays of final gathering from each point in each pass; 0 shows the global map itself
    shadows : shadow rays to each lamp with a size, from each point in each pass
    passes : each sends photons anew, and one ray a pixel
    shrink : α of progressive photon mapping: of the photons that a pass would add to a disc, the share that is kept as
        the disc shrinks; 1 keeps the radius
    march : points along a ray in a fog, in each pass
    depth : bounces of a photon, at most
    threads : all cores unless given; the pixels do not depend on it
    """

    photons: int = 50_000
    neighbours: int = 50
    gather: int = 8
    shadows: int = 2
    passes: int = 16
    shrink: float = 2 / 3
    march: int = 8
    depth: int = 100
    threads: int | None = None

    def __post_init__(self) -> None:
        require_whole(self, photons=1, neighbours=2, gather=0, shadows=1, passes=1, march=1, depth=1, threads=1)
        if max(self.photons, self.neighbours, self.gather) > 2_000_000:
            raise ValueError("photons, neighbours or gather is above 2000000, more than memory holds; raise passes")
        if not 0 < self.shrink <= 1:
            raise ValueError(f"shrink is {self.shrink}; expected a share above 0, at most 1")

    def render(self, scene: Scene, camera: Camera, *, seed: int = 0, progress: Progress | None = None) -> Render:
        """Render all passes, as `Renderer.render`; their scatter is the variance, without the estimate's bias."""
        last = None
        for last in self.steps(scene, camera, seed=seed):
            if progress:
                progress(last.render.passes / self.passes)
        assert last is not None
        if (lost := last.flight.cut.sum() / last.flight.sent.sum()) > 1e-3:
            warn(f"{lost:.1%} of the photons' power was still on its way after {self.depth} bounces; raise the depth")
        return last.render

    def steps(self, scene: Scene, camera: Camera, *, seed: int = 0) -> Iterator[PhotonStep]:
        """The picture after each pass, with the photons of that pass.

        scene, camera : what is rendered, and whose picture it is
        seed : of the photons and rays
        Raises UnsupportedScene naming what photons cannot meet, and a lens with an aperture.
        """
        require_pinhole(camera, WHOSE)
        shapes, lamps = (*scene.local, *scene.objects), lamps_of(scene)
        near = shapes or any(isinstance(lamp, Point | Surface) for lamp in lamps)
        whole = sphere_round_all(scene) if near else (np.zeros(3), 1.0)
        stage = Stage.of(shapes, whole, scene.medium, self.threads)
        seen = [lamp.shape for lamp in lamps if isinstance(lamp, Surface) and lamp.shape not in shapes]
        lit = Stage.of(seen, whole, None, self.threads) if seen else None
        sky = next((lamp.bright.light for lamp in lamps if isinstance(lamp, Environment)), None)
        rays = [(lamp, self.shadows if isinstance(lamp, Surface | Environment) else 1) for lamp in lamps]
        smooth = [shape for shape, kind in zip(shapes, stage.kind[:-1], strict=True) if kind != EVEN]
        aim = sphere_round_all(replace(scene, local=tuple(smooth), objects=(), lights=())) if smooth else whole
        pixels, share = camera.height * camera.width, 1.0
        sums = np.zeros((pixels, 15))
        for index in range(self.passes):
            # Photons on their way, and the maps of where they landed.
            random = np.random.default_rng([seed, index, 0])
            flight = self._flown(stage, lamps, whole, random, caustics=False)
            caustics = self._flown(stage, lamps if smooth else (), aim, random, caustics=True)
            maps = Maps.of(flight, caustics, self.neighbours, 2 * whole[1], np.sqrt(share), self.threads)
            gathering = Gathering(stage, rays, lit, sky, maps, self.gather, self.march, self.depth)
            radius = np.zeros(pixels)
            # One ray through each pixel, anywhere in it.
            for part in range(0, pixels, AT_ONCE):
                random = np.random.default_rng([seed, index, 1, part])
                number = np.arange(part, min(part + AT_ONCE, pixels))
                row, column = np.divmod(number, camera.width)
                # Additive recurrence spreads the passes' rays better than chance (Roberts 2018).
                shift = np.random.default_rng([seed, part]).random((len(number), 2))
                points = np.stack([column, row], -1) + (shift + index * np.array([0.7548776662, 0.5698402910])) % 1
                ways = camera.rays_through(points)
                eyes = np.array(camera.eyes(points))
                radiance, radius[number] = gathering.seen(eyes, ways, random)
                sums[number] += np.concatenate([radiance, radiance**2, _planes(stage, eyes, ways, scene)], axis=1)
            render = _render(sums, index + 1, camera)
            yield PhotonStep(render, flight, caustics, radius.reshape(camera.height, camera.width))
            # Of Knaus and Zwicker's eq. 15, counted from 1.
            share *= (index + 1 + self.shrink) / (index + 2)

    def _flown(
        self, stage: Stage, lamps: tuple[Lamp, ...], ball: Ball, random: np.random.Generator, *, caustics: bool
    ) -> Flight:
        """Photons of all lamps, more from those that send more, and where they went."""
        # A few photons say how much each lamp sends.
        flux = np.array([lamp.sent(random, 256, ball).power.sum() for lamp in lamps])
        counts = np.ceil(self.photons * flux / max(flux.sum(), 1e-300)).astype(int)
        nothing = Sent(*np.zeros((3, 0, 3)))
        sent = [lamp.sent(random, count, ball) for lamp, count in zip(lamps, counts, strict=True)]
        together = Sent(*map(np.concatenate, zip(nothing, *sent, strict=True)))
        return followed(stage, together, random, self.depth, caustics)


def _planes(stage: Stage, eyes: np.ndarray, rays: np.ndarray, scene: Scene) -> np.ndarray:
    """Whether there is anything, matte, depth, normal and albedo of what rays meet first, (N, 9)."""
    met = stage.meet(eyes, rays)
    there = met.shape >= 0
    depth = np.where(there, met.distance, 0.0)
    columns = np.stack([there, met.shape >= len(scene.local), depth], axis=-1)
    return np.concatenate([columns, there[:, None] * met.normal, met.colour], axis=1)


def _render(sums: np.ndarray, passes: int, camera: Camera) -> Render:
    """The picture that is in the sums of passes, (H·W, 15)."""
    means = (sums / passes).reshape(camera.height, camera.width, 15)
    spread = np.maximum(means[..., 3:6] - means[..., :3] ** 2, 0) / (passes - 1 or np.nan)
    there = np.maximum(means[..., 6:7], 1e-30)
    planes = (
        means[..., :3], spread, means[..., 7], means[..., 8] / there[..., 0], means[..., 9:12] / there,
        means[..., 12:] / there,
    )  # fmt: skip
    return Render(*(plane.astype(np.float32) for plane in planes), samples=passes, passes=passes)
