"""`probe_each`: every place in a folder, with its photographs of a mirrored ball, becomes an environment map."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.capture.exposure.folder import folders_in, lists_beside, pictures_in
from relume.capture.response.camera_profile import CameraProfile, read_profile
from relume.cluster.file_tasks import FileMade, FileTask, make_each
from relume.errors import RelumeError, UnreadableFile, warn
from relume.image import files
from relume.probe.ball.probing import ProbeSettings, probe_ball, write_probe
from relume.probe.ball.view_files import BallPhotographs, Point, find_ball_photographs, placed_views

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

MEMORY = 60
"""Bytes that a probe takes a pixel of a photograph, and for each of the photographs' floats 24 more, as a merge."""


@dataclass(frozen=True, eq=False)
class SharedByPlaces:
    """What all places have in common."""

    camera: Point
    turns: tuple[float, ...] | None
    profile: CameraProfile | None
    times_from_names: bool
    settings: ProbeSettings


def find_places(folders: Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """The folders of places, absolute: one that holds photographs or a radiance map is one, else those inside it are.

    Where several are given, warns of one that holds folders of photographs: these may be views of one place. Raises
    UnreadableFile for what is no folder, and for a folder without photographs and folders.
    """
    found: dict[Path, None] = {}
    given = [Path(folder).absolute() for folder in folders]
    for folder in given:
        if not folder.is_dir():
            raise UnreadableFile(f"{folder}: no folder; name the folder that holds a folder for each place")
        inside = [folder] if pictures_in(folder, _is_view) else folders_in(folder) or [folder]
        if len(given) > 1 and inside != [folder] and any(pictures_in(each, _is_view) for each in inside):
            names = ", ".join(each.name for each in inside)
            warn(
                f"{folder}: {names} in it count as a place each; where they are views of one place, give the folder "
                "above the places"
            )
        found.update(dict.fromkeys(inside))
    if not found:
        raise UnreadableFile("no folders were given; name the folder that holds a folder for each place")
    return tuple(found)


def probe_each(
    folders: Iterable[str | os.PathLike[str]], out: str | os.PathLike[str], *, ending: str = ".exr",
    camera: Point = (0.0, 0.0, 1.0), turns: Sequence[float] | None = None,
    profile: str | os.PathLike[str] | None = None, times_from_names: bool = False,
    settings: ProbeSettings = ProbeSettings(), dry_run: bool = False,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> tuple[FileMade, ...]:  # fmt: skip
    """Unwrap the ball of every place into a map of its own, `out`/place with `ending`; those that are there are kept.

    folders : see `find_places`; photographs in a place's folder are one view, folders inside it a view each
    out : the folder, made where it is missing
    ending : .exr or .hdr
    camera : where the camera of the first view stood, metres from the ball's centre, Y up; a metre before it unless
        given
    turns : radians by which the camera was carried round the ball for each view; registered with unless given
    profile : of the camera, for all
    times_from_names : read exposure times from the files' names, as `read_bracket` does
    settings : of every probe
    dry_run : find the places, and unwrap nothing
    cluster : None does it in this process; else as `run_tasks` takes it
    progress : called with "places" and the share of them that is settled

    Facts are those of `BallProbe.facts`. Raises Incomplete, with the others written, where no ball was found or
    photographs cannot be read; UnreadableFile, OutputNotWritten; ValueError for two places of one name.
    """
    if ending not in (".exr", ".hdr"):
        raise ValueError(f"ending {ending}: give .exr or .hdr")
    out = Path(out).absolute()
    known = None if profile is None else read_profile(Path(profile))
    shared = SharedByPlaces(camera, None if turns is None else tuple(turns), known, times_from_names, settings)
    tasks: list[FileTask] = []
    failed: list[tuple[str, str]] = []
    for place in find_places(folders):
        if place == out:  # what was written there is no input
            continue
        try:
            paths = tuple(path for view in _views(place) for path in view.paths)
        except RelumeError as error:
            failed.append((place.name, str(error)))
            continue
        target = out / f"{place.name}{ending}"
        tasks.append(FileTask(place.name, paths, (target,), (place, shared), lists_beside(paths)))
    return make_each(
        _probed, tasks, out, step="places", cluster=cluster, progress=progress, failed=failed, dry_run=dry_run,
        memory=_memory(tasks) if cluster is not None else None,
    )  # fmt: skip


def _probed(task: FileTask) -> dict[str, Any]:
    """Unwrap the ball of one place."""
    place, shared = task.value
    views = _views(place)
    if shared.turns is None:
        views[:1] = placed_views(views[:1], shared.camera, [0.0])
    else:
        views = placed_views(views, shared.camera, shared.turns)
    result = probe_ball(
        views, times_from_names=shared.times_from_names, profile=shared.profile, settings=shared.settings
    )
    write_probe(task.targets[0], result.probe)
    for doubt in result.doubts:
        warn(doubt.line, doubt.effect)
    return result.facts()


def _views(place: Path) -> list[BallPhotographs]:
    """The views of a place: its folders, or the photographs in itself; raises UnreadableFile where it has both."""
    inside = folders_in(place)
    if inside and (loose := pictures_in(place, _is_view)):
        raise UnreadableFile(
            f"{place}: holds {loose[0].name} and the folder {inside[0].name}; a place has one bracket, or a folder for "
            "each view"
        )
    return find_ball_photographs(inside or [place])


def _is_view(path: Path) -> bool:
    """Whether a file is a photograph or a radiance map."""
    try:
        return bool(files.kind_of(path))
    except UnreadableFile:
        return False


def _memory(tasks: Sequence[FileTask]) -> int | None:
    """Bytes that the largest of a few places takes."""
    most = 0
    for task in tasks[:: max(1, len(tasks) // 16)]:
        try:
            width, height = files.read_facts(task.sources[0]).size
        except RelumeError:  # a radiance map, or what will fail by its name
            continue
        most = max(most, (MEMORY + 24 * len(task.sources)) * width * height)
    return most or None
