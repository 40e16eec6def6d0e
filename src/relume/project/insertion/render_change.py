"""The fourth step of `insert`: what the objects change of the plate, rendered, denoised and kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.cluster.renaming import remove
from relume.errors import CannotResume, OutputNotWritten, warn
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.insertion.photographs import Calibrated, finished_light
from relume.project.insertion.place import Place
from relume.project.insertion.render_tiles import change_in_tiles, forget_tiles, is_large
from relume.project.shot_file.camera_table import camera_fit
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot
from relume.project.stages import Steps
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import RenderSession, forget
from relume.renderers.progressive.convergence import LEAST, ChangeError, Sums
from relume.renderers.progressive.fingerprint import fingerprint, without_threads
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.renderer import Moments, Renderer
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

AROUND = "around the pointer"
"""The step that says that previews show the surroundings of a place."""
AROUND_SHARE, AROUND_PIXELS, AROUND_RAYS = 0.35, 60_000, 16
"""Of each side of the picture that is shown first about a place, its pixels at most, and their rays: half a second."""
NOISE = "noise"
"""The attribute of preview.exr that holds the relative error to be expected where objects change anything."""
MOMENTS = 33
"""Moments of the exposure whose shots identify a kept render where something moves."""


@dataclass(frozen=True)
class Motion:
    """What moves while the shutter is open.

    shot : the shot at a moment: a share of a frame's time from the middle of its exposure
    shutter : which moments
    """

    shot: Callable[[float], Shot]
    shutter: Shutter

    def key(self) -> list[object]:
        """What identifies it: the shot at some of its moments, and the files whose own motion may matter."""
        times = np.linspace(self.shutter.open, self.shutter.close, MOMENTS)
        shots = [self.shot(float(time)) for time in times]
        meshes = [shots[0].folder / each.mesh for each in shots[0].objects]
        return [self.shutter, [each.model_dump(mode="json") for each in shots], meshes]


@dataclass(frozen=True)
class Rendering:
    """How the render of an insertion runs; its pixels depend on `renderer` and `motion` alone.

    renderer : Differential with the shot's settings unless given
    threads : of that Differential; all cores unless given
    motion : None where nothing moves
    restart : discard the saved state of an interrupted render
    force : how a first Ctrl-C is answered in time, for programs that own their process
    workers : who traces the passes of a still; None for this process
    about : the place whose surroundings the previews show first, shares of the picture's width and height from its left
        and top; None for none. It costs those rays once more
    """

    renderer: Renderer | None = None
    threads: int | None = None
    motion: Motion | None = None
    restart: bool = False
    force: HardStop | None = None
    workers: PassWorkers | None = None
    about: tuple[float, float] | None = None


def render_change(
    shot: Shot, calibrated: Calibrated, place: Place, meshes: Sequence[Mesh], film: Film, steps: Steps,
    rendering: Rendering,
) -> Change:  # fmt: skip
    """What the objects change of the plate.

    meshes : the objects
    film : develops the previews
    Raises Interrupted, which leaves the render's state to a later run; InvalidShot, UnsupportedScene.
    """
    table, motion = shot.render, rendering.motion
    renderer = rendering.renderer or Differential(
        table.samples, table.noise, table.depth, threads=rendering.threads
    )  # fmt: skip
    # What the render depends on.
    scene = place.relit(shot).adding(*meshes)
    made_from: list[object] = [scene, place.camera, without_threads(renderer), table.seed, table.denoise]
    moments: Moments | None = None
    if motion is not None:
        made_from.append(motion.key())
        lit = _LightOfMoments(shot, calibrated)
        moments = lambda time: _seen_at(place, shot, motion.shot(time), lit)  # noqa: E731
    # The plate says which pixels are the neediest, and when their noise is low enough.
    made_from.append(calibrated.plate)
    identity = fingerprint(made_from)

    # The saved state of an interrupted render, and previews beside it.
    plate, folder = calibrated.plate, steps.stages.folder
    previews = Previews(folder.parent, plate, film)
    watch = RenderSession(
        folder / "render.passes", rendering.restart, preview=previews if table.preview else None,
        force=rendering.force, workers=rendering.workers,
    )  # fmt: skip

    def make() -> Change:
        folder.mkdir(parents=True, exist_ok=True)
        shutter = Shutter(0.0, 0.0) if motion is None else motion.shutter

        def report(share: float) -> None:
            steps.progress("render", share)

        def finish(part: tuple[slice, slice]) -> Finishing:
            real = place.recovered
            textured = None if real is None else np.array(real.textured[part])
            quick = isinstance(renderer, Differential) and renderer.quick
            return Finishing(table.denoise, plate.radiance[part], textured, quick)

        def trace(watch: RenderSession) -> Change:
            if is_large(place.camera) and isinstance(renderer, Differential):
                return change_in_tiles(
                    renderer, scene, place.camera, plate.radiance, seed=table.seed, made_from=identity,
                    stages=steps.stages, watch=watch, finish=finish,
                    first=previews if table.preview else None, progress=report, moments=moments, shutter=shutter,
                )  # fmt: skip
            change = renderer.change(
                scene, place.camera, seed=table.seed, progress=report, watch=watch, plate=plate.radiance,
                moments=moments, shutter=shutter,
            )  # fmt: skip
            return finish((slice(None), slice(None)))(change)

        # What is looked at first, for the previews alone.
        if rendering.about is not None and table.preview and isinstance(renderer, Differential) and motion is None:
            first, part = change_about(renderer, scene, place.camera, plate.radiance, rendering.about, table.seed)
            previews.of_part(finish(part)(first), part, plate)
            steps.progress(AROUND, 1.0)
        # Render, from the saved state where it is of this render.
        try:
            change = trace(watch)
        except CannotResume as error:
            what = str(error).partition(";")[0]
            warn(f"cannot resume the saved render: {what}; starting over")
            change = trace(replace(watch, restart=True))
        return change

    change = steps.keep("render", identity, make)
    if "render" not in steps.kept:
        # The change is safe: its passes and previews are not needed any more.
        forget(watch)
        previews.remove()
    # Things from light stages show their own pixels.
    forget_tiles(steps.stages)
    if any(each.stage is not None for each in shot.objects):
        from relume.project.insertion.light_stage_objects import with_stages

        with steps.timed("stages"):
            change = with_stages(
                shot, place.relit(shot), place.camera, change, lambda share: steps.progress("stages", share)
            )
    return change


@dataclass(frozen=True, eq=False)
class Finishing:
    """What is done with a rendered change of a plate or of a part of it: denoising, or nothing.

    plate : (H, W, 3) that the change is of
    textured : (H, W) bool, where real surfaces have its texture; None for all
    quick : by the denoiser's smaller network
    """

    denoise: bool
    plate: np.ndarray
    textured: np.ndarray | None
    quick: bool

    def __call__(self, change: Change) -> Change:
        """The finished change."""
        if not self.denoise:
            return change
        from relume.renderers.mitsuba.denoise import denoised

        return denoised(change, self.plate, self.textured, self.quick)


def change_about(
    renderer: Differential, scene: Scene, camera: Camera, plate: np.ndarray, about: tuple[float, float], seed: int
) -> tuple[Change, tuple[slice, slice]]:  # fmt: skip
    """What the objects change about a place, with few rays, and which rows and columns of the picture that is.

    plate : (H, W, 3) what is seen without them
    about : shares of the picture's width and height
    """
    part = _part_about(camera.width, camera.height, about)
    rows, columns = part
    seen = camera.window(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
    few = replace(renderer, samples=min(AROUND_RAYS, renderer.samples), noise=None, quick=True)
    return few.change(scene, seen, seed=seed, plate=plate[part]), part


def _part_about(width: int, height: int, about: tuple[float, float]) -> tuple[slice, slice]:
    """Rows and columns about a place, AROUND_SHARE of each side and AROUND_PIXELS at most, all within the picture."""
    share = min(AROUND_SHARE, (AROUND_PIXELS / (width * height)) ** 0.5)
    found = []
    for side, place in ((height, about[1]), (width, about[0])):
        length = max(1, round(share * side))
        start = min(max(round(place * side - length / 2), 0), side - length)
        found.append(slice(start, start + length))
    return found[0], found[1]


class _LightOfMoments:
    """Maps that change, at moments of an exposure, on the plate's scale as the frame's own light was put there."""

    def __init__(self, shot: Shot, calibrated: Calibrated) -> None:
        self.gains: np.ndarray | None = None
        if shot.light.maps is not None:
            read, scaled = (
                light.radiance.mean((0, 1), dtype=np.float64)
                for light in (finished_light(shot).light, calibrated.probe.light)
            )
            self.gains = np.where(read > 0, scaled / np.maximum(read, 1e-300), 1.0)

    def at(self, shot: Shot) -> EnvironmentMap | None:
        """The light of a moment's shot; None where the frame's own holds."""
        if self.gains is None:
            return None
        light = finished_light(shot).light
        return replace(light, radiance=(light.radiance * self.gains).astype(np.float32))


def _seen_at(place: Place, shot: Shot, moved: Shot, light: _LightOfMoments) -> tuple[Scene, Camera]:
    """The scene and the camera at a moment of the exposure; `shot` is that of its middle."""
    camera = place.camera
    if moved.camera != shot.camera:
        # A camera that moves blurs the objects as it has blurred the plate.
        size, given = (camera.width, camera.height), camera.focal_length
        there = camera_fit(moved.camera, size, moved.folder, given).camera
        camera = replace(there, aperture=camera.aperture, focus=camera.focus)
    return place.relit(moved, light.at(moved)).adding(*placed_meshes(moved)), camera


@dataclass(frozen=True, eq=False)
class Previews:
    """Writes preview.exr and preview.png, each whole at every moment; for `RenderSession.preview`.

    folder : must exist
    plate : that the composite so far is over
    film : develops it
    """

    folder: Path
    plate: RadianceMap
    film: Film

    def __call__(self, sums: Sums) -> None:
        """Write them, of a render that is smaller than the plate at its own size, with the noise that is left.

        A full disk costs the preview, with a warning, and not the render.
        """
        objects, difference, matte = (sums.mean(name) for name in ("objects", "difference", "matte"))
        plate = self.plate.radiance
        if matte.shape != plate.shape[:2]:
            rows, columns = (
                ((np.arange(few) + 0.5) * many / few).astype(int)
                for few, many in zip(matte.shape, plate.shape, strict=False)
            )
            plate = plate[np.ix_(rows, columns)]
        composite = np.asarray(plate * (1 - matte[..., None]) + difference + objects, np.float32)
        # A single pass has no scatter, and few are off by more than half.
        variance, said = None, {}
        if sums.passes >= LEAST:
            variance = np.asarray(sums.variance("objects") + sums.variance("difference"), np.float32)
            said = {NOISE: f"{ChangeError(plate)(sums):.3g}"}
        self._write(RadianceMap(composite, variance, None, self.plate.unit, said))

    def of_part(self, change: Change, part: tuple[slice, slice], around: RadianceMap) -> None:
        """Write them, of what the objects change in a part of the picture, its rows and columns, and what is around."""
        shown = around.radiance.copy()
        shown[part] = self.plate.radiance[part] * (1 - change.matte[..., None]) + change.difference + change.objects
        self._write(RadianceMap(shown, unit=self.plate.unit))

    def _write(self, picture: RadianceMap) -> None:
        try:
            files.write(self.folder / "preview.exr", picture)
            files.write(self.folder / "preview.png", develop(picture.radiance, self.film))
        except OutputNotWritten as error:
            warn(f"no preview: {error}")

    def remove(self) -> None:
        """Remove them, once the result itself is there; one that another program has open on Windows stays."""
        for name in ("preview.exr", "preview.png"):
            with suppress(OSError):
                remove(self.folder / name)
