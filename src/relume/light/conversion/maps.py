"""An environment map in another mapping, size, turn or program's layout, written to files and audited."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import files
from relume.image.files.encodings import Encoding
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import RadianceMap
from relume.light.conversion.file_formats import exposed
from relume.probe.painting import HotSpot, environment_from_painting, read_gamma
from relume.probe.panorama.views import orientation
from relume.sphere.environment_files import as_environment, as_radiance_map, read_environment, read_light_pixels
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.mappings.orientation import orient_for, orientation_named, rotation_from_angles
from relume.sphere.mappings.perspective import insert_view, perspective_view
from relume.sphere.mip_cube import mirrored_strip

FACE_WORDS = ("px", "nx", "py", "ny", "pz", "nz")
LARGEST = 16384
"""Rows of a map, at most: beyond them it takes more memory than machines have."""
_CUBES = ("cross", "cross-vertical", "strip")
Turn = tuple[float, float, float]


@dataclass(frozen=True)
class MapConversion:
    """What becomes of an environment map.

    mapping : to convert to; its own unless given
    faces : write the six faces of a cube as files of their own, px, nx, py, ny, pz, nz
    size : rows of the map, or of each face; as fine as the map unless given
    turn : yaw, pitch, roll of the light in radians: roll about +Z first, pitch about +X, then yaw about +Y
    program : lay the map out as this program loads it by default, instead of `mapping`
    mirror : "x" or "z", for an engine that negates that axis before it looks up cube faces

    Raises ValueError for what contradicts itself.
    """

    mapping: Mapping | None = None
    faces: bool = False
    size: int | None = None
    turn: Turn | None = None
    program: str | None = None
    mirror: Literal["x", "z"] | None = None

    def __post_init__(self) -> None:
        if self.program is not None and (self.mapping is not None or self.faces):
            raise ValueError(f"the layout for {self.program} decides the mapping; leave the mapping out")
        if self.size is not None and not 1 <= self.size <= LARGEST:
            raise ValueError(f"size is {self.size}; give 1 to {LARGEST} rows, like 512")
        if self.program is not None:
            orientation_named(self.program)

    def paths(self, out: Path) -> list[Path]:
        """The files to write, for the name `out`: one, or of faces six."""
        return [out.with_stem(f"{out.stem}_{word}") for word in FACE_WORDS] if self.faces else [out]


@dataclass(frozen=True)
class ConvertedMap:
    """What was written.

    facts : for a person or a machine: files, mapping, size, unit, and the energy before and after
    notes : what the user should know
    doubts : light that was lost although the mapping shows the whole sphere
    """

    facts: dict[str, object]
    notes: tuple[str, ...]
    doubts: tuple[str, ...]


def convert_map(
    light: EnvironmentMap, out: str | os.PathLike[str], conversion: MapConversion, encoding: Encoding | None = None
) -> ConvertedMap:
    """Convert an environment map, write it, read it back, and compare its energy before and after.

    light : the map, in any mapping
    out : the file, whose suffix says the format; of faces, what their names begin with
    conversion : mapping, turn, size, program
    encoding : what the suffix leaves open
    Raises ValueError for what does not go together, OutputNotWritten.
    """
    out = Path(out)
    rotation = None if conversion.turn is None else rotation_from_angles(*conversion.turn)
    before = light.audit(rotation)

    # Convert.
    attributes = {}
    if conversion.program is not None:
        program = orientation_named(conversion.program)
        turned = light if rotation is None else light.rotated(rotation)
        result = orient_for(turned, program, conversion.size or _fine_enough(light, program.mapping))
        attributes["orientation"] = program.name
    elif conversion.mapping is not None or conversion.faces or conversion.size is not None or rotation is not None:
        mapping = Strip() if conversion.faces else conversion.mapping or light.mapping
        result = light.remapped(mapping, conversion.size or _fine_enough(light, mapping), rotation)
    else:
        result = light
    if conversion.mirror is not None:
        attributes["mirror"] = conversion.mirror
        written = as_radiance_map(mirrored_strip(result, conversion.mirror))
    else:
        written = as_radiance_map(result)
    written = replace(written, attributes={**written.attributes, **attributes})

    # Write, and compare what was written with what was there.
    paths = conversion.paths(out)
    _write(paths, written, encoding)
    after = (read_cube_faces(paths) if conversion.faces else read_environment(paths[0])).audit()
    losses = before.losses(after)
    # What a map of a part of the sphere leaves out is meant to be lost.
    shown = float(result.mapping.solid_angles(result.size).sum())
    whole = shown > 4 * math.pi * 0.999
    part = f"a {result.mapping.name} map shows {shown:.3g} of the sphere's 12.6 sr; the rest is left out"
    notes = () if whole else (part, *losses)
    facts = {
        "written": [str(path) for path in paths],
        "mapping": result.mapping.name,
        "size": list(written.size),
        "unit": result.unit,
        "before": before.facts(),
        "after": after.facts(),
    }
    return ConvertedMap(facts, notes, losses if whole else ())


def _fine_enough(light: EnvironmentMap, mapping: Mapping) -> int:
    """Rows as fine as the light's, rounded up: to a power of two a cube's face, else to a multiple of 64."""
    rows = light.matching_size(mapping)
    if mapping == light.mapping:
        return rows
    faces = getattr(mapping, "grid", (1, 1))[0] if mapping.name in _CUBES else 0
    rounded = faces * 2 ** math.ceil(math.log2(rows / faces)) if faces else 64 * math.ceil(rows / 64)
    return min(rounded, LARGEST // max(faces, 1) * max(faces, 1))


def _write(paths: list[Path], picture: RadianceMap, encoding: Encoding | None) -> None:
    if len(paths) == 1:
        files.write(paths[0], picture, encoding)
        return
    clipped = [None] * 6 if picture.clipped is None else np.split(picture.clipped, 6, axis=1)
    for path, radiance, marks in zip(paths, np.split(picture.radiance, 6, axis=1), clipped, strict=True):
        face = {**picture.attributes, "face": path.stem.rpartition("_")[2]}
        del face["mapping"]
        files.write(path, RadianceMap(np.ascontiguousarray(radiance), None, marks, picture.unit, face), encoding)


# What is read.


def read_cube_faces(
    paths: Sequence[str | os.PathLike[str]],
    *,
    clamp: bool = False,
    mirror: str | None = None,
    options: ReadOptions = ReadOptions(),
) -> EnvironmentMap:
    """Six files, +X −X +Y −Y +Z −Z, as one strip of cube faces.

    paths : six, in that order
    mirror : "x" or "z" for files of an engine that negates that axis before it looks a cube up; as the files store it
        unless given, and against what they store where it is
    clamp, options : as `read_environment`

    Warns where the ends of their names say another order. Raises UnreadableFile for files that are not six squares of
    one size and unit.
    """
    paths = [Path(path) for path in paths]
    _warn_of_order(paths)
    pictures = [read_light_pixels(path, clamp=clamp, options=options) for path in paths]
    first, side = pictures[0], pictures[0].size[1]
    for path, picture in zip(paths, pictures, strict=True):
        if picture.size != (side, side) or picture.unit != first.unit:
            width, height = picture.size
            raise UnreadableFile(
                f"{path}: {width}×{height} pixels, {picture.unit}; the faces of a cube are six squares of one size and "
                f"unit, here {side}×{side}, {first.unit}"
            )
        if picture.attributes.get("mirror") != first.attributes.get("mirror"):
            raise UnreadableFile(f"{path}: mirrored for another engine than {paths[0]}; give six faces of one cube")
    clipped = None
    if any(picture.clipped is not None for picture in pictures):
        empty = np.zeros((side, side), np.uint8)
        clipped = np.concatenate([empty if p.clipped is None else p.clipped for p in pictures], axis=1)
    radiance = np.concatenate([picture.radiance for picture in pictures], axis=1)
    attributes = {**first.attributes, **({"mirror": mirror} if mirror else {}), "mapping": "strip"}
    return as_environment(RadianceMap(radiance, None, clipped, first.unit, attributes))


def _warn_of_order(paths: list[Path]) -> None:
    """A shell gives faces by the alphabet: nx, ny, nz, px, py, pz."""
    ends = [re.search(r"(?:^|[^a-z])([np][xyz])$", path.stem.lower()) for path in paths]
    named = [end[1] for end in ends if end]
    if sorted(named) == sorted(FACE_WORDS) and named != list(FACE_WORDS):
        warn(
            f"{paths[0]}: the faces' names end in {' '.join(named)}, but they are taken as {' '.join(FACE_WORDS)}: "
            "give them in that order"
        )


def read_painting(
    path: str | os.PathLike[str],
    gamma: str,
    stops: float = 0.0,
    hot: Sequence[tuple[str | os.PathLike[str], float]] = (),
    mapping: Mapping | None = None,
) -> EnvironmentMap:
    """A painting in a file as an environment map.

    path : PNG, TIFF or JPEG
    gamma : of the display it was painted for, a number or "srgb"
    stops : to brighten by; white is 1 at 0
    hot : masks, and the stops by which the painting is brightened where each is white
    mapping : lat-long unless given
    Raises ValueError for a mask that cannot be used, UnreadableFile.
    """
    path = Path(path)
    spots = []
    for mask, brighter in hot:
        try:
            spots.append(HotSpot.of_picture(files.read_photograph(mask), stops=brighter))
        except ValueError as error:
            raise ValueError(f"{mask}={brighter:g}: {error}; write MASK=STOPS, like sun.png=10") from None
    painting = files.read_photograph(path)
    decoding = read_gamma(gamma, str(path))
    return environment_from_painting(painting, decoding, 2.0**stops, spots, mapping=mapping or LatLong())


def change_exposure(light: EnvironmentMap, stops: float) -> EnvironmentMap:
    """The map brightened; what was calibrated no longer is, and a warning says so.

    light : in any mapping
    stops : above 0 is brighter
    """
    if not stops:
        return light
    picture = exposed(as_radiance_map(light), stops)
    return replace(light, radiance=picture.radiance, unit=picture.unit)


# Perspective views.


@dataclass(frozen=True)
class CameraView:
    """A perspective camera in the middle of a map.

    turn : yaw to the right, pitch up, roll clockwise, radians
    field : horizontal field of view, radians
    """

    turn: Turn
    field: float = math.pi / 2


def crop_view(light: EnvironmentMap, view: CameraView, size: tuple[int, int] = (1024, 1024)) -> RadianceMap:
    """The picture of `size` = (width, height) that the camera takes of the map.

    light : the map
    view : where the camera looks, and its field of view
    """
    return perspective_view(light, orientation(*view.turn), view.field, size)


def put_view(light: EnvironmentMap, path: str | os.PathLike[str], view: CameraView | None = None) -> EnvironmentMap:
    """The map with a perspective picture put in.

    light : in any mapping
    path : of the picture
    view : of its camera; as the file stores it unless given
    Raises ValueError where the file does not store where it was cropped from, UnreadableFile.
    """
    path = Path(path)
    picture = files.read_radiance(path)
    if view is not None:
        return insert_view(light, picture, orientation(*view.turn), view.field)
    try:
        rotation = np.array([float(word) for word in picture.attributes["view-rotation"].split()]).reshape(3, 3)
        field = float(np.radians(float(picture.attributes["view-field"])))
    except (KeyError, ValueError):
        raise ValueError(f"{path}: the file does not store where it was cropped from; give --view too") from None
    return insert_view(light, picture, rotation, field)
