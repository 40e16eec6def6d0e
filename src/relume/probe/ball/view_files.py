"""Files of the views of a ball: which photographs make each view, and the radiance they hold."""

from __future__ import annotations

import glob
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, read_bracket, require_known_exposures
from relume.capture.exposure.exposures import exposed
from relume.capture.exposure.folder import name_order, pictures_in
from relume.capture.exposure.named_times import seconds_in_names
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import Doubt, UnreadableFile
from relume.image import files
from relume.image.files.formats import read_photographs
from relume.image.files.signatures import MAPS, kind_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.ball.crops import on_one_frame
from relume.probe.ball.silhouette import Outline
from relume.probe.clipped_light import in_the_colour_beside, linear
from relume.sphere.directions import rotation_about

Point = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class BallPhotographs:
    """The files of one view of the ball.

    paths : photographs or camera raws of one bracket, one photograph, or one radiance map
    camera : where it stood, metres from the ball's centre, Y up; None where that is unknown
    outline : of the ball, picked by hand, in the first where their sizes differ; None to have it found
    """

    paths: tuple[Path, ...]
    camera: Point | None = None
    outline: Outline | None = None

    @property
    def name(self) -> str:
        """The files' names, short."""
        return self.paths[0].name if len(self.paths) == 1 else f"{self.paths[0].name} … {self.paths[-1].name}"


@dataclass(frozen=True, eq=False)
class ViewPicture:
    """One view's radiance, before the ball is found.

    focal_length : pixels; None where it is unknown
    exposed : whether its brightness is on a scale that other views share
    """

    picture: RadianceMap
    focal_length: float | None
    name: str
    exposed: bool = True


@dataclass(frozen=True, eq=False)
class ViewPictures:
    """The radiance of every view, and what to doubt of it."""

    pictures: tuple[ViewPicture, ...]
    doubts: tuple[Doubt, ...]


def find_ball_photographs(paths: Sequence[Path | str]) -> list[BallPhotographs]:
    """Every folder is a view and every radiance map is one; the other photographs together make one more.

    paths : a text that is no path is a pattern like "left/*.jpg", whose files are sorted alike
    Raises UnreadableFile for what is not there, and for a folder without pictures.
    """
    views: list[BallPhotographs] = []
    loose: list[Path] = []
    for path in paths:
        if isinstance(path, str) and not Path(path).exists():
            found = sorted(map(Path, glob.glob(path)), key=name_order)
            if not found:
                raise UnreadableFile(f"{path}: no such file or folder, and no file fits it as a pattern")
            views += find_ball_photographs(found)
            continue
        path = Path(path)
        if path.is_dir():
            views.append(BallPhotographs(_in_folder(path)))
        elif not path.is_file():
            raise UnreadableFile(f"{path}: no such file; check the path")
        elif kind_of(path) in MAPS:
            views.append(BallPhotographs((path,)))
        else:
            if not loose:
                views.append(BallPhotographs(()))
            loose.append(path)
    return [view if view.paths else replace(view, paths=tuple(loose)) for view in views]


def _in_folder(folder: Path) -> tuple[Path, ...]:
    pictures = tuple(pictures_in(folder))
    maps = [p for p in sorted(folder.iterdir(), key=name_order) if p.suffix.lower() in (".exr", ".hdr") and p.is_file()]
    if pictures and maps:
        raise UnreadableFile(f"{folder}: holds photographs and radiance maps; name the ones that are meant")
    if len(maps) > 1:
        raise UnreadableFile(f"{folder}: holds {len(maps)} radiance maps, and a view is one; name it")
    if not pictures and not maps:
        raise UnreadableFile(
            f"{folder}: no photograph is in this folder; name the photographs of a view, or its folder"
        )
    return pictures or tuple(maps)


def placed_views(views: Sequence[BallPhotographs], camera: Point, turns: Sequence[float]) -> list[BallPhotographs]:
    """The views with their cameras placed: `camera` turned about the vertical by each of `turns`, radians.

    Raises ValueError for another number of turns than of views.
    """
    if len(turns) != len(views):
        raise ValueError(f"{len(turns)} angles for {len(views)} views; give one for each, 0 for the first")
    result = []
    for view, turn in zip(views, turns, strict=True):
        x, y, z = (rotation_about((0, 1, 0), turn) @ np.array(camera)).tolist()
        result.append(replace(view, camera=(x, y, z)))
    return result


