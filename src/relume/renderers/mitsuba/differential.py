"""Differential rendering by path tracing: what objects change of a picture, estimated as such (Debevec 1998, §6).

Two pictures, with the objects and without, hold the same noise twice and differ by little. Here a path is one in both
scenes until an added object parts it; what both share cancels before it is ever added up, so that nothing but the
change has noise, and what nothing changes is 0 to the bit. From the real surfaces directions are drawn towards the
objects, beside the light's and the surface's own, weighed by the balance heuristic (Veach & Guibas 1995).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.mitsuba.limits import (
    GUIDE_SAMPLES,
    GUIDES,
    PASS_RAYS,
    SPREAD_RAYS,
    passes_of_change,
    samples_a_pass,
)
from relume.renderers.mitsuba.path_tracer import Mitsuba, PathTracing, _mitsuba, in_worker
from relume.renderers.mitsuba.scene import why_not
from relume.renderers.progressive.accumulation import NO_SESSION, Planes, RenderSession, accumulate, pass_seed
from relume.renderers.progressive.allocation import AT_ONCE, Neediest
from relume.renderers.progressive.convergence import LEAST, ChangeError, Target
from relume.renderers.progressive.fingerprint import fingerprint, render_key
from relume.renderers.progressive.pass_workers import Parts, WholePasses
from relume.renderers.renderer import Moments, subtracted
from relume.renderers.results import Change, Progress, Render
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene

if TYPE_CHECKING:
    from relume.renderers.mitsuba.transport.estimator import Estimator

QUICK_GUIDES = 1
"""The same of a render that is to come soon."""
FEWEST_RAYS = 100_000
"""Of a pass that is shared by workers, in each share: below that starting is all that it takes."""
AS_GOOD_AS = 2.0
"""Times the samples: a picture whose rays are spread is as good as one of so many for every pixel. Noise that is not
even costs a denoiser a little: with 1.5 the denoised room was a hundredth farther from the truth beside the objects."""
EVEN_RAYS = 8
"""Of every pixel, where four passes hold as many: fewer miss what is small, and say little of the noise about it."""
MOST = 2.5
"""Times the samples, the rays that a pixel is given at most: beyond that its neighbours' are used better."""


