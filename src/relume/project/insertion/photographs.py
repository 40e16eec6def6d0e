"""The first two steps of `insert`: the shot's photographs, and the radiance of plate and light that they give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import BracketSource
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.denoising import denoise
from relume.capture.exposure.bracket import Bracket, read_bracket, require_known_exposures
from relume.capture.exposure.exposures import exposed
from relume.capture.response.calibration import Calibration
from relume.errors import Doubt, InvalidShot, NotABracket, warn
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.files.video import is_video
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.probe.ball.blending import Probe
from relume.probe.ball.crops import on_one_frame
from relume.project.insertion.ball_camera import BallCamera, camera_of_ball
from relume.project.insertion.ball_light import blended, picked_outline
from relume.project.insertion.slips import CHANGED, other_time_or_place, require_measures
from relume.project.merging.merged_photographs import FirstFacts, Photographs, first_facts, merged_brackets
from relume.project.merging.single_plate import is_single, read_single, why_untied
from relume.project.place_tables import distant_scene
from relume.project.shot_file.light_table import BallPhotographs, MergeTable, picked_by_key
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Shot
from relume.project.stages import Steps
from relume.renderers.several_probes.interpolation import InterpolatedLight
from relume.scene.materials.checks import triple
from relume.scene.scene import Infinite
from relume.sphere.environment_map import EnvironmentMap

PLOTTED = 2000
"""Observations of a response that are kept, for its plot."""


@dataclass(frozen=True, eq=False)
class MergedPlate:
    """The plate as its photographs were merged.

    radiance : its map
    moved : its photographs, moved onto one another; None where they lay well, and for raws
    focal_length : pixels; None where unknown
    gains : (3,) by which the photographs' own radiance was multiplied: balance and scale
    """

    radiance: RadianceMap
    moved: Bracket | None
    focal_length: float | None
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Calibrated:
    """The radiance of plate and light, on one scale.

    plate : its radiance map, denoised where the shot asks for that
    bracket : the photographs it was merged from, lying on one another; None for a radiance map and for camera raws
    focal_length : of the plate, pixels; None where unknown
    probe : the light
    cameras : what is known of each camera, by its name
    untied : why the scale of the light is not that of the plate; None where exposures tie them, or maps are taken so
    stood : the plate's camera and the ball's place, where the camera was found from the ball
    joined : the light of several probes, before it was brought on the plate's scale; None where there are none
    gains : by which what the plate's photographs show by their response was multiplied: balance and scale
    """

    plate: RadianceMap
    bracket: Bracket | None
    focal_length: float | None
    probe: Probe
    cameras: dict[str, MergedCamera]
    untied: str | None = None
    stood: BallCamera | None = None
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    joined: InterpolatedLight | None = None

    @property
    def centre(self) -> tuple[float, float, float] | None:
        """Where the ball was found to be, or several probes were joined for, metres; None where it was given."""
        if self.joined is not None:
            return self.joined.position
        return None if self.stood is None else self.stood.centre

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Of the cameras whose response was recovered, by name."""
        return {name: each.calibration for name, each in self.cameras.items() if each.calibration is not None}

    def response(self, camera: str) -> Response:
        """The response of a camera that took encoded photographs, to radiance balanced and scaled as the plate's is."""
        response = self.cameras[camera].response
        assert response is not None  # raws have no bracket, for which this is asked
        return replace(response, log_exposure=response.log_exposure + np.log(self.gains)[:, None])


