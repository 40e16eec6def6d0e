"""`relume convert`: light in one mapping in, the same light in another out, and what the step did to its energy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_files, require_suffix
from relume.cli.console import Manner, note, speaking, tell
from relume.cli.light_input import Clamp, read_light, read_picture
from relume.errors import DoubtfulResult, UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.sphere.illumination import IlluminationMap
    from relume.sphere.mappings import Mapping

MAPPINGS = (
    "latlong, angular, ball, cross, cross-vertical, strip, faces, octahedral, equalarea, hemispheres, "
    "fisheye (:equisolid) (:DEGREES)"
)
HOSTS = "blender, usd, gltf, three, mitsuba, pbrt, arnold, radiance"
CUBES = ("cross", "cross-vertical", "strip")
FACE_WORDS = ("px", "nx", "py", "ny", "pz", "nz")
LARGEST = 16384
"""Rows of a map, at most: beyond them it takes more memory than machines have."""


def convert(
    files_in: Annotated[
        list[Path],
        Parameter(
            name="IN",
            negative="",
            help="The light: a map, .exr or .hdr; six cube faces, +X −X +Y −Y +Z −Z as OpenGL has them; or, with "
            "--gamma, a painting.",
        ),
    ],
    /,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="The map to write, .exr or .hdr; faces become OUT_px, OUT_nx, and so on.")
    ],
    from_: Annotated[
        str | None,
        Parameter(name="--from", help=f"Mapping of the input, where the file does not remember it: {MAPPINGS}."),
    ] = None,
    to: Annotated[str | None, Parameter(help="Mapping to convert to, one of the same; as it is unless given.")] = None,
    size: Annotated[
        int | None, Parameter(help="Rows of the map; with --to faces of each face; as fine as the input unless given.")
    ] = None,
    rotate: Annotated[
        str | None,
        Parameter(
            help="Turn the light by YAW[,PITCH[,ROLL]] degrees, about +Y, then +X, then +Z, right-handed: yaw 90 "
            "moves what lies ahead to the left.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    for_: Annotated[
        str | None,
        Parameter(name="--for", help=f"Lay the map out as a program loads it by default: {HOSTS}. Not with --to."),
    ] = None,
    mirror: Annotated[
        Literal["x", "z"] | None,
        Parameter(
            help="The cube faces, read or written, are for an engine that negates an axis before it looks up: x for "
            "three.js and PlayCanvas, z for Bevy and Stride; not for OpenGL, glTF and Filament."
        ),
    ] = None,
    view: Annotated[
        str | None,
        Parameter(
            help="Crop a perspective picture out of the map, from a camera turned by YAW[,PITCH[,ROLL]] degrees, "
            "to the right, up and clockwise, as panorama's --orientations.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    field: Annotated[
        float | None, Parameter(help="Horizontal field of view of --view, degrees; 90 unless given.")
    ] = None,
    pixels: Annotated[str | None, Parameter(help="Size of --view, as WIDTHxHEIGHT; 1024x1024 unless given.")] = None,
    put: Annotated[
        Path | None,
        Parameter(help="Put a perspective picture into the map, where it remembers to be cropped from, or at --view."),
    ] = None,
    gamma: Annotated[
        str | None, Parameter(help="The input is a painting for a display of this gamma: a number like 2.2, or srgb.")
    ] = None,
    exposure: Annotated[
        float, Parameter(help="Stops to brighten a painting by; at 0 its white is 1.", allow_leading_hyphen=True)
    ] = 0.0,
    hot: Annotated[
        list[str] | None,
        Parameter(negative="", help="MASK=STOPS: brighten a painting where a picture is white; again for each mask."),
    ] = None,
    clamp: Clamp = False,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Convert light between mappings, turn it, or lay it out for another program; its energy is kept, and audited."""
    from relume.image import files
    from relume.sphere.audit import audit, losses
    from relume.sphere.cube import mirrored_strip
    from relume.sphere.illumination import as_radiance_map

    with speaking(manner):
        require_suffix(out, ".exr", ".hdr")
        require_files([*files_in, *([put] if put else [])])
        _refuse_mixtures(to, for_, view, put, size, rotate, field, pixels, gamma, hot, exposure)
        target = None if to is None else _mapping(to, "--to")
        turn = None if rotate is None else _turn(rotate)
        seen_from = None if view is None else _camera(view)
        if size is not None and not 1 <= size <= LARGEST:
            raise ValueError(f"--size is {size}; give 1 to {LARGEST} rows, like 512")
        cubes = len(files_in) == 6, to in ("faces", "strip")
        if mirror is not None and any(cubes) == all(cubes):
            raise ValueError("--mirror is for six faces that are read, or for --to faces and --to strip; not for both")
        light = _input(files_in, from_, gamma, exposure, hot or [], clamp, mirror if cubes[0] else None)
        if dry_run:
            tell(manner, {"would write": [str(path) for path in _outputs(out, to)], "from": light.mapping.name})
            return
        if view is not None and put is None:
            picture = _cropped(light, seen_from, field or 90.0, pixels or "1024x1024")
            files.write(out, picture)
            tell(manner, {"written": str(out), "size": list(picture.size), "unit": picture.unit})
            return
        if put is not None:
            light = _filled_in(light, put, seen_from, field or 90.0)
        before = audit(light, turn)
        result, orientation = light, None
        if for_ is not None:
            result, orientation = _laid_out(light if turn is None else light.rotated(turn), for_, size)
        elif target is not None or size is not None or turn is not None:
            mapping = target or light.mapping
            result = light.remapped(mapping, size or _fine_enough(light, mapping), turn)
        mirrored = mirror is not None and not cubes[0]
        written = as_radiance_map(mirrored_strip(result, str(mirror)) if mirrored else result)
        if mirrored:
            written.attributes["mirror"] = str(mirror)
        if orientation is not None:
            written.attributes["orientation"] = orientation
        paths = _write(out, to, written)
        after = audit(_read_back(paths, to))
        told = losses(before, after)
        shown = float(result.mapping.solid_angles(result.size).sum())
        whole = shown > 4 * math.pi * 0.999
        if not whole:
            note(manner, f"a {result.mapping.name} map shows {shown:.3g} of the sphere's 12.6 sr; the rest is left out")
        for line in told:
            note(manner, line)
        tell(
            manner,
            {
                "written": [str(path) for path in paths],
                "mapping": result.mapping.name,
                "size": [written.size[0], written.size[1]],
                "unit": result.unit,
                "before": before.facts(),
                "after": after.facts(),
            },
        )
        if told and whole:
            raise DoubtfulResult(f"{out}: written, but not all of the light is in it: {told[0]}")


