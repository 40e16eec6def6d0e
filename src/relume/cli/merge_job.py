"""The work of `relume merge`: brackets read, measured camera by camera, and written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.exposure.consistency import Doubt
from relume.capture.measurement import Measurement, MergeSettings, measure
from relume.capture.raw.measurement import measure_raw
from relume.capture.response.camera_profile import CameraProfile, profile_of, write_profile
from relume.cli.merge_facts import Plan, Result
from relume.cli.merge_options import Readings, tells
from relume.errors import NotABracket, OutputNotWritten
from relume.image import files
from relume.image.photograph import Exposure
from relume.report.capture_report import write_capture_report


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
    profile_name : its file's
    """

    groups: Sequence[Sequence[Path]]
    targets: Sequence[Path]
    reading: Reading
    profile: CameraProfile | None
    treatment: MergeSettings
    readings: Readings
    raw: bool
    profile_name: str = ""


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
    for taken in by_camera.values():
        brackets, targets = zip(*taken, strict=True)
        found = measure(brackets, response=response, treatment=job.treatment, told=told)
        results.append(Result(_compared(found, job.profile), targets))
    return results


def _of_raws(job: Job, told: Callable[[str], None]) -> list[Result]:
    by_camera: dict[str, list[tuple[Sequence[Path], Path]]] = {}
    for group, target in zip(job.groups, job.targets, strict=True):
        by_camera.setdefault(files.read_facts(group[0]).camera, []).append((group, target))
    results = []
    for taken in by_camera.values():
        groups, targets = zip(*taken, strict=True)
        found = measure_raw(
            groups,
            times=_raw_times(job),  # where times are given there is one bracket
            scale=job.readings.raw_scale(job.profile),
            sensor=job.profile.sensor if job.profile else None,
            treatment=job.treatment,
            told=told,
        )
        results.append(Result(_compared(found, job.profile), targets))
    return results


def _compared(found: Measurement, profile: CameraProfile | None) -> Measurement:
    """The measurement, doubted where the profile is of another camera."""
    if profile is None or not profile.camera or not found.camera or found.camera == profile.camera:
        return found
    first, *others = found.measured
    doubt = Doubt(
        first.name,
        f"of the camera {found.camera}, and the profile of {profile.camera}",
        "recover a profile of their own camera",
        degraded=True,
    )
    return replace(found, measured=(replace(first, doubts=(*first.doubts, doubt)), *others))


def read_brackets(job: Job) -> list[Bracket]:
    """Every bracket, with its exposures."""
    reading = job.reading
    return [
        read_bracket(group, times=reading.times, ignore=reading.ignore, true_powers=reading.true_powers)
        for group in job.groups
    ]


def forecast(job: Job) -> list[Plan]:
    """What would be written, and of which exposures."""
    if not job.raw:
        return [
            Plan(target, bracket.photographs[0].camera, tuple((p.name, p.exposure) for p in bracket.photographs))
            for bracket, target in zip(read_brackets(job), job.targets, strict=True)
        ]
    plans = []
    for group, target in zip(job.groups, job.targets, strict=True):
        facts = [files.read_facts(path) for path in group]
        told = [f.exposure for f in facts]
        if (times := _raw_times(job)) is not None:
            told = [Exposure(seconds) for seconds in times]
        plans.append(Plan(target, facts[0].camera, tuple(zip((f.name for f in facts), told, strict=True))))
    return plans


def write(job: Job, results: Sequence[Result], *, save_profile: Path | None, report: Path | None) -> dict[str, str]:
    """Write the maps, and the profile and the report where asked for; the profile's file of each camera."""
    for result in results:
        for measured, target in zip(result.measurement.measured, result.targets, strict=True):
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise OutputNotWritten(
                    f"{target.parent}: cannot be made ({error.strerror}); choose another -o"
                ) from None
            files.write(target, measured.picture)
    written = {} if save_profile is None else _write_profiles(results, job, save_profile)
    if report is not None:
        found = [result.measurement for result in results]
        write_capture_report(found, report, treatment=job.treatment, profile=job.profile_name)
    return written


def _write_profiles(results: Sequence[Result], job: Job, path: Path) -> dict[str, str]:
    """The profile of each camera, the second as NAME_1.json and so on."""
    written: dict[str, str] = {}
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
        written[measurement.camera] = str(target)
    return written


def _raw_times(job: Job) -> list[float] | None:
    times = job.reading.times
    if isinstance(times, Path):
        raise NotABracket(f"{times}: no list of times is read for camera raws; write them as --times 1/30,1/60")
    return times
