"""A shoot: files and folders sorted into brackets, merged, and written as radiance maps and camera profiles."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import measured_profile, merge_brackets, refuse_cameras
from relume.capture.brackets.result import MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.exposure.folder import expand, name_order
from relume.capture.exposure.grouping import Photographed, group_files
from relume.capture.exposure.named_times import seconds_in_names
from relume.capture.response.camera_profile import CameraProfile, read_profile, write_profile
from relume.errors import NotABracket, OutputNotWritten
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.photograph import Exposure

MAPS = (".exr", ".hdr")
CROPPED = 0.1
"""Difference in size, of the smallest, up to which single photographs look like crops of one bracket."""
Groups = Sequence[Sequence[Path]]


@dataclass(frozen=True)
class PlannedBracket:
    """A map that is to be written, its camera, and the exposure of each photograph as far as it is known."""

    target: Path
    camera: str
    frames: tuple[tuple[str, Exposure | None], ...]


@dataclass(frozen=True, eq=False)
class MergePlan:
    """Photographs sorted into brackets, and the map that each bracket becomes.

    groups, targets : the files of each bracket, and its map
    raw : whether they are camera raws
    times, times_from_names, ignore, true_shutter : as in `read_bracket`, where `true_shutter` is `true_powers`
    profile, profile_name : of the camera where it is known, and the name of its file
    save_profile : where to write what is measured of the camera
    settings : how each is merged
    notes : what a photographer should know of the plan, a line each
    """

    groups: tuple[tuple[Path, ...], ...]
    targets: tuple[Path, ...]
    raw: bool
    times: tuple[float, ...] | Path | None = None
    ignore: tuple[int, int, int] | None = None
    true_shutter: bool = False
    profile: CameraProfile | None = None
    profile_name: str = ""
    save_profile: Path | None = None
    settings: MergeSettings = MergeSettings()
    notes: tuple[str, ...] = ()
    times_from_names: bool = False

    def brackets(self) -> list[PlannedBracket]:
        """What will be written, and of which exposures; reads photographs, and only the headers of raws."""
        if not self.raw:
            return [
                PlannedBracket(target, bracket.photographs[0].camera, _exposures(bracket.photographs))
                for bracket, target in zip(_read(self), self.targets, strict=True)
            ]
        planned = []
        for group, target in zip(self.groups, self.targets, strict=True):
            facts = [files.read_facts(path) for path in group]
            frames = _exposures(facts)
            if (times := _raw_times(replace(self, groups=(group,)))) is not None:
                frames = tuple((f.name, Exposure(seconds)) for f, seconds in zip(facts, times, strict=True))
            planned.append(PlannedBracket(target, facts[0].camera, frames))
        return planned


@dataclass(frozen=True, eq=False)
class MergedShoot:
    """What was written of a shoot.

    result : the radiance maps and what is known of them
    targets : the file of each map
    profiles : the file of each camera's profile, by the camera's name
    """

    result: MergeResult
    targets: tuple[Path, ...]
    profiles: Mapping[str, Path]


def plan_merge(
    photographs: Iterable[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    times: Sequence[float] | str | os.PathLike[str] | None = None,
    times_from_names: bool = False,
    ignore: tuple[int, int, int] | None = None,
    true_shutter: bool = False,
    profile: str | os.PathLike[str] | None = None,
    save_profile: str | os.PathLike[str] | None = None,
    settings: MergeSettings = MergeSettings(),
) -> MergePlan:
    """Sort files and folders into brackets, and refuse before any work what cannot be merged or written.

    photographs : of any number of brackets and cameras, and folders of them; encoded photographs beside camera raws
        are left out, with a note
    out : the map of the only bracket, .exr or .hdr; without a suffix the folder for one map a bracket
    times : seconds of each photograph in the order given, a folder's by name; or a file that lists them. The
        photographs are then one bracket
    times_from_names : read the seconds from the names, as `read_bracket` does; every folder is sorted by itself
    ignore : red, green and blue of pixels that are not part of the picture, as `read_bracket` has it
    true_shutter : take marked shutter speeds for the powers of two that they stand for: 1/60 s as 1/64
    profile : the camera's profile, or a curve of pfstools or hdrgen
    save_profile : .json, for what is measured of the camera; of a second camera NAME_1.json, and so on
    settings : how each bracket is merged

    Raises UnreadableFile, NotABracket, OutputNotWritten, ValueError.
    """
    out = Path(out)
    profile = None if profile is None else Path(profile)
    save_profile = None if save_profile is None else Path(save_profile)
    # Which photographs.
    notes: list[str] = []
    paths = expand(photographs)
    raws = tuple(path for path in paths if kind_of(path) == "RAW")
    if raws and len(raws) < len(paths):
        left = len(paths) - len(raws)
        words = ("photograph", "is") if left == 1 else ("photographs", "are")
        notes.append(f"{left} {words[0]} beside {len(raws)} camera raw{'s' * (len(raws) > 1)} {words[1]} left out")
        paths = raws
    if times_from_names and times is not None:
        raise ValueError("times are given and are to be read from the names too; choose one of the two")
    if isinstance(times, str | os.PathLike):
        times = Path(times)
        if not times.is_file():
            raise ValueError(f'times: "{times}" is neither seconds above 0, like 1/30,1/60, nor a file that lists them')
    elif times is not None:
        times = tuple(times)
        if len(times) != len(paths):
            raise NotABracket(
                f"{len(times)} times were given for {len(paths)} photographs; give one a photograph, in this order (a "
                f"folder's is by name, 9 before 10): {', '.join(path.name for path in paths)}"
            )
        if list(paths) != sorted(paths, key=name_order):
            names = ", ".join(path.name for path in paths)
            notes.append(f"times go with the photographs in the order given, {names}")
    # Which of them make a bracket.
    groups = (tuple(paths),) if times else group_files(paths)
    if times_from_names:
        # A name without a time is refused before any work.
        for group in groups:
            seconds_in_names(group)

    # What is known of the camera, and which settings have an effect.
    if save_profile is not None and profile is not None:
        raise NotABracket(f"{save_profile}: a profile is given, so there is none to save; leave one of them out")
    known = None if profile is None else read_profile(profile)
    if known is not None and (known.sensor is not None) != bool(raws):
        kinds = ("encoded photographs", "camera raws")
        raise NotABracket(
            f"{profile}: a profile of {kinds[not raws]}, and these are {kinds[bool(raws)]}; save a profile of such as "
            "these"
        )
    idle = _without_effect(settings, bool(raws), known)
    if raws:
        idle += [name for name, given in (("ignore", ignore), ("true_shutter", true_shutter)) if given]
    if idle:
        why = "camera raws are merged as they are" if raws else "the profile's response is taken as it is"
        notes.append(f"without effect: {', '.join(idle)}; {why}")
    if settings.placed and len(groups) > 1:
        cameras = dict.fromkeys(files.read_facts(group[0]).camera for group in groups)
        if len(cameras) > 1:
            refuse_cameras(settings.placed[0], cameras)
    return MergePlan(
        groups, targets(groups, out), bool(raws), times, ignore, true_shutter, known,
        "" if profile is None else profile.name, save_profile, settings, tuple(notes), times_from_names,
    )  # fmt: skip


def merge_shoot(plan: MergePlan, *, progress: Callable[[str], None] = lambda step: None) -> MergedShoot:
    """Merge all brackets of the plan and write their maps, and the cameras' profiles where the plan asks for them.

    plan : as `plan_merge` made it
    progress : called with the name of each step as it begins
    Raises UnreadableFile, NotABracket, OutputNotWritten.
    """
    if plan.raw:
        result = merge_brackets(
            plan.groups, profile=plan.profile, times=_raw_times(plan), settings=plan.settings, progress=progress
        )
    else:
        progress("read")
        result = merge_brackets(_read(plan), profile=plan.profile, settings=plan.settings, progress=progress)
    for bracket, target in zip(result.brackets, plan.targets, strict=True):
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputNotWritten(f"{target.parent}: cannot be made ({error.strerror}); choose another") from None
        files.write(target, bracket.picture)
    profiles: dict[str, Path] = {}
    if plan.save_profile is not None:
        for index, name in enumerate(result.cameras):
            path = plan.save_profile
            profiles[name] = path if index == 0 else path.with_stem(f"{path.stem}_{index}")
            write_profile(profiles[name], measured_profile(result, name, plan.settings))
    return MergedShoot(result, plan.targets, profiles)


def targets(groups: Groups, out: Path) -> tuple[Path, ...]:
    """The map to write for each bracket, no two alike; raises NotABracket or OutputNotWritten."""
    names = [group[0].stem if len(group) == 1 else f"{group[0].stem}-{group[-1].stem}" for group in groups]
    if out.suffix and not out.is_dir():
        if out.suffix.lower() not in MAPS:
            raise ValueError(f"{out}: the file must end in {' or '.join(MAPS)}")
        if not out.parent.is_dir():
            raise OutputNotWritten(f"{out}: no folder {out.parent}; make it first or choose another")
        if len(groups) == 1:
            return (out,)
        if len(groups) > 1 and all(len(group) == 1 for group in groups):
            sides = np.array([files.read_facts(group[0]).size for group in groups])
            if 0 < np.ptp(sides, axis=0).max() and np.all(np.ptp(sides, axis=0) < CROPPED * sides.min(0)):
                raise NotABracket(
                    f"{groups[0][0]} and {len(groups) - 1} others: of {len(np.unique(sides, axis=0))} sizes, all but "
                    "alike; crop them alike, or give crops of a mirrored ball to relume probe, which lays them on "
                    "one another"
                )
        found = "; ".join(map(_described, groups))
        raise NotABracket(
            f"{len(groups)} brackets are here, not one: {found}. Give a folder as -o, or the photographs of one bracket"
        )
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"{out}: not a folder; without .exr or .hdr it is one, for the maps")
    if len(set(names)) < len(names):
        # Cameras count from 1 in every folder: one map must not overwrite another.
        names = [f"{group[0].absolute().parent.name}-{name}" for group, name in zip(groups, names, strict=True)]
    taken: list[str] = []
    for name in names:
        numbered = (name if number == 0 else f"{name}_{number}" for number in count())
        taken.append(next(each for each in numbered if each not in taken))
    return tuple(out / f"{name}.exr" for name in taken)


def _read(plan: MergePlan) -> list[Bracket]:
    return [
        read_bracket(
            group,
            times=plan.times,
            times_from_names=plan.times_from_names,
            ignore=plan.ignore,
            true_powers=plan.true_shutter,
        )
        for group in plan.groups
    ]


def _exposures(photographs: Sequence[Photographed]) -> tuple[tuple[str, Exposure | None], ...]:
    return tuple((p.name, p.exposure) for p in photographs)


def _raw_times(plan: MergePlan) -> tuple[float, ...] | None:
    if isinstance(plan.times, Path):
        raise NotABracket(f"{plan.times}: no list of times is read for camera raws; write them as --times 1/30,1/60")
    if plan.times_from_names:
        return tuple(seconds for group in plan.groups for seconds in seconds_in_names(group))
    return plan.times


def _without_effect(settings: MergeSettings, raw: bool, profile: CameraProfile | None) -> list[str]:
    """The settings that differ from the defaults and do nothing for these photographs."""
    names = ["neutral", "method"] if raw or profile is not None else []
    if raw:
        names += ["align", "deghost", "weighting"]
    elif profile is not None:
        names += ["refine"]
    plain = MergeSettings()
    return [name for name in names if getattr(settings, name) != getattr(plain, name)]


def _described(group: Sequence[Path]) -> str:
    """A bracket in words, with what of its first photograph distinguishes brackets."""
    first = files.read_facts(group[0])
    words = [f"{len(group)} photograph{'s' * (len(group) > 1)}"]
    words.append(first.camera or ("camera unknown" if first.exposure else "no EXIF"))
    words.append("{}×{}".format(*first.size))
    if first.exposure and first.exposure.f_number:
        words.append(f"f/{first.exposure.f_number:g}")
    if first.settings.focal_length:
        words.append(f"{first.settings.focal_length:g} mm")
    if first.settings.taken:
        words.append(f"taken {first.settings.taken:%Y-%m-%d %H:%M:%S}")
    names = group[0].name if len(group) == 1 else f"{group[0].name} … {group[-1].name}"
    return f"{names} ({', '.join(words)})"