def _refuse_mixtures(
    to: str | None,
    for_: str | None,
    view: str | None,
    put: Path | None,
    size: int | None,
    rotate: str | None,
    field: float | None,
    pixels: str | None,
    gamma: str | None,
    hot: list[str] | None,
    exposure: float,
) -> None:
    """Refuse options that contradict each other or would do nothing."""
    if for_ is not None and to is not None:
        raise ValueError("--for decides the mapping; leave --to out")
    if view is not None and put is None and (to or for_ or size or rotate):
        raise ValueError(
            "--view writes a perspective picture; leave --to, --for, --rotate and --size out (--pixels is its size)"
        )
    if view is None and (field is not None or pixels is not None):
        raise ValueError("--field and --pixels are for --view; give it too")
    if put is not None and pixels is not None:
        raise ValueError("--pixels is for a --view that is cropped; with --put leave it out")
    if gamma is None and (hot or exposure):
        raise ValueError("--hot and --exposure are for paintings; give --gamma too, like 2.2 or srgb")


def _mapping(text: str, option: str) -> Mapping:
    from relume.sphere.mappings import mapping_named

    try:
        return mapping_named("strip" if text == "faces" else text)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None


def _angles(text: str, option: str) -> np.ndarray:
    """Three angles of "YAW[,PITCH[,ROLL]]" in degrees, as radians."""
    import numpy as np

    try:
        angles = [float(word) for word in text.replace(",", " ").split()]
        if not 1 <= len(angles) <= 3 or not np.all(np.isfinite(angles)):
            raise ValueError
    except ValueError:
        raise ValueError(f'{option}: "{text}" is no turn; write YAW, YAW,PITCH or YAW,PITCH,ROLL in degrees') from None
    return np.radians([*angles, 0.0, 0.0][:3])


def _turn(text: str) -> np.ndarray:
    """The rotation of light: roll about +Z first, pitch about +X, then yaw about +Y, right-handed."""
    import numpy as np

    from relume.sphere.directions import rotation_about

    yaw, pitch, roll = _angles(text, "--rotate")
    x, y, z = np.eye(3)
    return rotation_about(y, yaw) @ rotation_about(x, pitch) @ rotation_about(z, roll)


def _camera(text: str) -> np.ndarray:
    """The rotation of a camera: yaw to the right, pitch up, roll clockwise."""
    from relume.probe.panorama_views import orientation

    return orientation(*_angles(text, "--view"))


def _input(
    paths: list[Path],
    from_: str | None,
    gamma: str | None,
    exposure: float,
    hot: list[str],
    clamp: bool,
    mirror: str | None,
) -> IlluminationMap:
    """The light that the files hold."""
    from relume.image.files.signatures import kind_of

    told = None if from_ is None else _mapping(from_, "--from")
    if gamma is not None:
        if len(paths) != 1:
            raise ValueError(f"{len(paths)} paintings; give one")
        return _painted(paths[0], gamma, exposure, hot, told)
    if len(paths) == 6:
        if from_ not in (None, "faces"):
            raise ValueError(f"--from {from_}: six files are the faces of a cube; leave it out, or give one map")
        return _of_faces(paths, clamp, mirror)
    if len(paths) != 1:
        raise ValueError(f"{len(paths)} files; give one map, or the six faces +X −X +Y −Y +Z −Z")
    if from_ == "faces":
        raise ValueError("--from faces: give the six files +X −X +Y −Y +Z −Z; one file with all of them is a strip")
    if kind_of(paths[0]) in ("JPEG", "PNG", "TIFF"):
        raise UnreadableFile(
            f"{paths[0]}: a photograph or painting, whose values are no light yet; merge a bracket, or say for which "
            "display it was painted, like --gamma 2.2 or --gamma srgb"
        )
    return read_light(paths[0], told, clamp=clamp)


