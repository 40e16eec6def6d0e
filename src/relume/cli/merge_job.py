"""The work of `relume merge`: brackets read, measured camera by camera, and written."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.bracket import Bracket, FrameFacts, read_bracket
from relume.capture.measurement import Measured, Measurement, Treatment, measure
from relume.capture.profile import CameraProfile, profile_of, write_profile
from relume.capture.raw_measurement import measure_raw
from relume.cli.merge_options import Readings, tells
from relume.errors import NotABracket, OutputNotWritten
from relume.image import files
from relume.image.photograph import Exposure
from relume.shot.capture_report import clipped_facts, seconds_in_words, write_capture_report


@dataclass(frozen=True)
class Reading:
    """How exposures and pixels are read: see `read_bracket`."""

    times: list[float] | Path | None
    ignore: tuple[int, int, int] | None
    true_powers: bool


@dataclass(frozen=True)
class Job:
    """What is to be merged, where it goes, and how.

    groups, targets : the files of each bracket, and its map
    """

    groups: Sequence[Sequence[Path]]
    targets: Sequence[Path]
    reading: Reading
    profile: CameraProfile | None
    treatment: Treatment
    readings: Readings
    raw: bool


@dataclass(frozen=True, eq=False)
class Result:
    """The measurement of one camera, and where each of its maps goes."""

    measurement: Measurement
    targets: tuple[Path, ...]


def results_of(job: Job, told: Callable[[str], None]) -> list[Result]:
    """A result for each camera."""
    if job.raw:
        return _of_raws(job, told)
    told("read")
    by_camera: dict[str, list[tuple[Bracket, Path]]] = {}
    for bracket, target in zip(read_brackets(job), job.targets, strict=True):
        by_camera.setdefault(bracket.photographs[0].camera, []).append((bracket, target))
    response = job.profile.response if job.profile else None
    results = []
    for camera, taken in by_camera.items():
        _compare(job.profile, camera, taken[0][0].name)
        brackets, targets = zip(*taken, strict=True)
        found = measure(brackets, response=response, treatment=job.treatment, told=told)
        results.append(Result(found, targets))
    return results


def _of_raws(job: Job, told: Callable[[str], None]) -> list[Result]:
    by_camera: dict[str, list[tuple[Sequence[Path], Path]]] = {}
    for group, target in zip(job.groups, job.targets, strict=True):
        by_camera.setdefault(files.read_facts(group[0]).camera, []).append((group, target))
    results = []
    for camera, taken in by_camera.items():
        groups, targets = zip(*taken, strict=True)
        _compare(job.profile, camera, groups[0][0].name)
        found = measure_raw(
            groups,
            times=_raw_times(job, groups[0]),  # where times are given there is one bracket
            scale=job.readings.raw_scale(job.profile),
            sensor=job.profile.sensor if job.profile else None,
            treatment=job.treatment,
            told=told,
        )
        results.append(Result(found, targets))
    return results


def _compare(profile: CameraProfile | None, camera: str, name: str) -> None:
    """Warn where the profile is of another camera than the photographs called `name`."""
    if profile and profile.camera and camera and camera != profile.camera:
        warnings.warn(
            f"the profile is of the camera {profile.camera}, {name} are of {camera}; recover a profile of their own "
            "camera",
            stacklevel=3,
        )


def read_brackets(job: Job) -> list[Bracket]:
    """Every bracket, with its exposures."""
    reading = job.reading
    return [
        read_bracket(group, times=reading.times, ignore=reading.ignore, true_powers=reading.true_powers)
        for group in job.groups
    ]


def forecast(job: Job) -> dict[str, object]:
    """What a dry run tells: each map, and the exposures it would be made of."""
    facts: dict[str, object] = {}
    if job.raw:
        for group, target in zip(job.groups, job.targets, strict=True):
            told = [f.exposure for f in map(files.read_facts, group)]
            if (times := _raw_times(job, group)) is not None:
                told = [Exposure(seconds) for seconds in times]
            facts[f"would write {target}"] = {
                path.name: f"{seconds_in_words(e.seconds)} ({e.source})" if e else "unknown"
                for path, e in zip(group, told, strict=True)
            }
        return facts
    for bracket, target in zip(read_brackets(job), job.targets, strict=True):
        facts[f"would write {target}"] = _exposures(bracket.exposure_table)
    return facts


def write(job: Job, results: Sequence[Result], *, save_profile: Path | None, report: Path | None) -> dict[str, object]:
    """Write the maps, and the profile and the report where asked for; what was written and what came of it."""
    facts: dict[str, object] = {}
    for result in results:
        for measured, target in zip(result.measurement.measured, result.targets, strict=True):
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise OutputNotWritten(
                    f"{target.parent}: cannot be made ({error.strerror}); choose another -o"
                ) from None
            files.write(target, measured.picture)
            facts |= _facts(measured, target, alone=len(results) == 1 == len(result.targets))
        if result.measurement.calibration is not None:
            name = "residual" if len(results) == 1 else f"residual of {result.measurement.camera or 'unknown camera'}"
            facts[name] = result.measurement.calibration.residual.round(4).tolist()
    if save_profile is not None:
        facts |= _write_profiles(results, job, save_profile)
    if report is not None:
        write_capture_report([r.measurement for r in results], report)
        facts["report"] = str(report)
    return facts


def _write_profiles(results: Sequence[Result], job: Job, path: Path) -> dict[str, object]:
    """The profile of each camera, the second as NAME_1.json and so on."""
    written = []
    for index, measurement in enumerate(result.measurement for result in results):
        calibration, first = measurement.calibration, measurement.measured[0]
        if calibration is None:
            profile = CameraProfile(measurement.camera, sensor=measurement.sensor)
        else:
            profile = profile_of(calibration, measurement.camera, brackets=len(measurement.measured))
        vignetting = job.treatment.vignetting[0].to_dict() if job.treatment.vignetting else None
        scale, deviation, balance = None, None, np.ones(3)
        if first.balance is not None:
            balance *= first.balance.gains
        if first.scale is not None:
            # A luminaire of known colour scales each channel by itself: luminance is the scale, the rest is balance.
            scale, deviation = first.scale.luminance, first.scale.deviation
            balance *= np.array(first.scale.factor) / scale
        gains = (float(balance[0]), float(balance[1]), float(balance[2]))
        target = path if index == 0 else path.with_stem(f"{path.stem}_{index}")
        profile = replace(profile, vignetting=vignetting, scale=scale, scale_deviation=deviation, balance=gains)
        profile = replace(profile, scale_exposure=None if scale is None else tells(first.frames[0]))
        write_profile(target, profile)
        written.append(str(target))
    return {"profile": written[0] if len(written) == 1 else written}


def _raw_times(job: Job, group: Sequence[Path]) -> list[float] | None:
    times = job.reading.times
    if isinstance(times, Path):
        raise NotABracket(f"{times}: no list of times is read for camera raws; write them as --times 1/30,1/60")
    if times is not None and len(times) != len(group):
        raise NotABracket(f"{len(times)} times were given for {len(group)} photographs; give one a photograph")
    return times


def _exposures(frames: Sequence[FrameFacts]) -> dict[str, str]:
    return {Path(f.name).name: f"{seconds_in_words(f.seconds)} ({f.source})" for f in frames}


def _facts(measured: Measured, target: Path, *, alone: bool) -> dict[str, object]:
    found: dict[str, object] = {"written": str(target), "exposures": _exposures(measured.frames)}
    found["unit"] = measured.picture.unit
    if measured.scale is not None:
        found["scale"] = str(measured.scale)
    if measured.aligned is not None and measured.aligned.moved:
        found["moved"] = sum(motion != type(motion)() for motion in measured.aligned.motions)
    if measured.deghosted is not None and measured.deghosted.ghosts.any():
        found["ghosts"] = f"{100 * float(measured.deghosted.ghosts.mean()):.2g} % of the picture"
    found |= dict(clipped_facts(measured.extent, measured.picture.unit))
    return found if alone else {str(target): {k: v for k, v in found.items() if k != "written"}}
