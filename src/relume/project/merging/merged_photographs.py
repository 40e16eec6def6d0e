"""The brackets of a shot, merged: those of one camera by one response and on one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from relume.capture.brackets.merging import BracketSource, merge_brackets
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.exposure.bracket import Bracket
from relume.capture.response.camera_profile import CameraProfile, read_profile
from relume.capture.scale.absolute import apply_scale, scale_from_spot
from relume.capture.scale.readings import SPOT_RADIUS
from relume.capture.scale.regions import spot_radius
from relume.errors import InvalidShot, warn
from relume.image import files
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.project.merging.single_plate import assumed_response, is_single, merge_single
from relume.project.shot_file.light_table import MergeTable
from relume.project.shot_file.shot import Shot


@dataclass(frozen=True, eq=False)
class Photographs:
    """Every photograph of a shot.

    plate : a bracket, the paths of camera raws, or a finished radiance map
    balls : a bracket or the paths of camera raws, one for each view of the ball
    """

    plate: BracketSource | RadianceMap
    balls: tuple[BracketSource, ...]


@dataclass(frozen=True)
class FirstFacts:
    """What one bracket's first photograph says of all of them; `raw` where they are camera raws."""

    name: str
    camera: str
    exposure: Exposure | None
    raw: bool


def first_facts(source: BracketSource) -> FirstFacts:
    """Those of a bracket; raises UnreadableFile."""
    if isinstance(source, Bracket):
        return FirstFacts(source.name, source.photographs[0].camera, source.photographs[0].exposure, False)
    facts = files.read_facts(Path(str(source[0])))
    return FirstFacts(facts.name, facts.camera, facts.exposure, True)


def merged_brackets(shot: Shot, photographs: Photographs) -> tuple[list[MergedBracket], dict[str, MergedCamera]]:
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
    facts = [first_facts(source) for source, _ in pairs]
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
    return _in_cd_m2([found[index] for index in range(len(pairs))], shot, photographs), cameras


def _in_cd_m2(merged: list[MergedBracket], shot: Shot, photographs: Photographs) -> list[MergedBracket]:
    """The brackets in cd/m² by the plate's spot, where the shot has one: all are on the plate's scale."""
    spot = shot.plate.spot
    if spot is None:
        return merged
    if isinstance(photographs.plate, RadianceMap):
        raise InvalidShot(
            "plate.spot: the plate is a radiance map, merged already; leave spot out, and scale plate and light by "
            "relume merge --spot where they are merged"
        )
    if any(each.scale is not None for each in merged):
        raise InvalidShot("plate.spot: the camera profile has a scale already; leave one of them out")
    plate = merged[0]
    radius = spot.radius or (spot_radius(plate.focal_length) if plate.focal_length else SPOT_RADIUS)
    try:
        scale = scale_from_spot(plate.picture, *spot.at, spot.luminance, radius=radius)
    except ValueError as error:
        raise InvalidShot(f"plate.spot: {error}") from None
    return [
        replace(
            each, picture=apply_scale(each.picture, scale), scale=scale, clipping=each.clipping.scaled(scale.factor)
        )
        for each in merged
    ]


def _response_of(camera: str, cameras: Mapping[str, MergedCamera]) -> Response | None:
    return cameras[camera].response if camera in cameras else None


def _profile(path: Path) -> CameraProfile:
    try:
        return read_profile(path)
    except ValueError as error:
        raise InvalidShot(f"profile: {error}") from None


def _require_one_recovery(
    facts: Sequence[FirstFacts], profiles: Sequence[str | None], tables: Sequence[MergeTable]
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
