"""Files of the views of a panorama: their radiance, and where each view looked as far as that is known."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, read_bracket, require_known_exposures
from relume.capture.exposure.folder import pictures_in
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import NotAPanorama, UnreadableFile, warn
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.primaries import inside_gamut
from relume.image.radiance import RadianceMap
from relume.probe.clipped_light import linear
from relume.probe.panorama.views import FACES, PanoramaView, focal_length_of, orientation
from relume.sphere.directions import required_rotation

COLUMNS = ("name", "yaw", "pitch", "roll", "field")
CUBE_FIELD = 90.0
"""Degrees across the face of a cube."""


@dataclass(frozen=True, eq=False)
class Source:
    """A picture of a panorama before its lens and its orientation are known.

    picture : the radiance map
    focal_length : pixels, where the file holds it
    name : the file or folder
    assumed : whether the picture is a single photograph whose encoding was assumed to be sRGB
    """

    picture: RadianceMap
    focal_length: float | None
    name: str
    assumed: bool = False


@dataclass(frozen=True)
class KnownOrientation:
    """Where a view looked: yaw to the right, pitch up and roll clockwise, and its field across; degrees."""

    yaw: float
    pitch: float = 0.0
    roll: float = 0.0
    field: float | None = None


@dataclass(frozen=True, eq=False)
class Crop:
    """How a picture was cropped out of an environment map.

    focal_length : pixels
    rotation : (3, 3) world-from-camera; None where only the field of view is stored
    """

    focal_length: float
    rotation: np.ndarray | None


def read_sources(
    paths: Sequence[Path], *, profile: CameraProfile | None = None, settings: MergeSettings = MergeSettings()
) -> list[Source]:
    """Read the views of a panorama: each path is one.

    paths : a radiance map, a photograph, or a folder with the bracket of one view, encoded or raw
    profile : of the camera; recovered from the brackets unless given, and sRGB assumed for single photographs
    settings : of the merge

    Brackets of one camera share one response, so that their maps share one scale. Raises UnreadableFile, NotABracket.
    """
    # The brackets in folders, merged together.
    folders = [path for path in paths if path.is_dir()]
    brackets: list[Bracket | list[Path]] = []
    for folder in folders:
        group = pictures_in(folder)
        if not group:
            raise UnreadableFile(f"{folder}: no photograph is in this folder; name the folder of one view's bracket")
        brackets.append(group if kind_of(group[0]) == "RAW" else read_bracket(group))
    if len(brackets) > 1:
        require_known_exposures(bracket for bracket in brackets if isinstance(bracket, Bracket))
    of_folders: dict[Path, Source] = {}
    if folders:
        merged = merge_brackets(brackets, profile=profile, settings=settings)
        for folder, bracket in zip(folders, merged.brackets, strict=True):
            of_folders[folder] = Source(_as_light(bracket.picture), bracket.focal_length, folder.name)
    # Radiance maps and single photographs.
    response = None if profile is None else profile.response
    sources = []
    for path in paths:
        if path in of_folders:
            sources.append(of_folders[path])
            continue
        image = files.read(path)
        if isinstance(image, RadianceMap):
            sources.append(Source(image, None, path.name))
        else:
            sources.append(Source(_as_light(linear(image, response)), image.focal_length, path.name, response is None))
    return sources


def _as_light(picture: RadianceMap) -> RadianceMap:
    """A map of photographs without negative channels, which colours of wider primaries have."""
    return replace(picture, radiance=inside_gamut(picture.radiance))


def stored_crop(picture: RadianceMap, name: str = "view") -> Crop | None:
    """How `perspective_view` cropped the picture, from its attributes; None where they hold nothing.

    Warns of attributes that cannot be right, and does not use them.
    """
    attributes = picture.attributes
    if "view-field" not in attributes:
        return None
    try:
        focal_length = focal_length_of(float(np.radians(float(attributes["view-field"]))), picture.size[0])
        rotation = None
        if "view-rotation" in attributes:
            numbers = [float(word) for word in attributes["view-rotation"].split()]
            rotation = required_rotation(np.array(numbers).reshape(3, 3))
    except ValueError as error:
        warn(f"{name}: its attributes hold an impossible view ({error}); they are not used")
        return None
    return Crop(focal_length, rotation)


def known_orientations(
    paths: Sequence[str | os.PathLike[str]],
    *,
    faces: Sequence[str] = (),
    turn: float | None = None,
    table: str | os.PathLike[str] | None = None,
) -> dict[Path, KnownOrientation]:
    """The orientation of every view that one of the three gives.

    paths : of the views, in order
    faces : names of a cube's faces, one for each view: front, right, back, left, up, down
    turn : degrees to the right from each view to the next
    table : .csv with the columns name, yaw, pitch, roll and field, degrees; it need not name all views
    Raises ValueError for two of them, or for other faces; UnreadableFile for a table that cannot be right.
    """
    paths = [Path(path) for path in paths]
    table = None if table is None else Path(table)
    values = {"faces": faces or None, "turn": turn, "orientations": table}
    given = [name for name, value in values.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{given[0]} and {given[1]} both give the orientation; give one")
    if faces:
        for name in faces:
            if name not in FACES:
                raise ValueError(f'faces: "{name}" is not a face; there are {", ".join(FACES)}')
        if len(set(faces)) < len(faces) or len(faces) != len(paths):
            raise ValueError(f"{len(faces)} faces for {len(paths)} views; name each once, in their order")
        return {path: KnownOrientation(*FACES[name]) for path, name in zip(paths, faces, strict=True)}
    if turn is not None:
        return {path: KnownOrientation(index * turn) for index, path in enumerate(paths)}
    return {} if table is None else _of_table(paths, table)


def _of_table(paths: Sequence[Path], table: Path) -> dict[Path, KnownOrientation]:
    try:
        with table.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UnreadableFile(f"{table}: no table could be read ({error}); give a .csv") from None
    found: dict[str, KnownOrientation] = {}
    for number, row in enumerate(rows, start=2):
        words = {
            (key or "").strip().lower(): (value or "").strip() for key, value in row.items() if isinstance(key, str)
        }
        if "name" not in words or "yaw" not in words:
            raise UnreadableFile(f"{table}: the first line must name the columns {', '.join(COLUMNS[:4])}")
        try:
            yaw, pitch, roll = (float(words.get(key) or 0) for key in ("yaw", "pitch", "roll"))
            across = float(words["field"]) if words.get("field") else None
        except ValueError:
            yaw, pitch, roll, across = math.nan, 0.0, 0.0, None
        if not all(map(math.isfinite, (yaw, pitch, roll))):
            raise UnreadableFile(f"{table}: line {number} holds something that is not a number of degrees")
        found[words["name"]] = KnownOrientation(yaw, pitch, roll, across)
    known = {path: found.pop(path.name) for path in paths if path.name in found}
    if found:
        raise UnreadableFile(f"{table}: {', '.join(found)} is no view that was given; names are those of the files")
    if not known:
        raise UnreadableFile(f"{table}: names no view")
    return known


def oriented_view(
    source: Source,
    known: KnownOrientation | None,
    crop: Crop | None,
    *,
    field: float | None = None,
    assumed_field: float | None = None,
) -> PanoramaView:
    """The view with its lens and, where it is known, its rotation.

    crop : how it was cropped out of a map; its rotation counts where `known` is None
    field : across, degrees, instead of what the file holds
    assumed_field : where neither the file nor a crop holds one
    Raises NotAPanorama where no field is known.
    """
    across = field if known is None or known.field is None else known.field
    if across is None and crop is None:
        across = assumed_field
    if across is not None:
        focal_length = focal_length_of(math.radians(across), source.picture.size[0])
    elif crop is not None:
        focal_length = crop.focal_length
    elif source.focal_length is not None:
        focal_length = source.focal_length
    else:
        raise NotAPanorama(f"{source.name}: no focal length in the file; give the field of view across with --field")
    rotation = None if crop is None else crop.rotation
    if known is not None:
        rotation = orientation(*(math.radians(angle) for angle in (known.yaw, known.pitch, known.roll)))
    return PanoramaView(source.picture, focal_length, rotation, source.name)
