"""The first two steps of `insert`: the shot's photographs, and the radiance of plate and light that they give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import BracketSource, merge_brackets
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.denoising import denoise
from relume.capture.exposure.bracket import Bracket, read_bracket, require_known_exposures
from relume.capture.exposure.exposures import exposed
from relume.capture.response.calibration import Calibration
from relume.capture.response.camera_profile import CameraProfile, read_profile
from relume.errors import InvalidShot, NotABracket, warn
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.probe.ball.blending import Probe
from relume.probe.ball.crops import on_one_frame
from relume.probe.ball.silhouette import Outline
from relume.project.insertion.ball_camera import BallCamera, camera_of_ball
from relume.project.insertion.ball_light import blended, picked_outline
from relume.project.insertion.single_plate import assumed_response, is_single, merge_single, read_single, why_untied
from relume.project.insertion.slips import CHANGED, other_time_or_place, require_measures
from relume.project.shot_file.shot import MergeTable, Shot
from relume.project.stages import Steps
from relume.sphere.environment_files import as_environment

PLOTTED = 2000
"""Observations of a response that are kept, for its plot."""


@dataclass(frozen=True, eq=False)
class Photographs:
    """Every photograph of a shot.

    plate : a bracket, the paths of camera raws, or a finished radiance map
    balls : a bracket or the paths of camera raws, one for each view of the ball
    """

    plate: BracketSource | RadianceMap
    balls: tuple[BracketSource, ...]


@dataclass(frozen=True, eq=False)
class MergedPlate:
    """The plate as its photographs were merged.

    radiance : its map
    moved : its photographs, moved onto one another; None where they lay well, and for raws
    focal_length : pixels; None where unknown
    """

    radiance: RadianceMap
    moved: Bracket | None
    focal_length: float | None


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
    """

    plate: RadianceMap
    bracket: Bracket | None
    focal_length: float | None
    probe: Probe
    cameras: dict[str, MergedCamera]
    untied: str | None = None
    stood: BallCamera | None = None

    @property
    def ball_centre(self) -> tuple[float, float, float] | None:
        """Where the ball was found to be, metres; None where it was measured."""
        return None if self.stood is None else self.stood.centre

    @property
    def calibrations(self) -> dict[str, Calibration]:
        """Of the cameras whose response was recovered, by name."""
        return {name: each.calibration for name, each in self.cameras.items() if each.calibration is not None}

    def response(self, camera: str) -> Response:
        """The response of a camera that took encoded photographs."""
        response = self.cameras[camera].response
        assert response is not None  # raws have no bracket, for which this is asked
        return response


def read_photographs(shot: Shot) -> Photographs:
    """Read all the brackets of a shot; raises UnreadableFile, NotABracket, InvalidShot. Warns of doubtful measures."""
    require_measures(shot)
    paths = shot.files(shot.plate.photographs)
    plate: BracketSource | RadianceMap
    if kind_of(paths[0]) != "RAW" and isinstance(first := files.read(paths[0]), RadianceMap):
        if len(paths) > 1:
            raise InvalidShot(
                f"plate.photographs: {paths[0]} is a radiance map; give it alone, or a bracket without it"
            )
        plate = first
    elif kind_of(paths[0]) != "RAW" and len(paths) == 1:
        plate = read_single(paths[0], shot.plate.times)
    else:
        plate = _source(paths, shot.plate.times)
    balls = tuple(
        _ball_source(shot.files(ball.photographs), ball.times, ball.outline()) for ball in shot.light.balls or ()
    )
    # A single photograph may be off the scale of the others: it is found from what both show.
    taken = [*balls] if isinstance(plate, RadianceMap) or is_single(plate) else [plate, *balls]
    require_known_exposures(each for each in taken if isinstance(each, Bracket))
    _require_one_scale([_first_facts(each) for each in taken])
    for line in other_time_or_place(plate, balls):
        warn(line, CHANGED)
    return Photographs(plate, balls)


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
        [shot.path(table.profile) for table in tables if table.profile is not None],
    ]  # fmt: skip
    # All brackets are merged together, once, if any of the steps needs it.
    merged = cache(lambda: _merged(shot, photographs))
    cameras = steps.keep("response", sources, lambda: {k: _for_plot(each) for k, each in merged()[1].items()})

    # The plate.
    bracket: Bracket | None = None
    if isinstance(plate, RadianceMap):
        if shot.plate.denoise:
            raise InvalidShot("plate.denoise: only a bracket's noise is known; leave it out for a radiance map")
        radiance, focal_length = plate, None
    else:
        found = steps.keep("plate", sources, lambda: _merged_plate(merged()[0][0]))
        radiance, focal_length = found.radiance, found.focal_length
        bracket = found.moved or (plate if isinstance(plate, Bracket) else None)
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
    if shot.light.map is not None:
        with steps.timed("light"):
            probe = light_from_map(shot.path(shot.light.map))
    else:
        ball = shot.light.ball
        made_from = [
            sources, [table.model_dump() for table in shot.light.balls or ()], ball and ball.model_dump(),
            shot.light.size, stood and stood.fit.camera,
        ]  # fmt: skip
        probe = steps.keep("light", made_from, lambda: blended(shot, merged()[0][views], stood))

    untied = _why_untied(shot, photographs)
    if untied is not None and radiance.unit != probe.light.unit:
        # Its own scale is given up: the plate's is the one that counts.
        probe = replace(probe, light=replace(probe.light, unit=radiance.unit))
    if radiance.unit != probe.light.unit:
        raise InvalidShot(
            f"plate.photographs: the plate is in {radiance.unit} and the light in {probe.light.unit}; give both alike"
        )
    if isinstance(plate, RadianceMap):
        warn(
            "plate and light come from different files; relume cannot verify that they share one radiance scale. A "
            "recovered reflectance that is not believable says that they do not"
        )
    return Calibrated(radiance, bracket, focal_length, probe, cameras, untied, stood)


