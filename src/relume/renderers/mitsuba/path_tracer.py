"""Light transport by Mitsuba 3 (path tracing): the renderer of the main job.

Only `render/mitsuba*` imports Mitsuba and Dr.Jit, and only when something is rendered.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isqrt
from typing import Any, Self

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.errors import ClusterUnusable
from relume.renderers.mitsuba.materials import filling
from relume.renderers.mitsuba.scene import matte_dictionary, scene_dictionary, surfaces_dictionary
from relume.renderers.mitsuba.variant import choose_llvm, choose_variant, why_not_here
from relume.renderers.progressive.accumulation import NO_SESSION, Planes, RenderSession, accumulate, pass_seed
from relume.renderers.progressive.convergence import Target, standard_error
from relume.renderers.progressive.fingerprint import render_key
from relume.renderers.progressive.pass_workers import WholePasses
from relume.renderers.raytrace.alpha_coverage import coverage, is_pierced
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.lights import SphereLight
from relume.scene.scene import Scene

PASS_RAYS = 4_000_000
"""Rays traced at once: under about half a gigabyte, and about two seconds of two cores, so that a first Ctrl-C is
answered in time."""
PASSES = 16
"""Passes at least, where the samples allow it: the scatter of 16 estimates a pixel's variance to a third of itself."""
MATTE_SAMPLES = 64
"""Rays a pixel for the matte and the other planes: coverage to about a hundredth at edges."""
WALK = 10_000
"""Scatterings inside a body, at most: a white ball 67 mean free paths across keeps 0.98 of its light in 1000."""
FAIR = 1000
"""Of them before chance ends a path: ended earlier, a few lucky paths carry all the light."""


@dataclass(frozen=True)
class PathTracing(Renderer):
    """The settings that both path tracers have, and their limits."""

    samples: int = 256
    noise: float | None = None
    depth: int = 12
    variant: str | None = None
    threads: int | None = None

    def __post_init__(self) -> None:
        if self.samples < 2 or self.depth < 1 or (self.noise is not None and not self.noise > 0):
            raise ValueError(
                f"samples {self.samples}, depth {self.depth}, noise {self.noise}; expected at least 2, 1 and above 0"
            )
        if self.threads is not None and self.threads < 1:
            raise ValueError(f"threads is {self.threads}; expected at least 1, or none for all cores")

    def for_workers(self) -> Self:
        """The same with the variant that runs here named, for all parts of a picture are of one."""
        return replace(self, variant=self.variant or _imported(None)[2])


