"""The work of `relume merge`: brackets read, measured camera by camera, and written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from relume.capture.brackets.merging import measured_profile, merge_brackets
from relume.capture.brackets.result import MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.cli.merge_facts import Plan
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
    settings: MergeSettings
    raw: bool
    profile_name: str = ""


def merged(job: Job, progress: Callable[[str], None]) -> MergeResult:
    """The result of all brackets."""
    if job.raw:
        return merge_brackets(
            job.groups, profile=job.profile, times=_raw_times(job), settings=job.settings, progress=progress
        )
    progress("read")
    return merge_brackets(read_brackets(job), profile=job.profile, settings=job.settings, progress=progress)


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


def write(job: Job, result: MergeResult, *, save_profile: Path | None, report: Path | None) -> dict[str, str]:
    """Write the maps, and the profile and the report where asked for; the profile's file of each camera."""
    for bracket, target in zip(result.brackets, job.targets, strict=True):
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputNotWritten(f"{target.parent}: cannot be made ({error.strerror}); choose another -o") from None
        files.write(target, bracket.picture)
    written: dict[str, str] = {}
    for index, name in enumerate(result.cameras if save_profile is not None else ()):
        # The profile of the second camera is NAME_1.json, and so on.
        assert save_profile is not None
        target = save_profile if index == 0 else save_profile.with_stem(f"{save_profile.stem}_{index}")
        write_profile(target, measured_profile(result, name, job.settings))
        written[name] = str(target)
    if report is not None:
        write_capture_report(result, report, settings=job.settings, profile=job.profile_name)
    return written


def _raw_times(job: Job) -> list[float] | None:
    times = job.reading.times
    if isinstance(times, Path):
        raise NotABracket(f"{times}: no list of times is read for camera raws; write them as --times 1/30,1/60")
    return times