def _why_untied(shot: Shot, photographs: Photographs) -> str | None:
    """Why no exposure puts the plate's photographs on the scale of the light; None where one does."""
    if isinstance(photographs.plate, RadianceMap):
        return None
    if shot.light.map is not None:
        return f"{shot.path(shot.light.map)} is a finished map"
    if not is_single(photographs.plate):
        return None
    return why_untied(photographs.plate.photographs[0], photographs.balls)


def light_from_map(path: Path) -> Probe:
    """A finished map as light; nothing of it is uncertain."""
    try:
        light = as_environment(files.read_radiance(path))
    except ValueError as error:
        raise InvalidShot(f"{path}: {error}") from None
    return Probe(light, (), 0.0, 0.0, np.ones(light.radiance.shape[:2], np.float32))


def _source(paths: Sequence[Path], times: Sequence[float] | None) -> BracketSource:
    """A bracket, read; camera raws stay paths until they are merged."""
    if kind_of(paths[0]) != "RAW":
        return read_bracket(paths, times=times)
    if times is not None:
        raise InvalidShot(f"{paths[0]}: times are for encoded photographs; camera raws hold their own: leave them out")
    return tuple(paths)


def _ball_source(paths: Sequence[Path], times: Sequence[float] | None, picked: Outline | None = None) -> BracketSource:
    """The same of a ball, whose photographs may be crops of different sizes: these are laid on one another by it."""
    if kind_of(paths[0]) == "RAW" or len({files.read_facts(path).size for path in paths}) == 1:
        return _source(paths, times)
    warn(f"{paths[0]} … {paths[-1].name}: of different sizes, so taken for crops and laid on one another by the ball")
    return Bracket(on_one_frame(exposed([files.read_photograph(path) for path in paths], times=times), picked))


@dataclass(frozen=True)
class _FirstFacts:
    """What one bracket's first photograph says of all of them; `raw` where they are camera raws."""

    name: str
    camera: str
    exposure: Exposure | None
    raw: bool


def _first_facts(source: BracketSource) -> _FirstFacts:
    if isinstance(source, Bracket):
        return _FirstFacts(source.name, source.photographs[0].camera, source.photographs[0].exposure, False)
    facts = files.read_facts(Path(str(source[0])))
    return _FirstFacts(facts.name, facts.camera, facts.exposure, True)


def _require_one_scale(brackets: Sequence[_FirstFacts]) -> None:
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