def read_photographs(shot: Shot) -> Photographs:
    """Read all the brackets of a shot; raises UnreadableFile, NotABracket, InvalidShot. Warns of doubtful measures."""
    require_measures(shot)
    paths = shot.files(shot.plate.photographs)
    plate: BracketSource | RadianceMap
    if is_video(paths[0]) or shot.plate.frame is not None:
        plate = _of_video(shot, paths)
    elif kind_of(paths[0]) != "RAW" and isinstance(first := files.read(paths[0]), RadianceMap):
        if len(paths) > 1:
            raise InvalidShot(
                f"plate.photographs: {paths[0]} is a radiance map; give it alone, or a bracket without it"
            )
        plate = first
    elif kind_of(paths[0]) != "RAW" and len(paths) == 1:
        plate = read_single(paths[0], shot.plate.times)
    else:
        plate = _source(paths, shot.plate.times)
    balls = tuple(_ball_source(shot, index, ball) for index, ball in enumerate(shot.light.balls or ()))
    # A single photograph may be off the scale of the others: it is found from what both show.
    taken = [*balls] if isinstance(plate, RadianceMap) or is_single(plate) else [plate, *balls]
    require_known_exposures(each for each in taken if isinstance(each, Bracket))
    _require_one_scale([first_facts(each) for each in taken])
    for line in other_time_or_place(plate, balls):
        warn(line, CHANGED)
    return Photographs(plate, balls)


def _of_video(shot: Shot, paths: Sequence[Path]) -> Bracket:
    """A frame of a video as the plate; raises InvalidShot, UnreadableFile."""
    if len(paths) > 1 or not is_video(paths[0]):
        raise InvalidShot(f"plate.photographs: {paths[-1].name} beside plate.frame; give one video, or leave frame out")
    if shot.plate.frame is None:
        raise InvalidShot(f"plate.frame: missing; {paths[0].name} is a video: say which of its frames, 1 for the first")
    return read_single(paths[0], shot.plate.times, shot.plate.frame)


def plate_size(photographs: Photographs) -> tuple[int, int]:
    """(width, height) of the plate, pixels; of camera raws as their first says."""
    plate = photographs.plate
    if isinstance(plate, RadianceMap):
        return plate.size
    if isinstance(plate, Bracket):
        return plate.photographs[0].size
    return files.read_facts(Path(str(plate[0]))).size


