"""The main job: from a shot's photographs to a picture with objects in it that were never there."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.capture.denoising import denoise
from relume.capture.merging import merge
from relume.errors import InvalidShot
from relume.export.bundle import HandOver
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import Probe
from relume.project.insertion import fitting, lighting
from relume.project.insertion.local_stage import local_arrays, local_from
from relume.project.insertion.outcome import Inserted, notes_on, require_folder, write_outcome
from relume.project.insertion.place import place_of, recovered_place, relit, require_in_place
from relume.project.insertion.rendering import change_arrays, change_from, rendered
from relume.project.shot_file.camera_table import camera_fit
from relume.project.shot_file.objects import doubts_about, placed_meshes, require_outside
from relume.project.shot_file.shot import Shot
from relume.project.stages import Arrays, Stages
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.fingerprint import without_threads
from relume.renderers.progressive.graceful_shutdown import Force
from relume.renderers.renderer import Renderer
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.scene.cameras.shutter import Shutter
from relume.scene.scene import Scene
from relume.surface.reflectance import RecoveredLocal

MOMENTS = 33
"""Of the exposure, by which a kept render is known again where something moves."""
NOTES = "_notes"
"""Under this name the warnings of a stage are kept beside its arrays."""
Report = Callable[[str, float], None]
"""Told the name of a stage and the share of it that is done."""
Moving = Callable[[float], Shot]
"""The shot at a moment: a share of a frame's time from the middle of its exposure."""


def insert(
    shot: Shot,
    out: str | Path,
    *,
    renderer: Renderer | None = None,
    threads: int | None = None,
    report: Report = lambda stage, share: None,
    others: tuple[Path, ...] = (),
    moving: Moving | None = None,
    shutter: Shutter = Shutter(0.0, 0.0),
    restart: bool = False,
    force: Force | None = None,
) -> Inserted:
    """Do the whole job and write composite.exr and .png, layers.exr, light.exr, response.json and report.html.

    out : folder; stages kept there from an earlier run are used where nothing they depend on has changed, and a render
        that was interrupted is gone on with
    renderer : unless given, Differential with the shot's settings for the change, and a coarser Mitsuba where
        reflectances are recovered
    threads : to render with; all cores unless given. The pixels do not depend on it
    others : folders of stages of other shots, which serve where they were made from the same
    moving : the shot at each moment of the exposure, where something moves, and `shutter` which moments
    restart : forget what an interrupted render kept
    force : how a first Ctrl-C is answered in time, for programs that own their process
    Raises RelumeError; nothing is written to `out` but kept stages and previews before everything is computed.
    """
    from relume.report.insert_report import write_report

    out = Path(out)
    require_folder(out)
    job = _Job(shot, Stages(out / "stages", others), report)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = job.run(renderer, threads, moving, shutter, restart, force)
    result = replace(result, notes=(*dict.fromkeys(str(w.message) for w in caught), *result.notes))
    with job.timed("write"):
        write_outcome(result, out)
        write_report(result, out / "report.html")
    return result


def prepared(shot: Shot, out: str | Path, *, report: Report = lambda stage, share: None) -> HandOver:
    """The shot ready to be rendered, for another program: all but the render is done, its stages kept in `out`.

    Raises RelumeError. What should be known of the measurements is warned of.
    """
    out = Path(out)
    require_folder(out)
    return _Job(shot, Stages(out / "stages"), report).prepared()