def _merged(shot: Shot, photographs: Photographs) -> tuple[list[MergedBracket], dict[str, MergedCamera]]:
    """Every bracket merged, in the order plate, balls; and what is known of the cameras.

    Brackets of one camera with the same settings are merged together, so that they recover one response. Those with
    other settings take the camera's profile, where another of its brackets has one, else the response that was
    recovered of it before: plate and light of one camera have one white.
    """
    # What there is, and the profiles that are given.
    pairs: list[tuple[BracketSource, MergeTable]] = []
    if not isinstance(photographs.plate, RadianceMap):
        pairs.append((photographs.plate, shot.plate))
    pairs += zip(photographs.balls, shot.light.balls or (), strict=True)
    single = photographs.plate if is_single(photographs.plate) else None
    facts = [_first_facts(source) for source, _ in pairs]
    own = [table.profile for _, table in pairs]
    read = {name: _profile(shot.path(name)) for name in dict.fromkeys(own) if name is not None}
    of_camera: dict[str, str] = {}
    for one, name in zip(facts, own, strict=True):
        if name is not None and read[of_camera.setdefault(one.camera, name)].balance != read[name].balance:
            raise InvalidShot(
                f"profile: {of_camera[one.camera]} and {name} are both for {one.camera or 'one camera'} and balance "
                "white differently; give plate and balls the same one"
            )
    profiles = [name or of_camera.get(one.camera) for one, name in zip(facts, own, strict=True)]
    first = 1 if single is not None else 0
    _require_one_recovery(facts[first:], profiles[first:], [table for _, table in pairs[first:]])

    # The brackets of one camera, profile and settings together; a single plate last, as it shows no response itself.
    kinds = [
        (one.camera, profile, table.merge_settings())
        for one, profile, (_, table) in zip(facts, profiles, pairs, strict=True)
    ]
    found: dict[int, MergedBracket] = {}
    cameras: dict[str, MergedCamera] = {}
    for kind in dict.fromkeys(kinds if single is None else kinds[1:]):
        camera, profile, settings = kind
        chosen = [index for index, each in enumerate(kinds) if each == kind and (index or single is None)]
        known = _response_of(camera, cameras) if profile is None else read[profile]
        one = pairs[chosen[0]][0]
        if known is None and is_single(one) and all(is_single(pairs[index][0]) for index in chosen):
            known = assumed_response(one.photographs[0])
        result = merge_brackets([pairs[index][0] for index in chosen], profile=known, settings=settings)
        for doubt in result.doubts:
            warn(doubt.line, doubt.effect)
        found |= zip(chosen, result.brackets, strict=True)
        cameras = {**result.cameras, **cameras}
    # The single plate.
    if single is not None:
        camera, profile, settings = kinds[0]
        known = _response_of(camera, cameras) if profile is None else read[profile]
        found[0], own_camera = merge_single(single, known, settings)
        if camera in cameras and cameras[camera].response is None:
            cameras[f"{camera} (raws)"] = cameras.pop(camera)
        cameras = {camera: own_camera, **cameras}
    return [found[index] for index in range(len(pairs))], cameras


def _response_of(camera: str, cameras: Mapping[str, MergedCamera]) -> Response | None:
    return cameras[camera].response if camera in cameras else None


def _profile(path: Path) -> CameraProfile:
    try:
        return read_profile(path)
    except ValueError as error:
        raise InvalidShot(f"profile: {error}") from None


def _require_one_recovery(
    facts: Sequence[_FirstFacts], profiles: Sequence[str | None], tables: Sequence[MergeTable]
) -> None:
    """Refuse two ways to recover one camera's response, which is recovered once; raises InvalidShot."""
    ways: dict[str, tuple[str, dict[str, object]]] = {}
    for one, profile, table in zip(facts, profiles, tables, strict=True):
        if one.raw or profile is not None:
            continue
        way = table.model_dump(include={"method", "neutral", "refine"})
        first, before = ways.setdefault(one.camera, (one.name, way))
        if differing := [key for key in way if way[key] != before[key]]:
            raise InvalidShot(
                f"{differing[0]}: differs between {first} and {one.name}, of one camera, whose response is recovered "
                "once; give plate and balls the same"
            )


def _merged_plate(merged: MergedBracket) -> MergedPlate:
    moved = merged.aligned.bracket if merged.aligned is not None and merged.aligned.moved else None
    return MergedPlate(merged.picture, moved, merged.focal_length)


def _for_plot(camera: MergedCamera) -> MergedCamera:
    """The camera with as many observations of its response as its plot shows."""
    if camera.calibration is None:
        return camera
    red, green, blue = (each[:: max(1, len(each) // PLOTTED)] for each in camera.calibration.samples)
    return replace(camera, calibration=replace(camera.calibration, samples=(red, green, blue)))