@dataclass(frozen=True)
class Mitsuba(PathTracing):
    """Unidirectional path tracing with multiple importance sampling of the light.

    samples : rays a pixel, at most; 256 shows little noise on what the light reaches directly
    noise : stop earlier, once the standard error of the picture's mean pixel is below this share of it; None traces
        all samples
    depth : bounces before a path ends; 12 lets light into and out of glass before and behind glass. Where bodies
        scatter light inside, whose scatterings Mitsuba counts alike, `WALK` more
    variant : Mitsuba's variant; chosen for this machine unless given
    threads : all cores unless given; the pixels do not depend on it
    passes : exactly this many passes of the `samples` are traced, to repeat what a render with `noise` traced
    """

    passes: int | None = None

    def render(
        self,
        scene: Scene,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        watch: RenderSession = NO_SESSION,
    ) -> Render:
        """Render in passes of equal size; the passes' scatter is the variance.

        watch : what goes on around it: a state kept on disk, previews
        """
        with _mitsuba(self.variant, self.threads) as mi, ExitStack() as stack:
            side = _side(camera, max(self.samples // PASSES, 1))
            passes = self.passes or max(self.samples // side**2, 2)
            early = self.noise is not None and self.passes is None
            # A pass by its seed: traced here, or by workers.
            whole = PlainPasses(self.for_workers(), scene, camera, side)
            if watch.workers is None:
                trace = whole.made(mi)
            else:
                parts = stack.enter_context(watch.workers.sharing(whole))
                trace = WholePasses(parts, [pass_seed(seed, index) for index in range(passes)])
            sums = accumulate(
                trace,
                passes=passes,
                seed=seed,
                target=Target(self.noise or 1, standard_error, confirmations=1) if early else None,
                key=render_key(scene, camera, self, seed) if watch.checkpoint is not None else None,
                watch=watch,
                progress=progress,
            )
            finer = _finer(camera, _side(camera, MATTE_SAMPLES))
            world = mi.load_dict(surfaces_dictionary(mi, scene, finer, media=True))
            depth, normal, albedo = _planes(mi, world, camera, seed)
            matte = _matte(mi, scene, camera, seed)
        radiance, variance = (p.astype(np.float32) for p in (sums.mean("radiance"), sums.variance("radiance")))
        return Render(radiance, variance, matte, depth, normal, albedo, sums.passes * side**2, sums.passes)

    def _integrator(self, scene: Scene) -> dict[str, Any]:
        """Mitsuba's path tracer, or the one that also goes through what fills bodies and through lamps."""
        media = [medium for shape in (*scene.local, *scene.objects) if (medium := filling(shape.material)) is not None]
        if not media and not any(isinstance(light, SphereLight) for light in scene.lights):
            return {"type": "path", "max_depth": self.depth + 1, "rr_depth": 8}
        if any(any(medium.scattering) for medium in media):
            return {"type": "volpathmis", "max_depth": self.depth + 1 + WALK, "rr_depth": FAIR}
        return {"type": "volpathmis", "max_depth": self.depth + 1, "rr_depth": 8}


@dataclass(frozen=True, eq=False)
class PlainPasses:
    """Passes of a picture by `Mitsuba`, each a part by its seed.

    side : cells along each side of a pixel, with a ray each
    """

    renderer: Mitsuba
    scene: Scene
    camera: Camera
    side: int

    def made(self, mi: Any) -> Callable[[int], Planes]:
        """The function of a pass's seed, for where Mitsuba's variant is set."""
        world = mi.load_dict(scene_dictionary(mi, self.scene, _finer(self.camera, self.side), media=True))
        path = mi.load_dict(self.renderer._integrator(self.scene))
        return lambda seed: {"radiance": _cells_mean(_traced(mi, world, path, seed), self.side)}

    def ready(self) -> Callable[[int], Planes]:
        """The same for a worker, which uses its share of the cores."""
        return in_worker(self.made, self.renderer.variant, self.renderer.threads)


def in_worker(
    made: Callable[[Any], Callable[[Any], Planes]], variant: str | None, threads: int | None
) -> Callable[[Any], Planes]:
    """A function that `made` makes of Mitsuba, for a process where other work may set another variant in between.

    Raises ClusterUnusable where the variant does not run here.
    """
    require_here(variant)
    with _mitsuba(variant, threads or worker_threads()) as mi:
        trace = made(mi)

    def with_variant(part: Any) -> Planes:
        with _mitsuba(variant, threads or worker_threads()):
            return trace(part)

    return with_variant


def require_here(variant: str | None) -> None:
    """Raise ClusterUnusable where a worker's machine has not the variant of the process that gave it the work."""
    if variant is not None and (why := why_not_here(variant)):
        raise ClusterUnusable(
            f"a worker on {socket.gethostname()} cannot render by Mitsuba's {variant} as this machine does: {why}"
        )


def _side(camera: Camera, samples: int) -> int:
    """Cells along each side of a pixel, so that a pass of one ray a cell has no more than `samples` and PASS_RAYS."""
    return max(1, isqrt(min(samples, PASS_RAYS // (camera.width * camera.height))))


def _finer(camera: Camera, side: int) -> Camera:
    """The same camera with side² pixels for each of its own.

    One ray goes through each of them, so that no two threads ever add to the same pixel, in whatever order.
    """
    return camera.resized(camera.width * side, camera.height * side)


def _traced(mi: Any, world: Any, integrator: Any, seed: int) -> np.ndarray:
    return np.array(mi.render(world, integrator=integrator, spp=1, seed=seed))


def _cells_mean(picture: np.ndarray, side: int, hit: np.ndarray | None = None) -> np.ndarray:
    """The mean over each pixel's cells in a fixed order; over those that `hit` something only, where that is given."""
    total, count = 0.0, 0.0
    for row in range(side):
        for column in range(side):
            cell = picture[row::side, column::side].astype(np.float64)
            total = total + cell
            count = count + (1.0 if hit is None else hit[row::side, column::side])
    return np.asarray(total / np.maximum(count, 1))


def _planes(mi: Any, world: Any, camera: Camera, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    integrator = mi.load_dict({"type": "aov", "aovs": "depth:depth,normal:sh_normal,albedo:albedo"})
    side = _side(camera, MATTE_SAMPLES)
    # The first three channels are the nested integrator's picture where there is one.
    planes = _traced(mi, world, integrator, pass_seed(seed, 0))[..., -7:]
    depth = _cells_mean(planes[..., 0], side, planes[..., 0] > 0)
    normal, albedo = np.split(_cells_mean(planes[..., 1:], side), 2, axis=-1)
    return depth.astype(np.float32), normal.astype(np.float32), albedo.astype(np.float32)


def _matte(mi: Any, scene: Scene, camera: Camera, seed: int) -> np.ndarray:
    if not scene.objects:
        return np.zeros((camera.height, camera.width), np.float32)
    side = _side(camera, MATTE_SAMPLES)
    if any(is_pierced(shape.material) for shape in scene.objects):
        return coverage(scene, camera, MATTE_SAMPLES, seed)
    world = mi.load_dict(matte_dictionary(mi, scene, _finer(camera, side)))
    whiteness = mi.load_dict({"type": "aov", "aovs": "albedo:albedo"})
    passes = -(-MATTE_SAMPLES // side**2)
    pictures = (_traced(mi, world, whiteness, pass_seed(seed, index))[..., -3] for index in range(passes))
    matte = sum(_cells_mean(picture, side) for picture in pictures) / passes
    return np.clip(matte, 0, 1).astype(np.float32)


def give_back() -> None:
    """Free what Dr.Jit keeps for arrays of the same sizes: the next render may have others, and be the last."""
    if (dr := sys.modules.get("drjit")) is not None:
        dr.flush_malloc_cache()


@contextmanager
def _mitsuba(variant: str | None, threads: int | None) -> Iterator[Any]:
    """Mitsuba with its variant and threads set for as long as it is used."""
    mi, dr, chosen = _imported(variant)
    variant_before, threads_before = mi.variant(), dr.thread_count()
    mi.set_variant(chosen)
    dr.set_thread_count(threads or threads_before)
    try:
        yield mi
    finally:
        dr.set_thread_count(threads_before)
        give_back()
        # Where none was set the usual one stays: each render after an unusual one would else set its variant twice.
        after = variant_before or _imported(None)[2]
        if after != chosen:
            mi.set_variant(after)


@lru_cache
def _imported(variant: str | None) -> tuple[Any, Any, str]:
    choice = choose_llvm() if variant is not None and variant.startswith("llvm") else choose_variant()
    # Dr.Jit reads the path when it is imported.
    if choice.library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = choice.library
    import drjit
    import mitsuba

    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba, drjit, variant or choice.name