def calibrate(shot: Shot, photographs: Photographs, steps: Steps) -> Calibrated:
    """Merge the plate and the views of the ball into radiance, and blend the views into the light.

    The photographs go the way of `relume merge`: aligned, without ghosts, through a camera profile where one is given.
    Raises NotABracket, BallNotFound, InvalidShot.
    """
    plate = photographs.plate
    tables: list[MergeTable] = [shot.plate, *(shot.light.balls or ())]
    settings = [table.model_dump(include=set(MergeTable.model_fields)) for table in tables]
    sources = [
        [shot.files(shot.plate.photographs), *(shot.files(ball.photographs) for ball in shot.light.balls or ())],
        [shot.plate.times, *(ball.times for ball in shot.light.balls or ())],
        settings,
        shot.plate.spot and shot.plate.spot.model_dump(),
        [shot.path(table.profile) for table in tables if table.profile is not None],
    ]  # fmt: skip
    # All brackets are merged together, once, if any of the steps needs it.
    merged = cache(lambda: merged_brackets(shot, photographs))
    cameras = steps.keep("response", sources, lambda: {k: _for_plot(each) for k, each in merged()[1].items()})

    # The plate.
    bracket: Bracket | None = None
    gains = (1.0, 1.0, 1.0)
    if isinstance(plate, RadianceMap):
        if shot.plate.spot is not None:
            merged()  # refuses it
        if shot.plate.denoise:
            raise InvalidShot("plate.denoise: only a bracket's noise is known; leave it out for a radiance map")
        radiance, focal_length = plate, None
    else:
        found = steps.keep("plate", sources, lambda: _merged_plate(merged()[0][0]))
        radiance, focal_length, gains = found.radiance, found.focal_length, found.gains
        bracket = found.moved
        if bracket is None and isinstance(plate, Bracket):
            # Looked at again at the end; of a large plate they lie in files until then.
            away = (replace(each, pixels=steps.stages.put_away(each.pixels)) for each in plate.photographs)
            bracket = replace(plate, photographs=tuple(away))
        if shot.plate.denoise:
            radiance = steps.keep("denoised", radiance, lambda: denoise(radiance))

    # The camera, where the ball shows it.
    views = slice(0 if isinstance(plate, RadianceMap) else 1, None)
    stood: BallCamera | None = None
    if (asked := shot.camera.of_ball) is not None:
        photograph = [] if asked.photograph is None else [shot.path(asked.photograph)]
        made_from = [
            sources,
            shot.camera.model_dump(),
            shot.light.ball and shot.light.ball.radius,
            photograph,
            radiance,
            [(table.pick, table.rim) for table in shot.light.balls or ()],
        ]
        seen = lambda: [(each.name, each.picture) for each in merged()[0][views]] if shot.light.balls else []  # noqa: E731

        def by_ball() -> BallCamera:
            balls, tables = seen(), shot.light.balls
            picked = picked_outline(tables[0], balls[0][1], balls[0][0], focal_length) if tables else None
            return camera_of_ball(shot, asked, radiance, focal_length, balls, picked)

        stood = steps.keep("ball", made_from, by_ball)

    # The light.
    joined: InterpolatedLight | None = None
    shines = shot.light.distant.radiance == "own"
    if shot.light.given() or shines:
        with steps.timed("light"):
            joined = joined_light(shot)
            probe = finished_light(shot) if joined is None else _probe_of(joined.light, joined.notes)
    else:
        ball = shot.light.ball
        made_from = [
            sources, [table.model_dump() for table in shot.light.balls or ()], ball and ball.model_dump(),
            shot.light.size, stood and stood.fit.camera,
        ]  # fmt: skip
        probe = steps.keep("light", made_from, lambda: blended(shot, merged()[0][views], stood))

    untied = _why_untied(shot, photographs)
    if shines and shot.light.given() and radiance.unit != probe.light.unit:
        # The one scale of the shot is that of the place and what lies beyond it, so that it cannot tie the two.
        raise InvalidShot(
            f"light.{shot.light.given()[0]}: what lies beyond the place is in {probe.light.unit} and the plate in "
            f"{radiance.unit}, and nothing says how the two compare; give a map on the plate's scale (`relume convert "
            "--exposure STOPS` makes one relative), or a plate in the map's unit (plate.spot)"
        )
    if (untied is not None or shines) and radiance.unit != probe.light.unit:
        # Its own scale is given up, or it is empty: the plate's is the one that counts.
        probe = replace(probe, light=replace(probe.light, unit=radiance.unit))
    if radiance.unit != probe.light.unit:
        raise InvalidShot(
            f"plate.photographs: the plate is in {radiance.unit} and the light in {probe.light.unit}; give both alike"
        )
    if isinstance(plate, RadianceMap) and not shines:
        warn(
            "plate and light come from different files; relume cannot verify that they share one radiance scale. A "
            "recovered reflectance that is not believable says that they do not"
        )
    return Calibrated(radiance, bracket, focal_length, probe, cameras, untied, stood, gains, joined)


def _why_untied(shot: Shot, photographs: Photographs) -> str | None:
    """Why no exposure puts the plate's photographs on the scale of the light; None where one does."""
    if isinstance(photographs.plate, RadianceMap):
        return None
    if (name := shot.name_of_light()) is not None:
        return f"{name} is a finished map"
    if not is_single(photographs.plate):
        return None
    return why_untied(photographs.plate.photographs[0], photographs.balls)


def finished_light(shot: Shot) -> Probe:
    """A finished map, maps at their time, or a sky, as light; nothing of it is uncertain."""
    light = shot.light.finished(shot.folder, InvalidShot)
    # A place that shines by itself needs none.
    return _probe_of(light or EnvironmentMap(np.zeros((4, 8, 3), np.float32)))