@dataclass(frozen=True)
class Differential(PathTracing):
    """Path tracing of what objects change, estimated as such; its plain renders are those of `Mitsuba`.

    samples : rays a pixel on average, at most; 256 shows little noise on what the light reaches directly. Many rays are
        spread as the noise is, and are fewer where little of the picture has noise: as many as are as good as twice the
        samples for every pixel
    noise : go on until all samples are traced, or until the mean error to be expected where the objects change
        anything is below this share of the picture; None where the samples say how good it is to be
    depth : bounces before a path ends; 12 lets light into and out of glass before and behind glass
    variant : Mitsuba's variant; chosen for this machine unless given. A scalar one renders two pictures with the same
        random numbers and subtracts them
    threads : all cores unless given; the pixels do not depend on it
    quick : for a picture that is looked at while it changes. All samples go in one pass where memory allows, for to
        start a pass of few takes longer than to trace it; depth, normals and albedo get few. The variance is then
        unknown
    """

    quick: bool = False

    def _plain(self) -> Mitsuba:
        return Mitsuba(self.samples, self.noise, self.depth, self.variant, self.threads)

    def render(
        self,
        scene: Scene,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        moments: Moments | None = None,
        shutter: Shutter = Shutter(0.0, 0.0),
    ) -> Render:
        """Render one picture by `Mitsuba` with the same settings.

        scene, camera : what is rendered, and whose picture it is
        seed : of the random numbers
        progress : called with the share of the work that is done, 0 to 1
        moments, shutter : as in `change`
        """
        return self._plain().render(scene, camera, seed=seed, progress=progress, moments=moments, shutter=shutter)

    def change(
        self,
        scene: Scene,
        camera: Camera,
        *,
        seed: int = 0,
        progress: Progress | None = None,
        watch: RenderSession = NO_SESSION,
        plate: np.ndarray | None = None,
        moments: Moments | None = None,
        shutter: Shutter = Shutter(0.0, 0.0),
        prepared: Any = None,
    ) -> Change:
        """What the scene's objects change of what the camera sees.

        seed : of the random numbers
        progress : called with the share of the work that is done, 0 to 1
        watch : what goes on around a long render: a state kept on disk, previews
        plate : (H, W, 3) what is seen without them, for `noise`; the change alone is looked at unless given
        moments : the scene and the camera at each moment of the exposure, where something moves; `scene` and `camera`
            are those in its middle
        shutter : which moments
        prepared : the scene as `prepare` made it ready; made ready here unless given

        Raises UnsupportedScene naming what cannot be shaded, ValueError for objects outside the distant scene.
        """
        if (reason := why_not(scene)) is not None:
            raise UnsupportedScene(reason)
        require_inside(scene.distant, scene.probe, scene.objects)
        if not scene.objects:
            return _nothing(camera)
        with _mitsuba(self.variant, self.threads) as mi, ExitStack() as stack:
            if "_ad_" not in mi.variant():
                if watch.workers is not None:
                    warn("Mitsuba compiles nothing on this machine, so that the picture is rendered here alone")
                return subtracted(replace(self._plain(), noise=None), scene, camera, seed=seed, progress=progress)
            from relume.renderers.mitsuba.transport.estimator import Estimator

            # How many passes, of how many samples, at which times of the shutter.
            fewest = passes_of_change(self.samples, camera) if moments is None else None
            samples = samples_a_pass(self.samples, camera, 1 if self.quick else fewest)
            full = max(self.samples // samples, 1 if self.quick else 2)
            even, passes = _spread_of(full, samples, camera) if moments is None else (full, full)
            # Less noise may be asked for than that of even rays.
            enough = AS_GOOD_AS * full if self.noise is None else None
            backdrop = np.zeros((camera.height, camera.width, 3)) if plate is None else plate
            still = Estimator(scene, camera, self.depth) if prepared is None else prepared.seeing(camera)
            times = shutter.times(passes, seed) if moments is not None else np.zeros(passes)
            at = {pass_seed(seed, index): float(time) for index, time in enumerate(times)}

            def moved(seed: int) -> Planes:
                return Estimator(*moments(at[seed]), self.depth).traced(samples, seed)  # pyright: ignore[reportOptionalCall]

            trace: Callable[..., Planes] = Together(still, samples, list(at), even) if moments is None else moved
            if watch.workers is not None:
                if moments is not None:
                    raise ValueError("workers trace a still; of what moves they make whole frames (insert_frames)")
                parts = stack.enter_context(
                    watch.workers.sharing(ChangeParts(self.for_workers(), scene, camera, samples, even < passes))
                )
                trace = SpreadChange(parts, still, samples, list(at)[:even], even < passes)

            # The passes.
            target = None if self.noise is None else Target(self.noise, ChangeError(backdrop))
            sums = accumulate(
                trace,
                passes=passes,
                seed=seed,
                scattered=("objects", "difference"),
                plan=Neediest(backdrop, even, full, enough) if even < passes else None,
                target=target,
                key=self._key(still.key or scene, camera, seed, plate, moments, times)
                if watch.checkpoint is not None
                else None,
                watch=watch,
                progress=progress,
                ahead=trace.ahead if isinstance(trace, Together) else (),
            )
            if target is not None and not target.reached(sums):
                warn(
                    f"the noise asked for, {self.noise:g}, was not reached with {self.samples} samples a pixel: it is "
                    f"{target.error(sums):.2g}; give more samples"
                )
            # Depth, normals and albedo, which need few samples.
            most = min(GUIDE_SAMPLES, (QUICK_GUIDES if self.quick else GUIDES) * self.samples)
            guides = still.guides(min(most, max(1, PASS_RAYS // (camera.width * camera.height))), seed)
        seen = np.maximum(guides["seen"], 1e-12)
        planes = {name: sums.mean(name) for name in ("objects", "difference", "taken", "matte")}
        planes |= {f"{name}_variance": sums.variance(name) for name in ("objects", "difference")}
        planes |= {"depth": guides["depth"] / seen}
        planes |= {name: guides[name] for name in ("normal", "albedo", "guide_normal", "guide_albedo")}
        return Change(
            **{name: plane.astype(np.float32) for name, plane in planes.items()},
            samples=round(samples * (sums.passes if sums.counts is None else float(sums.counts.mean()))),
            passes=sums.passes,
        )

    def prepare(self, scene: Scene, camera: Camera) -> Any:
        """A scene made ready once, for the changes of many parts of a picture; None where that saves nothing.

        camera : of the whole picture, whose parts will be rendered
        """
        if not scene.objects or why_not(scene) is not None:
            return None
        with _mitsuba(self.variant, self.threads) as mi:
            if "_ad_" not in mi.variant():
                return None
            from relume.renderers.mitsuba.transport.estimator import Estimator

            made = Estimator(scene, camera, self.depth)
            # Taken once: a plate's own pixels may be its table's texture.
            made.key = fingerprint(scene)
            return made

    def expected_samples(self, camera: Camera, variance: np.ndarray) -> float:
        """Rays a pixel that `change` will trace of a still on average; at most so many where `noise` is asked for.

        camera : of the picture
        variance : (h, w) of a small render of it, as it is weighed (`weighed_variance`)
        """
        samples = samples_a_pass(self.samples, camera, passes_of_change(self.samples, camera))
        full = max(self.samples // samples, 2)
        even, passes = _spread_of(full, samples, camera)
        if even == passes:
            return float(samples * full)
        enough = AS_GOOD_AS * full if self.noise is None else None
        # Of the backdrop no more is asked: it weighs the variance already.
        return samples * Neediest(variance, even, full, enough).expected(variance, passes)

    def _key(
        self, scene: Scene | str, camera: Camera, seed: int, plate: np.ndarray | None, moments: Moments | None,
        times: np.ndarray,
    ) -> dict[str, str]:  # fmt: skip
        """All that a pixel depends on: also every moment that is seen, and the plate where it says when to stop or
        which pixels are the neediest."""
        key = dict(render_key(scene, camera, self, seed))
        if moments is not None:
            key["motion"] = fingerprint([[list(moments(float(time))) for time in sorted(set(times))]])
        if self.noise is not None or moments is None:
            key["plate"] = fingerprint(plate)
        return key


@dataclass(frozen=True, eq=False)
class ChangeParts:
    """Parts of passes of a change: a seed is a whole pass, a `SomePixels` pixels of one, a `Lit` its light.

    samples : rays a pixel of a pass
    apart : whether light is kept apart, for pixels that are traced unequally often
    """

    renderer: Differential
    scene: Scene
    camera: Camera
    samples: int
    apart: bool

    def ready(self) -> Callable[[Any], Planes]:
        """The function of a part, for a worker."""
        return in_worker(self._made, self.renderer.variant, self.renderer.threads)

    def _made(self, mi: Any) -> Callable[[Any], Planes]:
        from relume.renderers.mitsuba.transport.estimator import Estimator

        estimator = Estimator(self.scene, self.camera, self.renderer.depth)

        def trace(part: int | SomePixels | Lit) -> Planes:
            if isinstance(part, int):
                return estimator.traced(self.samples, part, apart=self.apart)
            if isinstance(part, Lit):
                return estimator.lit(self.samples, part.seed, self.apart)
            return estimator.of_pixels(np.load(part.chosen)[part.begin : part.end], self.samples, part.seed)

        return trace


@dataclass(frozen=True)
class SomePixels:
    """Those from `begin` to `end` of the pixels that a pass traces, which lie in a file by their numbers."""

    seed: int
    chosen: Path
    begin: int
    end: int


@dataclass(frozen=True)
class Lit:
    """What a pass follows from the light."""

    seed: int


class Together:
    """The passes of a change in this process, some at once: of all pixels, and of those that are chosen.

    seeds : of all passes, of which `even` trace all pixels; where there are others, light is kept apart
    """

    def __init__(self, still: Estimator, samples: int, seeds: Sequence[int], even: int) -> None:
        self.still, self.samples, self.seeds, self.even = still, samples, seeds, even
        self.places = {seed: index for index, seed in enumerate(seeds)}
        self.ahead: dict[int, Planes] = {}

    def __call__(self, seed: int, chosen: np.ndarray | None = None) -> Planes:
        """The planes of a pass."""
        if seed not in self.ahead:
            first = self.places[seed]
            if chosen is None:
                last = min(first + self.still.together(self.samples), self.even)
            else:
                last = first + (1 if self.still.one_by_one else AT_ONCE - (first - self.even) % AT_ONCE)
            these = self.seeds[first:last]
            made = self.still.traced_together(self.samples, these, chosen, self.even < len(self.seeds))
            self.ahead.clear()
            self.ahead.update(zip(these, made, strict=True))
        return self.ahead.pop(seed)


class SpreadChange:
    """The passes of a change by workers: whole ones ahead, and of those whose pixels are chosen a share each.

    apart : whether light is kept apart
    """

    def __init__(self, parts: Parts, still: Estimator, samples: int, seeds: Sequence[int], apart: bool) -> None:
        self.parts, self.still, self.samples, self.apart = parts, still, samples, apart
        self.whole = WholePasses(parts, seeds)

    def __call__(self, seed: int, chosen: np.ndarray | None = None) -> Planes:
        """The planes of a pass."""
        if chosen is None:
            return self.whole(seed)
        pixels = np.flatnonzero(chosen)
        count = min(self.parts.workers, max(1, pixels.size * self.samples // FEWEST_RAYS))
        bounds = [pixels.size * index // count for index in range(count + 1)]
        file = self.parts.kept("chosen", pixels.astype(np.uint32))
        shares: list[Any] = [SomePixels(seed, file, *each) for each in pairwise(bounds)]
        lit = [Lit(seed)] if self.still.world.smooth and pixels.size else []
        names = [f"share {index + 1} of {count} of a pass" for index in range(count)] + ["light of a pass"] * len(lit)
        # In the order of the pixels, whoever was first.
        made = [self.parts.taken(path) for path in self.parts.traced(shares + lit, names)]
        planes = {name: np.concatenate([each[name] for each in made[:count]]) for name in made[0]}
        whole = self.still.on_picture(pixels, planes)
        from relume.renderers.mitsuba.transport.estimator import with_light_apart

        return with_light_apart(whole, made[-1]) if lit else whole


def _spread_of(full: int, samples: int, camera: Camera) -> tuple[int, int]:
    """Of so many passes over all pixels: how many stay that, and how many there are at most.

    The first show which pixels are noisy, and the others go to those; of a small picture all stay, for passes over
    some of its pixels take longer to start than to trace. Two give an estimate, by all around a pixel.
    """
    if full < 2 * LEAST or samples * camera.width * camera.height < SPREAD_RAYS:
        return full, full
    return min(max(full // LEAST, -(-EVEN_RAYS // samples)), LEAST), round(MOST * full)


def _nothing(camera: Camera) -> Change:
    flat = np.zeros((camera.height, camera.width), np.float32)
    colour = np.zeros((camera.height, camera.width, 3), np.float32)
    return Change(colour, colour, flat, flat, colour, colour, colour, colour)
