"""The views of `relume probe`: which files make each, and the radiance they hold."""

from __future__ import annotations

import glob
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import merge_brackets
from relume.capture.exposure.bracket import Bracket, read_bracket, require_told
from relume.capture.exposure.exposures import exposed
from relume.capture.exposure.folder import name_order, pictures_in
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.signatures import MAPS, kind_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.probe.ball.crops import on_one_frame
from relume.probe.ball.saturation import in_the_colour_beside
from relume.probe.single_photograph import linear

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Group:
    """The files of one view.

    paths : photographs of one bracket, one photograph, or one radiance map
    camera : where it stood, metres from the ball's centre; None where that is not told
    """

    paths: tuple[Path, ...]
    camera: Point | None = None


@dataclass(frozen=True, eq=False)
class ViewPicture:
    """One view's radiance, before the ball is sought.

    focal_length : pixels; None where nothing tells it
    exposed : whether its brightness is on a scale that other views share
    """

    picture: RadianceMap
    focal_length: float | None
    name: str
    exposed: bool = True


def grouped(paths: Sequence[Path]) -> list[Group]:
    """Every folder is a view and every radiance map is one; the other photographs together make one more.

    Raises UnreadableFile for what is not there, and for a folder without pictures.
    """
    groups, loose = [], []
    for path in paths:
        if path.is_dir():
            groups.append(Group(_in_folder(path)))
        elif not path.is_file():
            raise UnreadableFile(f"{path}: no such file; check the path")
        elif kind_of(path) in MAPS:
            groups.append(Group((path,)))
        else:
            if not loose:
                groups.append(Group(()))
            loose.append(path)
    return [group if group.paths else Group(tuple(loose)) for group in groups]


def from_pattern(word: str) -> list[Group]:
    """The view or views that a folder, a file or a pattern like "left/*.jpg" names; raises UnreadableFile for none."""
    found = [Path(word)] if Path(word).exists() else sorted(map(Path, glob.glob(word)), key=name_order)
    if not found:
        raise UnreadableFile(f"--view {word}: no such file or folder, and no file fits it as a pattern")
    return grouped(found)


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


def read_pictures(
    groups: Sequence[Group],
    *,
    times: list[float] | None,
    profile: CameraProfile | None,
    told: Callable[[str], None],
    doubted: Callable[[str], None],
) -> list[ViewPicture]:
    """The radiance of every view; brackets of one camera are measured together and share one scale.

    times : seconds of all photographs of brackets, in their order
    told, doubted : called with a line for what a photographer should know, and for what makes the light doubtful
    Raises UnreadableFile, NotABracket, BallNotFound.
    """
    seconds = None if times is None else list(times)
    brackets: dict[int, Bracket] = {}
    found: dict[int, ViewPicture] = {}
    for index, group in enumerate(groups):
        first = files.read(group.paths[0])
        if isinstance(first, RadianceMap):
            found[index] = ViewPicture(first, None, group.paths[0].name)
        elif len(group.paths) == 1:
            found[index] = _lone(first, seconds, profile, group.paths[0].name, told)
        else:
            given = None if seconds is None else [seconds.pop(0) for _ in group.paths if seconds]
            brackets[index] = _bracket(group.paths, given, told)
    if len(groups) > 1:
        require_told(brackets.values())
    if brackets:
        merged = merge_brackets(list(brackets.values()), profile=profile)
        for line in merged.notes:
            told(line)
        for line in merged.warnings:
            doubted(line)
        for index, bracket in zip(brackets, merged.brackets, strict=True):
            picture, count = in_the_colour_beside(bracket.picture)
            if count:
                told(
                    f"{bracket.name}: {count} pixels are saturated in some channels only; those were lowered to the "
                    "colour of what is beside them, and are lower bounds still"
                )
            found[index] = ViewPicture(picture, bracket.focal_length, bracket.name)
    return [found[index] for index in range(len(groups))]


def _lone(
    photograph: Photograph,
    seconds: list[float] | None,
    profile: CameraProfile | None,
    name: str,
    told: Callable[[str], None],
) -> ViewPicture:
    if seconds:
        photograph = exposed([photograph], times=[seconds.pop(0)])[0]
    response = None if profile is None else profile.response
    picture = linear(photograph, response)
    if response is None:
        told(f"{name}: one photograph, taken for sRGB; give --profile for its camera's curve, or a bracket")
    return ViewPicture(picture, photograph.focal_length, name, photograph.exposure is not None)


def _bracket(paths: Sequence[Path], times: list[float] | None, told: Callable[[str], None]) -> Bracket:
    sizes = {files.read_facts(path).size for path in paths}
    if len(sizes) == 1:
        return read_bracket(paths, times=times)
    told(
        f"{paths[0].name} … {paths[-1].name}: {len(sizes)} sizes, so they are taken for crops and laid on one another "
        "by the ball"
    )
    photographs = exposed([files.read_photograph(path) for path in paths], times=times)
    return Bracket(on_one_frame(photographs))


def quietly_read(read: Callable[[], list[ViewPicture]], told: Callable[[str], None]) -> list[ViewPicture]:
    """What `read` gives, its warnings told a line each."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        pictures = read()
    for line in dict.fromkeys(str(w.message) for w in caught):
        told(line)
    return pictures


def placed(groups: Sequence[Group], camera: Point, turns: Sequence[float]) -> list[Group]:
    """The groups with their cameras placed: `camera` turned about the vertical by each of `turns`, radians."""
    from relume.sphere.directions import rotation_about

    result = []
    for group, turn in zip(groups, turns, strict=True):
        x, y, z = (rotation_about((0, 1, 0), turn) @ np.array(camera)).tolist()
        result.append(replace(group, camera=(x, y, z)))
    return result
