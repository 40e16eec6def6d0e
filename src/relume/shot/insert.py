"""The main job: from a shot's photographs to a picture with objects in it that were never there."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.capture.bracket import Bracket
from relume.capture.calibration import Calibration
from relume.capture.denoising import denoise
from relume.capture.merging import merge
from relume.composite.differential import differential
from relume.composite.local_scene import Recovered, recover_reflectance
from relume.develop.film import Film, develop
from relume.errors import InvalidShot
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.blending import Probe
from relume.render.mitsuba import Mitsuba
from relume.render.renderer import Render, Renderer, render
from relume.scene.camera import Camera
from relume.scene.grid import camera_from_grid
from relume.scene.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes import Mesh, Plane
from relume.shot import lighting
from relume.shot.objects import placed_meshes
from relume.shot.outcome import Inserted, notes_on, require_folder, write_outcome
from relume.shot.project import Local, Shot
from relume.shot.stages import Arrays, Stages

Report = Callable[[str, float], None]
"""Told the name of a stage and the share of it that is done."""


def insert(
    shot: Shot,
    out: str | Path,
    *,
    renderer: Renderer | None = None,
    threads: int | None = None,
    report: Report = lambda stage, share: None,
) -> Inserted:
    """Do the whole job and write composite.exr and .png, layers.exr, light.exr, response.json and report.html.

    out : folder; stages kept there from an earlier run are used where nothing they depend on has changed
    renderer : Mitsuba with the shot's settings unless given
    threads : to render with; all cores unless given. The pixels do not depend on it
    Raises RelumeError; nothing is written to `out` but kept stages before everything is computed.
    """
    from relume.shot.report import write_report

    out = Path(out)
    require_folder(out)
    job = _Job(shot, Stages(out / "stages"), report)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        table = shot.render
        result = job.run(renderer or Mitsuba(table.samples, table.noise, table.depth, threads=threads))
    result = replace(result, notes=(*dict.fromkeys(str(w.message) for w in caught), *result.notes))
    with job.timed("write"):
        write_outcome(result, out)
        write_report(result, out / "report.html")
    return result


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
        with self.timed(name):
            arrays, kept = self.stages.get(name, made_from, make)
        if kept:
            self.kept.append(name)
        return arrays

    def run(self, renderer: Renderer) -> Inserted:
        shot = self.shot
        meshes = placed_meshes(shot)
        with self.timed("photographs"):
            photographs = lighting.read_photographs(shot)
        sources = [
            shot.files([*shot.plate.photographs, *(p for b in shot.light.balls or () for p in b.photographs)]),
            shot.plate.times,
            [b.times for b in shot.light.balls or ()],
        ]
        calibrations = lighting.calibrations_from(
            self.stage("response", sources, lambda: lighting.calibration_arrays(lighting.calibrate(photographs)))
        )
        plate = self._plate(photographs, calibrations, sources)
        camera = self._camera(plate, photographs.plate)
        probe = self._light(photographs, calibrations, sources)

        if plate.unit != probe.light.unit:
            raise InvalidShot(
                f"plate.photographs: the plate is in {plate.unit} and the light in {probe.light.unit}; give both alike"
            )
        planes, recovered = self._local(plate, camera, probe, meshes)
        scene = Scene(probe.light, planes, meshes)
        with_, without = self._renders(scene, camera, renderer)

        with self.timed("composite"):
            composite = differential(plate.radiance, with_.radiance, without.radiance, with_.matte)
            picture, before = self._developed(composite, photographs, calibrations, plate, with_.matte)
        notes = notes_on(plate, probe, recovered, calibrations, with_.matte if meshes else None)
        return Inserted(
            composite, picture, before, plate, camera, probe, calibrations, recovered, with_, without,
            self.seconds, tuple(self.kept), notes,
        )  # fmt: skip

    def _plate(
        self, photographs: lighting.Photographs, calibrations: dict[str, Calibration], sources: object
    ) -> RadianceMap:
        bracket = photographs.plate
        if photographs.plate_map is not None or bracket is None:
            if self.shot.plate.denoise:
                raise InvalidShot("plate.denoise: only a bracket's noise is known; leave it out for a radiance map")
            assert photographs.plate_map is not None  # read_photographs gives one of the two
            return photographs.plate_map

        def make() -> Arrays:
            merged = merge(bracket, calibrations[bracket.photographs[0].camera].response)
            if self.shot.plate.denoise:
                merged = denoise(merged)
            assert merged.variance is not None and merged.clipped is not None
            return {"radiance": merged.radiance, "variance": merged.variance, "clipped": merged.clipped}

        arrays = self.stage("plate", [sources, self.shot.plate.model_dump()], make)
        return RadianceMap(arrays["radiance"], arrays["variance"], arrays["clipped"])

    def _camera(self, plate: RadianceMap, bracket: Bracket | None) -> Camera:
        table, (width, height) = self.shot.camera, plate.size
        with self.timed("camera"):
            if table.grid is not None:
                photograph = files.read_photograph(self.shot.folder / table.grid.photograph)
                if photograph.size != plate.size:
                    raise InvalidShot(
                        f"camera.grid.photograph: {photograph.name} is {photograph.size[0]}×{photograph.size[1]}, the "
                        f"plate {width}×{height}; photograph the grid with the plate's camera and size"
                    )
                return camera_from_grid(
                    photograph, squares=table.grid.squares, square=table.grid.square, focal_length=table.focal_length
                )
            focal_length = table.focal_length or (bracket.focal_length if bracket is not None else None)
            if table.pose is None or focal_length is None:
                raise InvalidShot("camera.focal_length: missing, and the plate's EXIF has none; give it in pixels")
            try:
                return Camera.looking_at(
                    np.array(table.pose.position), np.array(table.pose.look_at),
                    width=width, height=height, focal_length=focal_length,
                )  # fmt: skip
            except ValueError as error:
                raise InvalidShot(f"camera.pose: {error}") from None

    def _light(self, photographs: lighting.Photographs, calibrations: dict[str, Calibration], sources: object) -> Probe:
        if self.shot.light.map is not None:
            with self.timed("light"):
                return lighting.light_from_map(self.shot.folder / self.shot.light.map)
        arrays = self.stage(
            "light",
            [sources, self.shot.light.model_dump()],
            lambda: lighting.probe_arrays(lighting.measure_light(self.shot, photographs.balls, calibrations)),
        )
        return lighting.probe_from(arrays)

    def _local(
        self, plate: RadianceMap, camera: Camera, probe: Probe, meshes: tuple[Mesh, ...]
    ) -> tuple[tuple[Plane, ...], tuple[Recovered | None, ...]]:
        def one(table: Local) -> tuple[Plane, Recovered | None]:
            if table.reflectance != "recover":
                return Plane(Diffuse(table.reflectance), table.size, table.height), None
            bare = Plane(Diffuse((0.5, 0.5, 0.5)), table.size, table.height)
            try:
                found = recover_reflectance(plate, camera, probe.light, bare, meshes)
            except ValueError as error:
                raise InvalidShot(f"local.reflectance: {error}") from None
            return replace(bare, material=Diffuse(found.reflectance)), found

        with self.timed("reflectance"):
            pairs = [one(table) for table in self.shot.local]
        return tuple(p for p, _ in pairs), tuple(r for _, r in pairs)

    def _renders(self, scene: Scene, camera: Camera, chosen: Renderer) -> tuple[Render, Render]:
        table = self.shot.render
        settings = replace(chosen, threads=None) if isinstance(chosen, Mitsuba) else chosen

        def make() -> Arrays:
            first = render(scene, camera, chosen, seed=table.seed, progress=lambda s: self.report("render", s / 2))
            # The same rays again without the objects: what they leave alone cancels to the bit.
            again = replace(chosen, passes=first.passes) if isinstance(chosen, Mitsuba) else chosen
            second = render(
                scene.without_objects(), camera, again, seed=table.seed,
                progress=lambda s: self.report("render", 0.5 + s / 2),
            )  # fmt: skip
            if table.denoise:
                from relume.render.mitsuba_denoise import denoise_pair

                first, second = denoise_pair(first, second)
            return {f"{n}.{k}": v for n, r in (("with", first), ("without", second)) for k, v in _planes(r).items()}

        arrays = self.stage("render", [scene, camera, repr(settings), table.seed, table.denoise], make)
        return _render_from(arrays, "with"), _render_from(arrays, "without")

    def _developed(
        self,
        composite: np.ndarray,
        photographs: lighting.Photographs,
        calibrations: dict[str, Calibration],
        plate: RadianceMap,
        matte: np.ndarray,
    ) -> tuple[Photograph, Photograph]:
        """The developed composite and the plate it sits in: the photograph itself where there is one."""
        table, bracket = self.shot.develop, photographs.plate
        if bracket is None or table.response == "srgb":
            # Without a camera's curve, the plate's bright end is put just below white.
            film = Film(1 / max(float(np.percentile(plate.radiance, 99)), 1e-30)).brighter(table.exposure)
            return develop(composite, film), develop(plate.radiance, film)
        # The photograph whose middle value is nearest to middle grey is the one the picture sits in.
        index = int(np.argmin([abs(float(np.median(p.pixels)) - 118) for p in bracket.photographs]))
        response = calibrations[bracket.photographs[index].camera].response
        film = Film(float(bracket.exposures[index]), response).brighter(table.exposure)
        picture, before = develop(composite, film), develop(plate.radiance, film)
        if table.exposure:
            return picture, before
        # Outside the objects the photograph keeps its grain: it is changed only by what the objects change.
        photograph = bracket.photographs[index].pixels
        changed = np.clip(photograph.astype(int) + picture.pixels - before.pixels, 0, 255)
        cover = matte[..., None]
        pixels = np.rint(cover * picture.pixels + (1 - cover) * changed).astype(np.uint8)
        return replace(picture, pixels=pixels), replace(before, pixels=photograph)


def _planes(render: Render) -> Arrays:
    return {
        "radiance": render.radiance, "variance": render.variance, "matte": render.matte, "depth": render.depth,
        "normal": render.normal, "albedo": render.albedo, "samples": np.array(render.samples),
        "passes": np.array(render.passes),
    }  # fmt: skip


def _render_from(arrays: Arrays, name: str) -> Render:
    planes = {key.removeprefix(f"{name}."): value for key, value in arrays.items() if key.startswith(f"{name}.")}
    counts = {key: int(planes.pop(key)) for key in ("samples", "passes")}
    return Render(**planes, samples=counts["samples"], passes=counts["passes"])