def read_view_pictures(
    views: Sequence[BallPhotographs],
    *,
    times: Sequence[float] | None = None,
    times_from_names: bool = False,
    profile: CameraProfile | None = None,
    settings: MergeSettings = MergeSettings(),
    progress: Callable[[str], None] = lambda step: None,
) -> ViewPictures:
    """The radiance of every view; brackets of one camera are merged together and share one scale.

    times : seconds of all photographs that are no radiance maps, in their order
    times_from_names : read them from the names instead, view by view
    progress : called with the name of each step as it begins
    Raises UnreadableFile, NotABracket, BallNotFound.
    """
    if times_from_names:
        if times is not None:
            raise ValueError("times are given and are to be read from the names too; choose one of the two")
        pictures = [view.paths for view in views if kind_of(view.paths[0]) not in MAPS]
        times = [seconds for paths in pictures for seconds in seconds_in_names(paths)]
    progress("read")
    seconds = None if times is None else list(times)
    notes: list[Doubt] = []
    brackets: dict[int, Bracket | tuple[Path, ...]] = {}
    raw_times: list[float] = []
    found: dict[int, ViewPicture] = {}

    # Maps and single photographs are radiance already, or nearly; brackets are merged below.
    for index, view in enumerate(views):
        kind = kind_of(view.paths[0])
        given = None if seconds is None or kind in MAPS else [seconds.pop(0) for _ in view.paths if seconds]
        if kind == "RAW":
            brackets[index] = view.paths
            raw_times += given or []
        elif kind in MAPS:
            found[index] = ViewPicture(files.read_radiance(view.paths[0]), None, view.paths[0].name)
        elif len(view.paths) == 1:
            found[index] = _single(files.read_photograph(view.paths[0]), given, profile, view.paths[0].name)
            if profile is None:
                line = (
                    f"{view.name}: one photograph, assumed to be sRGB; give --profile for its camera's curve, or a "
                    "bracket"
                )
                # Cameras' tone curves lift the middle by half a stop or more, of which a reflectance takes a part.
                notes.append(Doubt(line, 0.2))
        else:
            brackets[index] = _bracket(view, given, notes)
    # Their exposures must lie on one scale.
    read = [bracket for bracket in brackets.values() if isinstance(bracket, Bracket)]
    if len(views) > 1:
        require_known_exposures(read)
    if raw_times and read:
        raise ValueError("times: give them for camera raws or for photographs, not for both at once")

    # Brackets, together.
    if brackets:
        merged = merge_brackets(
            list(brackets.values()), profile=profile, times=raw_times or None, settings=settings, progress=progress
        )
        notes += merged.doubts
        for index, bracket in zip(brackets, merged.brackets, strict=True):
            picture, count = in_the_colour_beside(bracket.picture)
            if count:
                line = (
                    f"{bracket.name}: {count} pixels are saturated in some channels only; those were lowered to the "
                    "colour of what is beside them, and are lower bounds still"
                )
                notes.append(Doubt(line))
            found[index] = ViewPicture(picture, bracket.focal_length, bracket.name)
    return ViewPictures(tuple(found[index] for index in range(len(views))), tuple(notes))


def _single(
    photograph: Photograph, times: Sequence[float] | None, profile: CameraProfile | None, name: str
) -> ViewPicture:
    if times:
        photograph = exposed([photograph], times=times)[0]
    picture = linear(photograph, None if profile is None else profile.response)
    return ViewPicture(picture, photograph.focal_length, name, photograph.exposure is not None)


def _bracket(view: BallPhotographs, times: list[float] | None, notes: list[Doubt]) -> Bracket:
    sizes = {files.read_facts(path).size for path in view.paths}
    if len(sizes) == 1:
        return read_bracket(view.paths, times=times)
    line = f"{view.name}: {len(sizes)} sizes, so they are taken for crops and laid on one another by the ball"
    notes.append(Doubt(line))
    photographs = exposed(read_photographs(view.paths), times=times)
    return Bracket(on_one_frame(photographs, view.outline))