def joined_light(shot: Shot) -> InterpolatedLight | None:
    """The light of the shot's several probes at its place; None where it has none. Raises InvalidShot.

    In a place of known shape that is their middle unless it is given, so that nothing is measured anew when an object
    moves; of a scene at infinity it is where the objects are.
    """
    if shot.light.probes is None:
        return None
    distant, at = distant_scene(shot.light.distant, shot.folder), shot.light.probe
    if at is None and isinstance(distant, Infinite) and (meshes := placed_meshes(shot)):
        low = np.min([mesh.vertices.min(axis=0) for mesh in meshes], axis=0)
        at = triple((low + np.max([mesh.vertices.max(axis=0) for mesh in meshes], axis=0)) / 2)
    return shot.light.joined(distant, at, shot.folder, InvalidShot)


def _probe_of(light: EnvironmentMap, notes: tuple[Doubt, ...] = ()) -> Probe:
    return Probe(light, (), 0.0, 0.0, np.ones(light.radiance.shape[:2], np.float32), notes)


def _source(paths: Sequence[Path], times: Sequence[float] | None) -> BracketSource:
    """A bracket, read; camera raws stay paths until they are merged."""
    if kind_of(paths[0]) != "RAW":
        return read_bracket(paths, times=times)
    if times is not None:
        raise InvalidShot(f"{paths[0]}: times are for encoded photographs; camera raws hold their own: leave them out")
    return tuple(paths)


def _ball_source(shot: Shot, index: int, ball: BallPhotographs) -> BracketSource:
    """The same of a ball, whose photographs may be crops of different sizes: these are laid on one another by it."""
    paths, times = shot.files(ball.photographs), ball.times
    if kind_of(paths[0]) == "RAW" or len({files.read_facts(path).size for path in paths}) == 1:
        return _source(paths, times)
    warn(f"{paths[0]} … {paths[-1].name}: of different sizes, so taken for crops and laid on one another by the ball")
    crops = exposed([files.read_photograph(path) for path in paths], times=times)
    with picked_by_key(f"light.balls.{index}"):
        return Bracket(on_one_frame(crops, ball.outline()))


def _require_one_scale(brackets: Sequence[FirstFacts]) -> None:
    """Refuse brackets whose scales differ: camera raws beside encoded photographs, aperture or ISO in some only."""
    raw = [each.raw for each in brackets]
    if any(raw) and not all(raw):
        raise NotABracket(
            f"{brackets[raw.index(True)].name} is a camera raw and {brackets[raw.index(False)].name} is none, so their "
            "scales differ; give camera raws for plate and balls, or for neither"
        )
    for each in brackets:
        if each.raw and each.exposure is None:
            raise NotABracket(
                f"{each.name}: no exposure time in its EXIF, so its scale is not that of the others; develop plate and "
                "balls to encoded photographs and give times"
            )
    for attribute in ("f_number", "iso"):
        known = [getattr(each.exposure, attribute, None) is not None for each in brackets]
        if any(known) and not all(known):
            having, lacking = brackets[known.index(True)].name, brackets[known.index(False)].name
            if raw[0]:
                raise NotABracket(
                    f"{lacking} has no {attribute} in its EXIF and {having} has one, so their scales differ; take all "
                    "with a lens and a camera that store it, or develop all to encoded photographs and give times"
                )
            raise NotABracket(
                f"{lacking} has no {attribute} and {having} has one, so their scales differ; give times for all or none"
            )


def _merged_plate(merged: MergedBracket) -> MergedPlate:
    moved = merged.aligned.bracket if merged.aligned is not None and merged.aligned.moved else None
    balance = (1.0, 1.0, 1.0) if merged.balance is None else merged.balance.gains
    scale = (1.0, 1.0, 1.0) if merged.scale is None else merged.scale.factor
    red, green, blue = (float(a * b) for a, b in zip(balance, scale, strict=True))
    return MergedPlate(merged.picture, moved, merged.focal_length, (red, green, blue))


def _for_plot(camera: MergedCamera) -> MergedCamera:
    """The camera with as many observations of its response as its plot shows."""
    if camera.calibration is None:
        return camera
    red, green, blue = (each[:: max(1, len(each) // PLOTTED)] for each in camera.calibration.samples)
    return replace(camera, calibration=replace(camera.calibration, samples=(red, green, blue)))
