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
from typing import Any, Protocol, Self

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.errors import ClusterUnusable, UnsupportedScene
from relume.renderers.mitsuba import scalar
from relume.renderers.mitsuba.denoise import denoised_render
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.mitsuba.limits import GUIDE_SAMPLES, GUIDES, PASS_RAYS, PASSES, samples_a_pass
from relume.renderers.mitsuba.scene import why_not
from relume.renderers.mitsuba.variant import choose_llvm, choose_variant, why_not_here
from relume.renderers.progressive.accumulation import NO_SESSION, Planes, RenderSession, accumulate, pass_seed
from relume.renderers.progressive.convergence import Target, standard_error
from relume.renderers.progressive.fingerprint import fingerprint, render_key
from relume.renderers.progressive.pass_workers import WholePasses
from relume.renderers.renderer import Moments, Renderer
from relume.renderers.results import Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene


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
    """Path tracing with multiple importance sampling of the light; what lamps send through glass is followed from them.

    samples : rays a pixel, at most; 256 shows little noise on what the light reaches directly
    noise : stop earlier, once the standard error of the picture's mean pixel is below this share of it; None traces
        all samples
    depth : bounces before a path ends; 12 lets light into and out of glass before and behind glass. Scatterings within
        a medium do not count
    variant : Mitsuba's variant; chosen for this machine unless given. A scalar one takes Mitsuba's own path tracers
    threads : all cores unless given; the pixels do not depend on it
    passes : exactly this many passes of the `samples` are traced, to repeat what a render with `noise` traced
    denoise : whether the picture is cleaned by Open Image Denoise; its variance is that of what was traced
    """

    passes: int | None = None
    denoise: bool = False

    def render(
        self,
        scene: Scene,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        watch: RenderSession = NO_SESSION,
        moments: Moments | None = None,
        shutter: Shutter = Shutter(0.0, 0.0),
    ) -> Render:
        """Render in passes of equal size; the passes' scatter is the variance.

        seed : of the random numbers
        progress : called with the share of the work that is done, 0 to 1
        watch : what goes on around it: a state kept on disk, previews
        moments : the scene and the camera at each moment of the exposure, where something moves; `scene` and `camera`
            are those in its middle, of which depth, normals and albedo are
        shutter : which moments

        Raises UnsupportedScene naming what cannot be shaded, ValueError for objects outside the distant scene.
        """
        if (reason := why_not(scene)) is not None:
            raise UnsupportedScene(reason)
        require_inside(scene.distant, scene.probe, scene.objects)
        with _mitsuba(self.variant, self.threads) as mi, ExitStack() as stack:
            # How many passes, of how many samples, at which times of the shutter.
            samples = _samples_of(mi, self.samples, camera)
            passes = self.passes or max(self.samples // samples, 2)
            times = shutter.times(passes, seed) if moments is not None else np.zeros(passes)
            at = {pass_seed(seed, index): float(time) for index, time in enumerate(times)}
            # A pass by its seed: traced here, or by workers.
            whole = PlainPasses(self.for_workers(), scene, camera, samples)
            still = whole.made(mi)
            trace: Callable[[int], Planes] = still.traced
            if watch.workers is not None:
                if moments is not None:
                    raise ValueError("workers trace a still; make the frames of a motion by workers instead")
                parts = stack.enter_context(watch.workers.sharing(whole))
                trace = WholePasses(parts, list(at))
            elif moments is not None:
                trace = lambda own: whole.at(*moments(at[own])).made(mi).traced(own)  # noqa: E731
            # The passes.
            early = self.noise is not None and self.passes is None
            sums = accumulate(
                trace,
                passes=passes,
                seed=seed,
                scattered=("radiance",),
                target=Target(self.noise or 1, standard_error, confirmations=1) if early else None,
                key=self._key(scene, camera, seed, moments, times) if watch.checkpoint is not None else None,
                watch=watch,
                progress=progress,
            )
            # Depth, normals and albedo, which need few samples.
            planes = still.guides(min(GUIDE_SAMPLES, GUIDES * self.samples), seed)
        planes |= {name: sums.mean(name) for name in sums.totals} | {"variance": sums.variance("radiance")}
        planes = {name: plane.astype(np.float32) for name, plane in planes.items()}
        traced = Render(**planes, samples=sums.passes * samples, passes=sums.passes)
        return denoised_render(traced) if self.denoise else traced

    def _key(
        self, scene: Scene, camera: Camera, seed: int, moments: Moments | None, times: np.ndarray
    ) -> dict[str, str]:  # fmt: skip
        """All that a pixel depends on: also every moment that is seen."""
        # What is traced, which cleaning leaves as it is.
        key = dict(render_key(scene, camera, replace(self, denoise=False), seed))
        if moments is not None:
            key["motion"] = fingerprint([[list(moments(float(time))) for time in sorted(set(times))]])
        return key


class Passes(Protocol):
    """A scene and a camera, made ready for passes."""

    def traced(self, seed: int) -> Planes:
        """The planes of a pass."""
        ...

    def guides(self, samples: int, seed: int) -> dict[str, np.ndarray]:
        """Planes beside the picture, from so many samples a pixel."""
        ...


@dataclass(frozen=True, eq=False)
class PlainPasses:
    """Passes of a picture by `Mitsuba`, each a part by its seed.

    samples : rays a pixel of a pass
    """

    renderer: Mitsuba
    scene: Scene
    camera: Camera
    samples: int

    def at(self, scene: Scene, camera: Camera) -> PlainPasses:
        """The same of another moment."""
        return replace(self, scene=scene, camera=camera)

    def made(self, mi: Any) -> Passes:
        """Made ready, for where Mitsuba's variant is set."""
        if "_ad_" not in mi.variant():
            return _ScalarPasses(mi, self)
        return _OwnPasses(self)

    def ready(self) -> Callable[[int], Planes]:
        """The function of a pass's seed for a worker, which uses its share of the cores."""
        return in_worker(lambda mi: self.made(mi).traced, self.renderer.variant, self.renderer.threads)


class _OwnPasses:
    """By relume's own transport."""

    def __init__(self, given: PlainPasses) -> None:
        from relume.renderers.mitsuba.transport.plain import Plain

        self.plain, self.samples = Plain(given.scene, given.camera, given.renderer.depth), given.samples

    def traced(self, seed: int) -> Planes:
        return self.plain.traced(self.samples, seed)

    def guides(self, samples: int, seed: int) -> dict[str, np.ndarray]:
        camera = self.plain.camera
        found = self.plain.guides(min(samples, max(1, PASS_RAYS // (camera.width * camera.height))), seed)
        planes = {name: found[name] for name in ("normal", "albedo", "guide_normal", "guide_albedo")}
        return planes | {"depth": found["depth"] / np.maximum(found["seen"], 1e-12)}


class _ScalarPasses:
    """By Mitsuba's own path tracers."""

    def __init__(self, mi: Any, given: PlainPasses) -> None:
        self.mi, self.given = mi, given
        self.trace = scalar.trace_of(mi, given.scene, given.camera, given.renderer.depth, isqrt(given.samples))

    def traced(self, seed: int) -> Planes:
        return self.trace(seed)

    def guides(self, samples: int, seed: int) -> dict[str, np.ndarray]:
        return scalar.guides_of(self.mi, self.given.scene, self.given.camera, seed)


def _samples_of(mi: Any, samples: int, camera: Camera) -> int:
    """Rays a pixel of a pass; for Mitsuba's own path tracers a square, one ray a cell."""
    if "_ad_" in mi.variant():
        return samples_a_pass(samples, camera)
    return scalar.side_of(camera, max(samples // PASSES, 1)) ** 2


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