class _Job:
    def __init__(self, shot: Shot, stages: Stages, report: Report) -> None:
        self.shot, self.stages, self.report = shot, stages, report
        self.seconds: dict[str, float] = {}
        self.kept: list[str] = []

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        self.report(name, 0.0)
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start
        self.report(name, 1.0)

    def stage(self, name: str, made_from: object, make: Callable[[], Arrays]) -> Arrays:
        def noted() -> Arrays:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                arrays = make()
            return arrays | {NOTES: np.array([str(each.message) for each in caught], np.str_)}

        with self.timed(name):
            arrays, kept = self.stages.get(name, made_from, noted)
        if kept:
            self.kept.append(name)
        # What was doubted when it was made is still doubted.
        for line in arrays.pop(NOTES, np.zeros(0, np.str_)):
            warnings.warn(str(line), stacklevel=2)
        return arrays

    def measured(self, renderer: Renderer | None) -> None:
        """Everything before the render: plate, camera, light, surfaces."""
        shot = self.shot
        self.meshes = placed_meshes(shot)
        with self.timed("photographs"):
            self.photographs = lighting.read_photographs(shot)
        sources = [
            shot.files([*shot.plate.photographs, *(p for b in shot.light.balls or () for p in b.photographs)]),
            shot.plate.times,
            [b.times for b in shot.light.balls or ()],
        ]
        self.sources = sources
        self.calibrations = lighting.calibrations_from(
            self.stage("response", sources, lambda: lighting.calibration_arrays(lighting.calibrate(self.photographs)))
        )
        self.plate = self._plate(sources)
        self.fit = self._camera()
        self.camera = self._with_lens(self.fit.camera)
        self.probe = self._light(sources)
        if self.plate.unit != self.probe.light.unit:
            raise InvalidShot(
                f"plate.photographs: the plate is in {self.plate.unit} and the light in {self.probe.light.unit}; give "
                "both alike"
            )
        self.place = place_of(shot, self.probe)
        require_in_place(self.place, self.camera)
        require_outside(self.meshes, self.camera)
        self.recovered = self._surfaces(renderer)
        self.film, self.index = fitting.film_of(shot, self.plate, self.photographs.plate, self.calibrations)

    def run(
        self, renderer: Renderer | None, threads: int | None, moving: Moving | None, shutter: Shutter, restart: bool,
        force: Force | None,
    ) -> Inserted:  # fmt: skip
        self.measured(renderer)
        shot, plate, table = self.shot, self.plate, self.shot.render
        chosen = renderer or Differential(table.samples, table.noise, table.depth, threads=threads)
        change = self._change(chosen, moving, shutter, restart, force)
        if any(each.stage is not None for each in shot.objects):
            from relume.project.insertion.staged import with_stages

            with self.timed("stages"):
                local = () if self.recovered is None else self.recovered.shapes
                change = with_stages(
                    shot,
                    relit(self.place.with_local(local), shot),
                    self.camera,
                    change,
                    lambda share: self.report("stages", share),
                )
        looks = self.stage(
            "match",
            [plate, self.sources, self.index, shot.match.sharpness, shot.match.grain, shot.plate.denoise],
            lambda: fitting.looks_of(shot, plate, self.photographs.plate, self.index, self.calibrations),
        )
        with self.timed("composite"):
            vignetting = fitting.vignetting_of(shot, plate, self.camera)
            match = fitting.match_from(looks, vignetting, shot.match.seed)
            without = plate.radiance if self.recovered is None else self.recovered.without
            composite, seen = fitting.fitted(shot, plate, change, without, match)
            composite, picture, before = fitting.developed(
                composite, plate, seen.matte, match, self.film, self._photograph()
            )
        notes = (
            *doubts_about(self.meshes, self.camera, self.place.local),
            *self._scales(),
            *notes_on(plate, self.probe, self.recovered, self.calibrations, seen.matte if self.meshes else None),
        )
        return Inserted(
            composite, picture, before, plate, self.camera, self.fit, self.probe, self.calibrations, self.recovered,
            seen, without, match, self.seconds, tuple(self.kept), notes,
        )  # fmt: skip

    def _scales(self) -> tuple[str, ...]:
        """What is told where nothing ties the plate's scale to the light's."""
        if self.photographs.plate_map is None and self.shot.light.map is None:
            return ()
        return (
            "plate and light come from different files, and nothing but you says that their scales are one; a "
            "recovered reflectance that is not believable tells that they are not",
        )

    def prepared(self) -> HandOver:
        self.measured(None)
        table = self.shot.render
        return HandOver(
            self._scene(), self.camera, self.plate, self._photograph(), self.film,
            samples=table.samples, depth=table.depth,
        )  # fmt: skip

    def _plate(self, sources: object) -> RadianceMap:
        bracket = self.photographs.plate
        if self.photographs.plate_map is not None or bracket is None:
            if self.shot.plate.denoise:
                raise InvalidShot("plate.denoise: only a bracket's noise is known; leave it out for a radiance map")
            assert self.photographs.plate_map is not None  # read_photographs gives one of the two
            return self.photographs.plate_map

        def make() -> Arrays:
            merged = merge(bracket, self.calibrations[bracket.photographs[0].camera].response)
            if self.shot.plate.denoise:
                merged = denoise(merged)
            assert merged.variance is not None and merged.clipped is not None
            return {"radiance": merged.radiance, "variance": merged.variance, "clipped": merged.clipped}

        arrays = self.stage("plate", [sources, self.shot.plate.model_dump()], make)
        return RadianceMap(arrays["radiance"], arrays["variance"], arrays["clipped"])

    def _camera(self) -> CameraFit:
        bracket = self.photographs.plate
        told = bracket.focal_length if bracket is not None else None
        with self.timed("camera"):
            return camera_fit(self.shot.camera, self.plate.size, self.shot.folder, told)

    def _with_lens(self, camera: Camera) -> Camera:
        """The camera with the aperture and the focus that [match] asks for."""
        table, bracket = self.shot.match, self.photographs.plate
        if table.aperture is None or table.focus is None:
            return camera
        diameter = table.aperture
        if diameter == "exif":
            from relume.virtual_camera.lens.depth_of_field import aperture_from

            diameter = None if bracket is None else aperture_from(bracket.photographs[0])
            if diameter is None:
                raise InvalidShot(
                    "match.aperture: the plate's EXIF tells no f-number or focal length; give the diameter in metres"
                )
        return replace(camera, aperture=diameter / 2, focus=table.focus)

    def _light(self, sources: object) -> Probe:
        if self.shot.light.map is not None:
            with self.timed("light"):
                return lighting.light_from_map(self.shot.folder / self.shot.light.map)
        table = self.shot.light
        arrays = self.stage(
            "light",
            [sources, [b.model_dump() for b in table.balls or ()], table.ball and table.ball.model_dump(), table.size],
            lambda: lighting.probe_arrays(lighting.measure_light(self.shot, self.photographs.balls, self.calibrations)),
        )
        return lighting.probe_from(arrays)

    def _surfaces(self, renderer: Renderer | None) -> RecoveredLocal | None:
        if not self.place.local:
            return None
        shot = self.shot
        plate = fitting.even_plate(self.plate, fitting.vignetting_of(shot, self.plate, self.camera))
        arrays = self.stage(
            "reflectance",
            [plate, self.camera, self.place, self.probe.confidence, [t.model_dump() for t in shot.local],
             shot.light.ball and shot.light.ball.model_dump(), shot.render.seed, without_threads(renderer)],
            lambda: local_arrays(
                recovered_place(
                    shot, plate, self.camera, self.place, self.probe, renderer,
                    lambda share: self.report("reflectance", share),
                )
            ),
        )  # fmt: skip
        return local_from(arrays, self.place.local)

    def _scene(self, shot: Shot | None = None) -> Scene:
        """The whole scene, as it is or as it is at another moment."""
        local = () if self.recovered is None else self.recovered.shapes
        now = relit(self.place.with_local(local), shot or self.shot)
        return now.adding(*(self.meshes if shot is None else placed_meshes(shot)))

    def _change(
        self, renderer: Renderer, moving: Moving | None, shutter: Shutter, restart: bool,
        force: Force | None,
    ) -> Change:  # fmt: skip
        table, scene = self.shot.render, self._scene()
        ends: list[object] = []
        if moving is not None:
            times = np.linspace(shutter.open, shutter.close, MOMENTS)
            ends = [moving(float(time)).model_dump(mode="json") for time in times]
            # What moves in a mesh's own file.
            ends += [self.shot.folder / each.mesh for each in self.shot.objects]
        camera = self.camera
        moments = None if moving is None else lambda t: (self._scene(moving(t)), camera)

        def make() -> Arrays:
            return change_arrays(
                rendered(
                    scene, camera, table, renderer, self.plate, folder=self.stages.folder, film=self.film,
                    progress=lambda share: self.report("render", share),
                    moving=moments, shutter=shutter, force=force, restart=restart,
                )
            )  # fmt: skip

        made_from = [scene, camera, without_threads(renderer), table.seed, table.denoise, ends, repr(shutter)]
        if table.noise is not None:
            made_from.append(self.plate)
        return change_from(self.stage("render", made_from, make))

    def _photograph(self) -> Photograph | None:
        """The photograph that the picture sits in, or None."""
        bracket = self.photographs.plate
        return None if bracket is None or self.index is None else bracket.photographs[self.index]
