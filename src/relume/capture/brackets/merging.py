"""`merge_brackets`: photographs or camera raws in, calibrated radiance out, the one path of every command."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from relume.capture.brackets.lens_steps import Steps
from relume.capture.brackets.one_camera import merge_photographs, merge_raws
from relume.capture.brackets.result import MergedBracket, MergedCamera, MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, FrameFacts, read_bracket
from relume.capture.exposure.consistency import BracketDoubt
from relume.capture.lens.vignetting import Vignetting
from relume.capture.raw.merging import RawCalibration, RawSource
from relume.capture.response.camera_profile import CameraProfile, profile_of
from relume.capture.scale.absolute import METER, Scale
from relume.capture.scale.readings import ChannelGains
from relume.errors import GatheredDoubts, NotABracket
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.photograph import Exposure, RawPhotograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response

BracketSource = Bracket | Sequence[RawSource]
"""A bracket: read already, or the paths of its photographs or camera raws."""


def merge_brackets(
    brackets: BracketSource | Sequence[BracketSource],
    *,
    profile: CameraProfile | Response | None = None,
    times: Sequence[float] | None = None,
    settings: MergeSettings = MergeSettings(),
    progress: Callable[[str], None] = lambda step: None,
) -> MergeResult:
    """Check, align, recover the response, take out ghosts, merge, and take out what the lens added.

    brackets : one bracket, or several of any number of cameras: each a `Bracket`, or the paths of its photographs or
        camera raws in any order. Those of one camera share one response and one scale; what is read at a place of a
        map, as a spot meter's reading, is read in the first bracket
    profile : of the camera, or its response alone; recovered from the brackets unless given
    times : exposure times in seconds of all paths, bracket after bracket; they replace the whole EXIF exposure
    settings : of every merge: alignment, ghosts, lens, scale
    progress : called with the name of each step as it begins

    A photograph alone needs a profile. Warnings of the steps are kept in the result and not given out.
    Raises UnreadableFile, NotABracket, ValueError.
    """
    if isinstance(profile, Response):
        profile = CameraProfile("", profile)
    settings = _with_profile(settings, profile)
    steps = Steps(progress)
    with GatheredDoubts() as gathered:
        by_camera = _by_camera(_opened(_listed(brackets), times))
        if settings.placed and len(by_camera) > 1:
            refuse_cameras(settings.placed[0], by_camera)
        found: dict[int, MergedBracket] = {}
        cameras: dict[str, MergedCamera] = {}
        for name, sources in by_camera.items():
            merged, camera = _of_one_camera(list(sources.values()), profile, settings, steps)
            cameras[name] = replace(camera, name=name)
            named = (replace(bracket, camera=name) for bracket in _compared(merged, profile))
            found |= zip(sources, named, strict=True)
    in_order = tuple(found[index] for index in sorted(found))
    lines = [each.line for each in gathered.doubts]
    if settings.placed and len(in_order) > 1:
        names, first = ", ".join(settings.placed), in_order[0].name
        lines.append(f"{names}: read in {first}, the first of {len(in_order)} brackets, and used for all")
    return MergeResult(in_order, cameras, steps.seconds, tuple(dict.fromkeys(lines)))


@dataclass(frozen=True, eq=False)
class _Raws:
    """The raws of one bracket, their times if given, and their camera."""

    sources: Sequence[RawSource]
    times: Sequence[float] | None
    camera: str


def _listed(brackets: BracketSource | Sequence[BracketSource]) -> list[BracketSource]:
    """Several brackets, or the one that was given."""
    if isinstance(brackets, Bracket):
        return [brackets]
    alone = [each for each in brackets if isinstance(each, str | os.PathLike | RawPhotograph)]
    several = [each for each in brackets if not isinstance(each, str | os.PathLike | RawPhotograph)]
    if alone and several:
        raise ValueError("photographs and brackets of them together; give the photographs of one, or brackets alone")
    found = several or [alone]
    if not all(isinstance(each, Bracket) or len(each) for each in found):
        raise NotABracket("no photographs were given; name at least one file")
    return found


def _opened(brackets: Sequence[BracketSource], times: Sequence[float] | None) -> list[Bracket | _Raws]:
    """Photographs read; camera raws are opened one at a time later."""
    if times is not None:
        if any(isinstance(bracket, Bracket) for bracket in brackets):
            raise ValueError("times go with paths; the photographs of a Bracket have theirs")
        count = sum(len(bracket) for bracket in brackets if not isinstance(bracket, Bracket))
        if len(times) != count:
            raise NotABracket(f"{len(times)} times were given for {count} photographs; give one a photograph")
    opened: list[Bracket | _Raws] = []
    begin = 0
    for bracket in brackets:
        if isinstance(bracket, Bracket):
            opened.append(bracket)
            continue
        own = None if times is None else list(times[begin : begin + len(bracket)])
        begin += len(bracket)
        raw = [isinstance(source, RawPhotograph) or kind_of(Path(source)) == "RAW" for source in bracket]
        if not any(raw):
            opened.append(read_bracket([Path(s) for s in bracket if not isinstance(s, RawPhotograph)], times=own))
        elif all(raw):
            first = bracket[0]
            camera = first.camera if isinstance(first, RawPhotograph) else files.read_facts(Path(first)).camera
            opened.append(_Raws(bracket, own, camera))
        else:
            raise NotABracket(f"{bracket[raw.index(False)]}: a photograph among camera raws; merge them apart")
    return opened


def _by_camera(brackets: Sequence[Bracket | _Raws]) -> dict[str, dict[int, Bracket | _Raws]]:
    """The brackets of each camera, with their indices; the raws of a camera that also made photographs go apart."""
    names = [one.camera if isinstance(one, _Raws) else one.photographs[0].camera for one in brackets]
    encoded = {name for name, one in zip(names, brackets, strict=True) if isinstance(one, Bracket)}
    found: dict[str, dict[int, Bracket | _Raws]] = {}
    for index, (name, one) in enumerate(zip(names, brackets, strict=True)):
        apart = f"{name} (raws)" if isinstance(one, _Raws) and name in encoded else name
        found.setdefault(apart, {})[index] = one
    return found


def refuse_cameras(reading: str, cameras: Iterable[str]) -> NoReturn:
    """Refuse a reading at a place for brackets of several cameras: it scales one of them only."""
    raise NotABracket(
        f"{reading} is read in one bracket, and these are of several cameras "
        f"({', '.join(name or 'an unknown one' for name in cameras)}); merge them camera by camera"
    )


def _of_one_camera(
    brackets: Sequence[Bracket | _Raws], profile: CameraProfile | None, settings: MergeSettings, steps: Steps
) -> tuple[list[MergedBracket], MergedCamera]:
    photographs = [one for one in brackets if isinstance(one, Bracket)]
    raws = [one for one in brackets if isinstance(one, _Raws)]
    if profile is not None and (profile.sensor is not None) != bool(raws):
        kinds = ("encoded photographs", "camera raws")
        raise NotABracket(
            f"the profile is of {kinds[not raws]}, and these are {kinds[bool(raws)]}; save one of such as these"
        )
    if photographs:
        return merge_photographs(photographs, profile and profile.response, settings, steps)
    return merge_raws([(one.sources, one.times) for one in raws], profile and profile.sensor, settings, steps)


def _compared(merged: Sequence[MergedBracket], profile: CameraProfile | None) -> list[MergedBracket]:
    """The brackets of one camera; the first is doubted where the profile is of another camera."""
    first, *others = merged
    if profile is None or not profile.camera or not first.camera or first.camera == profile.camera:
        return [first, *others]
    doubt = BracketDoubt(
        first.name,
        f"of the camera {first.camera}, and the profile of {profile.camera}",
        "recover a profile of their own camera",
        degraded=True,
        effect=0.3,
    )
    return [replace(first, doubts=(*first.doubts, doubt)), *others]


def _with_profile(settings: MergeSettings, profile: CameraProfile | None) -> MergeSettings:
    """The settings, with the vignetting, balance and scale of the profile where they give none."""
    if profile is None:
        return settings
    if not settings.vignetting and profile.vignetting is not None:
        settings = replace(settings, vignetting=(Vignetting.from_dict(profile.vignetting),))
    if settings.balance is None and profile.balance != (1.0, 1.0, 1.0):
        settings = replace(settings, balance=ChannelGains(profile.balance))
    if settings.scale is None and profile.scale is not None:
        settings = replace(settings, scale=_ProfileScale(profile))
    return settings


@dataclass(frozen=True, eq=False)
class _ProfileScale:
    """The scale of a profile; refuses exposures that hold other facts than those it was measured with."""

    profile: CameraProfile

    def __call__(self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration) -> Scale:
        profile, exposure = self.profile, bracket.photographs[0].exposure
        measured_with = profile.scale_exposure
        if exposure is not None and measured_with not in (None, known_facts(exposure)):
            raise NotABracket(
                f"{bracket.name}: its exposures have {_facts_in_words(known_facts(exposure))}, those of the profile's "
                f"scale {_facts_in_words(measured_with)}; the scale holds only where both have the same"
            )
        assert profile.scale is not None  # `_with_profile` asks for no other
        deviation = METER if profile.scale_deviation is None else profile.scale_deviation
        return Scale.grey(profile.scale, deviation, "the camera's profile")


def known_facts(exposure: Exposure | FrameFacts) -> tuple[bool, bool]:
    """Whether f-number and ISO are known: an unknown one counts as 1 and 100 in relative radiance."""
    return exposure.f_number is not None, exposure.iso is not None


def _facts_in_words(known: tuple[bool, bool] | None) -> str:
    found = [name for name, is_known in zip(("f-number", "ISO"), known or (), strict=False) if is_known]
    return " and ".join(found) or "neither f-number nor ISO"


def measured_profile(result: MergeResult, camera: str, settings: MergeSettings) -> CameraProfile:
    """The profile of a camera: its response or sensor, and the vignetting, balance and scale of its first bracket.

    camera : a name in `result.cameras`
    settings : that the result was made with
    """
    known = result.cameras[camera]
    brackets = [bracket for bracket in result.brackets if bracket.camera == camera]
    first = brackets[0]
    if known.calibration is None:
        profile = CameraProfile(known.name, known.response, known.sensor)
    else:
        profile = profile_of(known.calibration, known.name, brackets=len(brackets))
    scale, deviation, balance = None, None, np.ones(3)
    if first.balance is not None:
        balance *= first.balance.gains
    if first.scale is not None:
        # A luminaire of known colour scales each channel by itself: luminance is the scale, the rest is balance.
        scale, deviation = first.scale.luminance, first.scale.deviation
        balance *= np.array(first.scale.factor) / scale
    return replace(
        profile,
        vignetting=settings.vignetting[0].to_dict() if settings.vignetting else None,
        scale=scale,
        scale_deviation=deviation,
        scale_exposure=None if scale is None else known_facts(first.frames[0]),
        balance=(float(balance[0]), float(balance[1]), float(balance[2])),
    )