def _painted(path: Path, gamma: str, exposure: float, hot: list[str], mapping: Mapping | None) -> IlluminationMap:
    from relume.image import files
    from relume.probe.painting import HotSpot, paint, read_gamma
    from relume.sphere.mappings import LatLong

    spots = []
    for text in hot:
        name, _, stops = text.rpartition("=")
        try:
            spots.append(HotSpot.of_picture(files.read_photograph(name), stops=float(stops)))
        except ValueError as error:
            raise ValueError(f'--hot "{text}": {error}; write MASK=STOPS, like sun.png=10') from None
    painting = files.read_photograph(path)
    return paint(painting, read_gamma(gamma, str(path)), 2.0**exposure, spots, mapping=mapping or LatLong())


def _of_faces(paths: list[Path], clamp: bool, mirror: str | None) -> IlluminationMap:
    """Six files as one strip; `mirror` where they do not remember for which engine they are."""
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.sphere.illumination import as_illumination

    pictures = [read_picture(path, clamp=clamp) for path in paths]
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
    attributes = {**({"mirror": mirror} if mirror else {}), **first.attributes, "mapping": "strip"}
    return as_illumination(RadianceMap(radiance, None, clipped, first.unit, attributes))


def _fine_enough(light: IlluminationMap, mapping: Mapping) -> int:
    """Rows as fine as the light's, rounded up: to a power of two a cube's face, else to a multiple of 64."""
    import math

    from relume.sphere.matching import matching_size

    rows = matching_size(light, mapping)
    if mapping == light.mapping:
        return rows
    faces = getattr(mapping, "grid", (1, 1))[0] if mapping.name in CUBES else 0
    rounded = faces * 2 ** math.ceil(math.log2(rows / faces)) if faces else 64 * math.ceil(rows / 64)
    return min(rounded, LARGEST // max(faces, 1) * max(faces, 1))


def _laid_out(light: IlluminationMap, host: str, size: int | None) -> tuple[IlluminationMap, str]:
    from relume.sphere.orientation import orientation_named, oriented

    orientation = orientation_named(host)
    rows = size or _fine_enough(light, orientation.mapping)
    return oriented(light, orientation, rows), orientation.name


def _cropped(light: IlluminationMap, rotation: np.ndarray | None, field: float, pixels: str) -> RadianceMap:
    import numpy as np

    from relume.sphere.perspective import perspective_view

    try:
        width, height = (int(word) for word in pixels.lower().split("x"))
    except ValueError:
        raise ValueError(f'--pixels: "{pixels}" is no size; write WIDTHxHEIGHT, like 1920x1080') from None
    assert rotation is not None
    return perspective_view(light, rotation, float(np.radians(field)), (width, height))


def _filled_in(light: IlluminationMap, path: Path, rotation: np.ndarray | None, field: float) -> IlluminationMap:
    """The map with a perspective picture put into it."""
    import numpy as np

    from relume.image import files
    from relume.sphere.perspective import with_view

    picture = files.read_radiance(path)
    angle = float(np.radians(field))
    if rotation is None:
        try:
            rotation = np.array([float(word) for word in picture.attributes["view-rotation"].split()]).reshape(3, 3)
            angle = float(np.radians(float(picture.attributes["view-field"])))
        except (KeyError, ValueError):
            raise ValueError(
                f"--put {path}: the file does not remember where it was cropped from; give --view too"
            ) from None
    return with_view(light, picture, rotation, angle)


def _outputs(out: Path, to: str | None) -> list[Path]:
    """The files to write."""
    return [out.with_stem(f"{out.stem}_{word}") for word in FACE_WORDS] if to == "faces" else [out]


def _write(out: Path, to: str | None, picture: RadianceMap) -> list[Path]:
    import numpy as np

    from relume.image import files
    from relume.image.radiance import RadianceMap

    paths = _outputs(out, to)
    if len(paths) == 1:
        files.write(out, picture)
        return paths
    clipped = [None] * 6 if picture.clipped is None else np.split(picture.clipped, 6, axis=1)
    for path, radiance, marks in zip(paths, np.split(picture.radiance, 6, axis=1), clipped, strict=True):
        face = {**picture.attributes, "face": path.stem.rpartition("_")[2]}
        del face["mapping"]
        files.write(path, RadianceMap(np.ascontiguousarray(radiance), None, marks, picture.unit, face))
    return paths


def _read_back(paths: list[Path], to: str | None) -> IlluminationMap:
    """What was written, as any reader will find it, but in our frame."""
    return _of_faces(paths, False, None) if to == "faces" else read_light(paths[0])
