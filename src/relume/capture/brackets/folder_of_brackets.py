"""`merge_each`: every bracket in a folder becomes a map of its own, by many machines where they are given.

Unlike in `merge_shoot` no bracket depends on another: each has its own response, or all have the profile's.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from relume.capture.brackets.settings import MergeSettings
from relume.capture.brackets.shoot import MergePlan, merge_shoot, targets
from relume.capture.exposure.folder import expand, lists_beside, name_order
from relume.capture.exposure.grouping import group_files
from relume.capture.response.camera_profile import read_profile
from relume.cluster.file_tasks import FileTask, make_each
from relume.errors import RelumeError, warn
from relume.image import files
from relume.image.files.signatures import kind_of

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

MEMORY = 60
"""Bytes that a merge takes a pixel of a photograph, and for all of the photographs' floats together 24 more a pixel."""


@dataclass(frozen=True)
class MergedMap:
    """One bracket of a folder.

    target : its map
    photographs : how many it was merged from
    kept : whether an earlier run had merged it
    """

    target: Path
    photographs: int
    kept: bool


@dataclass(frozen=True)
class FoundBrackets:
    """The brackets of a folder: their files and maps, and what cannot be merged, as (name, why).

    groups : the files of each bracket
    targets : the map of each
    failed : what cannot be merged, and why
    """

    groups: tuple[tuple[Path, ...], ...]
    targets: tuple[Path, ...]
    failed: tuple[tuple[str, str], ...]


def find_brackets(folders: Iterable[str | os.PathLike[str]], out: str | os.PathLike[str]) -> FoundBrackets:
    """Every bracket in folders and those inside them, sorted as `group_files` does, and the map of each in `out`.

    folders : of photographs, or of folders of them
    out : folder for the maps

    A photograph that cannot be read spoils the bracket in whose run of names it lies; where it lies in none, the whole
    folder. A bracket is never merged without one of its photographs. Beside camera raws encoded photographs are left
    out, with a warning. Raises NotABracket for a folder without photographs.
    """
    out = Path(out)
    groups: list[tuple[Path, ...]] = []
    failed: list[tuple[str, str]] = []
    for _, members in groupby(expand(folders), key=lambda path: path.parent):
        paths = list(members)
        raws = [path for path in paths if kind_of(path) == "RAW"]
        if raws and len(raws) < len(paths):
            warn(f"{paths[0].parent}: {len(paths) - len(raws)} photographs beside camera raws are left out")
            paths = raws
        found, bad = _brackets_in(paths)
        groups += found
        failed += bad
    return FoundBrackets(tuple(groups), targets(groups, out) if groups else (), tuple(failed))


def merge_each(
    folders: Iterable[str | os.PathLike[str]], out: str | os.PathLike[str], *,
    times_from_names: bool = False, ignore: tuple[int, int, int] | None = None, true_shutter: bool = False,
    profile: str | os.PathLike[str] | None = None, settings: MergeSettings = MergeSettings(),
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> tuple[MergedMap, ...]:  # fmt: skip
    """Merge every bracket found in folders to a map of its own, `out`/name.exr; those that are there are kept.

    folders : of photographs, or of folders of them; see `find_brackets`
    out : folder, held against a second run
    profile : of the camera, taken for all; else the response of each bracket is recovered from it alone
    settings : of every merge
    cluster : None merges in this process; else as `run_tasks` takes it
    progress : called with "brackets" and the share of them that is merged
    times_from_names, ignore and true_shutter are those of `plan_merge`. Warns of the doubts of each bracket, with its
    name. Raises Incomplete, with the others written, where brackets could not be merged; OutputNotWritten, NotABracket.
    """
    profile = None if profile is None else Path(profile)
    # Workers begin elsewhere than here.
    out, folders = Path(out).absolute(), [Path(folder).absolute() for folder in folders]
    known = None if profile is None else read_profile(profile)
    name = "" if profile is None else Path(profile).name
    progress("brackets", 0.0)
    found = find_brackets(folders, out)
    value = MergePlan((), (), False, None, ignore, true_shutter, known, name, None, settings, (), times_from_names)
    tasks = [
        FileTask(target.stem, group, (target,), value, lists_beside(group))
        for group, target in zip(found.groups, found.targets, strict=True)
    ]
    made = make_each(
        _merged, tasks, out, step="brackets", cluster=cluster, progress=progress, failed=found.failed,
        memory=_memory(found.groups) if cluster is not None else None,
    )  # fmt: skip
    return tuple(MergedMap(each.target, each.facts["photographs"], each.kept) for each in made)


def _merged(task: FileTask) -> dict[str, int]:
    """Merge one bracket."""
    plan = replace(task.value, groups=(task.sources,), targets=task.targets, raw=kind_of(task.sources[0]) == "RAW")
    for doubt in merge_shoot(plan).result.doubts:
        warn(doubt.line, doubt.effect)
    return {"photographs": len(task.sources)}


def _brackets_in(paths: list[Path]) -> tuple[list[tuple[Path, ...]], list[tuple[str, str]]]:
    """The brackets of one folder, and what of it cannot be merged."""
    folder = paths[0].parent
    try:
        return list(group_files(paths)), []
    except RelumeError as error:
        why = str(error)
    unread: dict[Path, str] = {}
    for path in paths:
        try:
            files.read_facts(path)
        except RelumeError as error:
            unread[path] = str(error)
    left = [path for path in paths if path not in unread]
    try:
        groups = list(group_files(left)) if unread and left else []
    except RelumeError as error:
        groups, why = [], str(error)
    if not groups:
        return [], [(folder.name, why)]
    failed: list[tuple[str, str]] = []
    for path, reason in unread.items():
        torn = [group for group in groups if _between(group, path)]
        if not torn:
            return [], [(folder.name, reason)]
        groups = [group for group in groups if group not in torn]
        failed += [(f"{group[0].stem}-{group[-1].stem}", reason) for group in torn]
    return groups, failed


def _between(group: tuple[Path, ...], path: Path) -> bool:
    names = sorted(map(name_order, group))
    return names[0] < name_order(path) < names[-1]


def _memory(groups: tuple[tuple[Path, ...], ...]) -> int:
    """Bytes that the largest of a few brackets takes."""
    most = 0
    for group in groups[:: max(1, len(groups) // 16)]:
        width, height = files.read_facts(group[0]).size
        most = max(most, (MEMORY + 24 * len(group)) * width * height)
    return most
