"""The pictures of a scene file by each of the renderers: one, those of a motion, or those of a sequence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.errors import UnsupportedScene, warn
from relume.project.scene_file.frame_plan import FramePlan
from relume.project.scene_file.metering import shines
from relume.project.scene_file.scene_file import SceneFile
from relume.project.scene_file.settings import TAUGHT, RendererName, RenderSettings, whitted_of
from relume.renderers.progressive.accumulation import NO_SESSION, RenderSession
from relume.renderers.progressive.fingerprint import fingerprint, program, without_threads
from relume.renderers.results import Render
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene

if TYPE_CHECKING:
    from relume.renderers.irradiance_cache.irradiance_cache import IrradianceCache
    from relume.renderers.mitsuba.path_tracer import Mitsuba
    from relume.renderers.photon_map.photon_map import PhotonMap
    from relume.renderers.prefiltered.prefiltered import Prefiltered, Prepared
    from relume.renderers.radiosity.radiosity import Radiosity
    from relume.renderers.whitted.whitted import Whitted

Report = Callable[[str, float], None]
"""Called with the name of what is done and its share, 0 to 1."""
Watch = Callable[[int], RenderSession]
"""What goes on around the render of a frame."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """All that the pictures of a job depend on; a value that pickles, for whoever makes them.

    plan : of the frames; None for the one picture of a file without a sequence
    name : of the renderer
    """

    read: SceneFile
    settings: RenderSettings
    plan: FramePlan | None
    name: RendererName

    def made(self, report: Report, only: Sequence[int], watch: Watch = lambda number: NO_SESSION) -> Iterator[Render]:
        """The pictures of these frames, one after the other; of a single picture the number means nothing."""
        by = {"mitsuba": _by_mitsuba, "prefiltered": _by_maps, "whitted": _by_trees}.get(self.name, _by_taught)
        return by(self, report, only, watch)

    def key(self, number: int, written_with: object) -> str:
        """A hash of what a frame depends on, so that one that is there is known to be this one.

        written_with : what its file depends on beside
        """
        assert self.plan is not None  # only frames are kept
        parts = [self._common, written_with]
        if self.plan.count is not None:
            return fingerprint([*parts, (number - 1) / self.plan.count])
        moving = self._motion if self.plan.shutter is not None else None
        return fingerprint([*parts, *self.plan.moment(self.read, number), number if moving else 0, moving])

    @cached_property
    def _common(self) -> str:
        """Of what all frames share."""
        settings, read, plan = self.settings, self.read, self.plan
        renderer = {
            "mitsuba": lambda: mitsuba_of(settings),
            "prefiltered": lambda: prefiltered_of(settings),
            "whitted": lambda: whitted_of(read, settings),
        }.get(self.name, lambda: taught_of(self.name, settings))()
        parts: list[Any] = [
            program(), self.name, without_threads(renderer), settings.seed or 0, settings.region,
            None if settings.plate is None else settings.plate.radiance,
        ]  # fmt: skip
        if plan is not None and plan.count is not None:
            parts += [read.scene, read.camera, read.orbits, plan.motion]
        return fingerprint(parts)

    @cached_property
    def _motion(self) -> str:
        """Of what moves while the shutter is open."""
        assert self.read.sequence is not None  # it has the shutter
        return fingerprint(self.read.sequence.identity())


def mitsuba_of(settings: RenderSettings) -> Mitsuba:
    """The renderer mitsuba with the given settings."""
    from relume.renderers.mitsuba.path_tracer import Mitsuba

    given = {name: value for name in ("samples", "depth") if (value := getattr(settings, name)) is not None}
    return Mitsuba(**given, noise=settings.noise, threads=settings.threads, denoise=bool(settings.denoise))


def prefiltered_of(settings: RenderSettings) -> Prefiltered:
    """The renderer prefiltered with the given settings."""
    from relume.renderers.prefiltered import filters
    from relume.renderers.prefiltered.prefiltered import Prefiltered

    kinds = {
        "plain": filters.Plain,
        "subdivision": filters.Subdivision,
        "quadrilateral": filters.Quadrilateral,
        "preintegrated": filters.Preintegrated,
        "mip": filters.Mip,
    }
    kind = kinds[settings.filter or "preintegrated"]
    return Prefiltered(kind(), background=settings.plate is None, threads=settings.threads)


def taught_of(name: RendererName, settings: RenderSettings) -> Radiosity | IrradianceCache | PhotonMap:
    """A renderer for teaching with the given settings."""
    if name == "photon-map":
        from relume.renderers.photon_map.photon_map import PhotonMap

        # Each pass has a ray a pixel.
        return PhotonMap(passes=settings.samples or PhotonMap.passes, threads=settings.threads)
    from relume.renderers.irradiance_cache.irradiance_cache import IrradianceCache
    from relume.renderers.radiosity.radiosity import Radiosity

    kind = {"radiosity": Radiosity, "irradiance-cache": IrradianceCache}[name]
    given = {} if settings.samples is None else {"samples": settings.samples}
    return kind(**given, threads=settings.threads)


def require_shown(read: SceneFile, name: RendererName, plan: FramePlan | None) -> None:
    """Raises UnsupportedScene for what the renderer would leave out of a scene in silence."""
    if name == "mitsuba":
        return
    if plan is not None and plan.shutter is not None:
        raise UnsupportedScene(
            f"sequence.shutter: {name} has no shutter; use rl.Mitsuba (--renderer mitsuba), or leave it out"
        )
    if read.camera.aperture > 0 and name == "prefiltered":
        raise UnsupportedScene(
            "camera.aperture: prefiltered has a pinhole; use rl.Mitsuba (--renderer mitsuba), or leave it out"
        )
    shapes = (*read.scene.local, *read.scene.objects)
    lit = bool(np.any(read.scene.light.radiance)) or bool(read.scene.lights)
    if name not in TAUGHT and not lit and any(map(shines, shapes)):
        raise UnsupportedScene(
            f"all light of the scene is its materials' emission, which lights nothing by the renderer {name}; use "
            "rl.Mitsuba (--renderer mitsuba)"
        )


def _by_mitsuba(job: Pictures, report: Report, only: Sequence[int], watch: Watch) -> Iterator[Render]:
    """Pictures by light transport, blurred while the shutter is open."""
    settings, plan = job.settings, job.plan
    renderer, seed = mitsuba_of(settings), settings.seed or 0
    renderer = replace(renderer, threads=renderer.threads or worker_threads())

    for done, number in enumerate(only):
        scene, camera = (job.read.scene, job.read.camera) if plan is None else plan.moment(job.read, number)
        moving: dict[str, Any] = {}
        if plan is not None and plan.shutter is not None:
            sequence = job.read.sequence
            if sequence is not None and sequence.only_maps_change:
                scene = sequence.exposed(number, scene)
            else:
                moving = {"moments": _moments(job.read, plan, number), "shutter": plan.shutter}

        def rendering(share: float, done: int = done) -> None:
            report("rendering", (done + share) / len(only))

        yield renderer.render(scene, camera, seed=seed, progress=rendering, watch=watch(number), **moving)


def _moments(read: SceneFile, plan: FramePlan, number: int) -> Callable[[float], tuple[Scene, Camera]]:
    return lambda time: plan.moment(read, number + time)


@lru_cache(maxsize=1)
def _kept_maps(settings: RenderSettings, scene: Scene) -> Prepared:
    """The tables of a scene, which are those of the frame before as long as scene and settings are the very same."""
    return prefiltered_of(settings).prepared(scene)


def _by_maps(job: Pictures, report: Report, only: Sequence[int], watch: Watch) -> Iterator[Render]:
    """Pictures by prefiltered environment maps; nothing is kept of one that was interrupted."""
    from relume.composite.differential import over
    from relume.renderers.turntable import frames

    settings, plan, read = job.settings, job.plan, job.read
    for done, number in enumerate(only):
        scene, camera = read.scene, read.camera
        if plan is not None and plan.count is None:
            scene, camera = plan.moment(read, number)
        report("tables", 0.0)
        prepared = _kept_maps(settings, scene)
        report("tables", 1.0)
        if plan is not None and plan.count is not None and plan.motion is not None:
            picture = next(frames(prepared, camera, plan.motion, plan.count, (number - 1,)))
        else:
            picture = prepared.render(camera)
        if settings.plate is not None:
            picture = replace(picture, radiance=over(picture.radiance, picture.matte, settings.plate.radiance))
        report("rendering", (done + 1) / len(only))
        yield picture


def _by_trees(job: Pictures, report: Report, only: Sequence[int], watch: Watch) -> Iterator[Render]:
    """Pictures by Whitted's trees: the file's orbits, and a motion unless they are all there is."""
    from relume.renderers import turntable as motions

    def rendering(share: float) -> None:
        report("rendering", share)

    settings, plan, read = job.settings, job.plan, job.read
    method, seed = whitted_of(read, settings), settings.seed or 0
    if plan is not None and plan.count is not None:
        _warn_of_what_stays(read, plan)
        yield from motions.traced_frames(
            method, read.at, read.camera, plan.motion, plan.count, seed=seed, region=settings.region,
            progress=rendering, only=[number - 1 for number in only],
        )  # fmt: skip
        return
    for number in only:
        scene, camera = (read.scene, read.camera) if plan is None else plan.moment(read, number)
        picture = method.prepared(scene).render(
            camera, seed=seed, region=settings.region, progress=rendering, workers=watch(number).workers
        )
        if plan is None:
            _warn_of_darkness(picture, method, read)
        yield picture


def _by_taught(job: Pictures, report: Report, only: Sequence[int], watch: Watch) -> Iterator[Render]:
    """Pictures by a renderer for teaching; nothing is kept of one that was interrupted."""
    renderer = taught_of(job.name, job.settings)
    for done, number in enumerate(only):
        scene, camera = (job.read.scene, job.read.camera) if job.plan is None else job.plan.moment(job.read, number)

        def rendering(share: float, done: int = done) -> None:
            report("rendering", (done + share) / len(only))

        yield renderer.render(scene, camera, seed=job.settings.seed or 0, progress=rendering)


def _warn_of_what_stays(read: SceneFile, plan: FramePlan) -> None:
    from relume.renderers.turntable import Turntable
    from relume.scene.motion.moving_objects import left_in_space

    orbits = read.orbits or (None,) * len(read.scene.objects)
    turning = isinstance(plan.motion, Turntable)
    moving = [solid for solid, orbit in zip(read.scene.objects, orbits, strict=True) if turning or orbit is not None]
    if left := left_in_space(moving):
        warn(f"checks and waves lie in space: {', '.join(left)} will move through them")


def _warn_of_darkness(picture: Render, method: Whitted, read: SceneFile) -> None:
    """Warn where all surfaces that are seen are black, for a lamp is easily put where it shines on nothing."""
    from scipy.ndimage import binary_erosion

    # Without the outlines, where the background is seen beside them.
    inner = np.asarray(binary_erosion(picture.depth > 0, [[True] * 3] * 3), bool)
    surfaces = picture.radiance[inner]
    if not len(surfaces) or surfaces.any():
        return
    unlit = not method.constellation and read.scene.light.radiance.any()
    reason = "the light map lights nothing while constellation is 0" if unlit else "is a lamp inside a shape, or below?"
    warn(f"no light reaches the surfaces that are seen, so they are black; {reason}")
