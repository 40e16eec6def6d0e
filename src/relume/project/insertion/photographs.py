"""The first two steps of `insert`: the shot's photographs, and the radiance of plate and light that they give."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import BracketSource, merge_brackets
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.denoising import denoise
from relume.capture.exposure.bracket import Bracket, read_bracket, require_known_exposures
from relume.capture.response.calibration import Calibration
from relume.capture.response.camera_profile import CameraProfile, read_profile
from relume.errors import InvalidShot, NotABracket
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.probe.ball.blending import Probe, blend_views
from relume.probe.ball.unwrapping import unwrap_ball
from relume.project.shot_file.merge_table import MergeTable
from relume.project.shot_file.shot import Shot
from relume.project.stages import Steps
from relume.sphere.environment_files import as_environment

PLOTTED = 2000
"""Observations of a response that are kept, for its plot."""
FEWEST = 0.01
"""Share of a ball's picture that has to be measured."""


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
    """

    plate: RadianceMap
    bracket: Bracket | None
    focal_length: float | None
    probe: Probe
    cameras: dict[str, MergedCamera]

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
    """Read all the brackets of a shot; raises UnreadableFile, NotABracket, InvalidShot."""
    paths = shot.files(shot.plate.photographs)
    plate: BracketSource | RadianceMap
    if kind_of(paths[0]) != "RAW" and isinstance(first := files.read(paths[0]), RadianceMap):
        if len(paths) > 1:
            raise InvalidShot(
                f"plate.photographs: {paths[0]} is a radiance map; give it alone, or a bracket without it"
            )
        plate = first
    else:
        plate = _source(paths, shot.plate.times)
    balls = tuple(_source(shot.files(ball.photographs), ball.times) for ball in shot.light.balls or ())
    taken = [each for each in (plate, *balls) if isinstance(each, Bracket)]
    require_known_exposures(taken)
    _require_one_scale(taken)
    return Photographs(plate, balls)


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
        [shot.folder / table.profile for table in tables if table.profile is not None],
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

    # The light.
    if shot.light.map is not None:
        with steps.timed("light"):
            probe = light_from_map(shot.folder / shot.light.map)
    else:
        ball = shot.light.ball
        made_from = [
            sources, [table.model_dump() for table in shot.light.balls or ()], ball and ball.model_dump(),
            shot.light.size,
        ]  # fmt: skip
        views = slice(0 if isinstance(plate, RadianceMap) else 1, None)
        probe = steps.keep("light", made_from, lambda: _blended(shot, merged()[0][views]))

    if radiance.unit != probe.light.unit:
        raise InvalidShot(
            f"plate.photographs: the plate is in {radiance.unit} and the light in {probe.light.unit}; give both alike"
        )
    if isinstance(plate, RadianceMap) or shot.light.map is not None:
        warnings.warn(
            "plate and light come from different files; relume cannot verify that they share one radiance scale. A "
            "recovered reflectance that is not believable says that they do not",
            stacklevel=2,
        )
    return Calibrated(radiance, bracket, focal_length, probe, cameras)


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


def _require_one_scale(brackets: Sequence[Bracket]) -> None:
    """Refuse brackets of which only some hold aperture or ISO: their scales would differ by what the others hold."""
    for attribute in ("f_number", "iso"):
        known = [getattr(b.photographs[0].exposure, attribute) is not None for b in brackets]
        if any(known) and not all(known):
            having, lacking = brackets[known.index(True)].name, brackets[known.index(False)].name
            raise NotABracket(
                f"{lacking} has no {attribute} and {having} has one, so their scales differ; give times for all or none"
            )


def _merged(shot: Shot, photographs: Photographs) -> tuple[list[MergedBracket], dict[str, MergedCamera]]:
    """Every bracket merged, in the order plate, balls; and what is known of the cameras.

    Brackets with the same settings are merged together, so that those of one camera recover one response. Those with
    other settings take the response that was recovered of their camera before.
    """
    pairs: list[tuple[BracketSource, MergeTable]] = []
    if not isinstance(photographs.plate, RadianceMap):
        pairs.append((photographs.plate, shot.plate))
    pairs += zip(photographs.balls, shot.light.balls or (), strict=True)
    kinds = [(table.profile, table.merge_settings()) for _, table in pairs]
    found: dict[int, MergedBracket] = {}
    cameras: dict[str, MergedCamera] = {}
    for profile, settings in dict.fromkeys(kinds):
        chosen = [index for index, each in enumerate(kinds) if each == (profile, settings)]
        sources = [pairs[index][0] for index in chosen]
        known = _known_response(sources, cameras) if profile is None else _profile(shot.folder / profile)
        result = merge_brackets(sources, profile=known, settings=settings)
        for line in (*result.warnings, *result.notes):
            warnings.warn(line, stacklevel=2)
        found |= zip(chosen, result.brackets, strict=True)
        cameras = {**result.cameras, **cameras}
    return [found[index] for index in range(len(pairs))], cameras


def _profile(path: Path) -> CameraProfile:
    try:
        return read_profile(path)
    except ValueError as error:
        raise InvalidShot(f"profile: {error}") from None


def _known_response(sources: Sequence[BracketSource], cameras: dict[str, MergedCamera]) -> Response | None:
    """The response that was recovered before of the one camera that took these brackets; None for any other."""
    names = {each.photographs[0].camera if isinstance(each, Bracket) else None for each in sources}
    name = names.pop() if len(names) == 1 else None
    return cameras[name].response if name in cameras else None


def _merged_plate(merged: MergedBracket) -> MergedPlate:
    moved = merged.aligned.bracket if merged.aligned is not None and merged.aligned.moved else None
    return MergedPlate(merged.picture, moved, merged.focal_length)


def _for_plot(camera: MergedCamera) -> MergedCamera:
    """The camera with as many observations of its response as its plot shows."""
    if camera.calibration is None:
        return camera
    red, green, blue = (each[:: max(1, len(each) // PLOTTED)] for each in camera.calibration.samples)
    return replace(camera, calibration=replace(camera.calibration, samples=(red, green, blue)))


def _blended(shot: Shot, merged: Sequence[MergedBracket]) -> Probe:
    """The views of the ball, unwrapped and blended."""
    ball, tables = shot.light.ball, shot.light.balls or ()
    if ball is None or not tables:
        raise InvalidShot("light: balls and ball are both needed")
    views = []
    for table, bracket in zip(tables, merged, strict=True):
        picture = bracket.picture
        if picture.clipped is not None and (picture.clipped == 0).mean() < FEWEST:
            raise NotABracket(f"{bracket.name}: almost nothing is measured; add longer and shorter exposures")
        reflectance = np.array(ball.reflectance, np.float32)
        picture = RadianceMap(picture.radiance / reflectance, None, picture.clipped, picture.unit)
        views.append(
            unwrap_ball(
                picture,
                camera=np.array(table.camera),
                centre=np.array(ball.centre),
                focal_length=table.focal_length or bracket.focal_length,
                radius=ball.radius,
                name=bracket.name,
            )
        )
    return blend_views(views, size=shot.light.size)
