"""`relume convert`: a file in one format in, in another out; light in one mapping in, in another out, and audited."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, read_angles, read_rotation, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes
from relume.cli.convert_format import FormatOptions, change_format, exposed
from relume.cli.convert_input import read_faces, read_input, read_mapping
from relume.cli.light_input import Clamp
from relume.cli.reading_options import ReadingOptions
from relume.errors import DoubtfulResult

if TYPE_CHECKING:
    import numpy as np

    from relume.image.files import Encoding
    from relume.image.radiance import RadianceMap
    from relume.sphere.environment_map import EnvironmentMap
    from relume.sphere.mappings.mapping import Mapping

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
        list[Path] | None,
        Parameter(
            name="IN",
            negative="",
            help="A picture in any format; a light map; six cube faces, +X −X +Y −Y +Z −Z as OpenGL has them; or, "
            "with --gamma, a painting.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The file to write; its ending tells the format: .exr, .hdr, .tif, .pfm, .float or .float.gz "
            "for radiance, .png, .tif or .jpg for a photograph. Faces become OUT_px, OUT_nx, ….",
        ),
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
        float, Parameter(help="Stops to brighten by; a painting's white is 1 at 0.", allow_leading_hyphen=True)
    ] = 0.0,
    hot: Annotated[
        list[str] | None,
        Parameter(negative="", help="MASK=STOPS: brighten a painting where a picture is white; again for each mask."),
    ] = None,
    labelled: Annotated[
        bool,
        Parameter(negative="", help="Instead of a file: a test map with its axes written on it, to check a program."),
    ] = False,
    clamp: Clamp = False,
    form: FormatOptions = FormatOptions(),
    accepted: ReadingOptions = ReadingOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Convert pictures between formats and light between mappings; what a file loses by it is told, and light audited.

    With none of the options about light, only the format changes, and pixels that are no light are kept too.
    """
    from relume.image import files
    from relume.sphere.environment_files import as_radiance_map
    from relume.sphere.mappings.orientation_chart import orientation_chart
    from relume.sphere.mip_cube import mirrored_strip

    with warnings_as_notes(output):
        paths_in = files_in or []
        flat = (to, for_, from_, view, put, gamma, hot, size, rotate, mirror, field, pixels) == (None,) * 12
        if flat and not labelled and len(paths_in) == 1:
            facts = change_format(
                paths_in[0], out, form, accepted.reading(), stops=exposure, clamp=clamp, dry_run=dry_run
            )
            print_facts(output, facts)
            return
        require_suffix(out, ".exr", ".hdr", ".pic", ".tif", ".tiff")
        if form.roi is not None:
            raise ValueError("--roi is for a change of format alone; crop the picture in a step of its own")
        encoding, reading = form.encoding(out), accepted.reading()
        require_files([*paths_in, *([put] if put else [])])
        refuse_input(out, paths_in)
        if bool(paths_in) == labelled:
            raise ValueError("name a map to convert, or ask for --labelled")
        _refuse_mixtures(to, for_, view, put, size, rotate, field, pixels, gamma, hot)
        target = None if to is None else read_mapping(to, "--to")
        turn = None if rotate is None else read_rotation(rotate, "--rotate")
        seen_from = None if view is None else _camera(view)
        if size is not None and not 1 <= size <= LARGEST:
            raise ValueError(f"--size is {size}; give 1 to {LARGEST} rows, like 512")
        cubes = len(paths_in) == 6, to in ("faces", "strip")
        if mirror is not None and any(cubes) == all(cubes):
            raise ValueError("--mirror is for six faces that are read, or for --to faces and --to strip; not for both")
        if labelled:
            light = orientation_chart(512)
        else:
            light = read_input(
                paths_in, from_, gamma, exposure, hot or [], clamp, mirror if cubes[0] else None, reading
            )
        if gamma is None:
            brighter = exposed(as_radiance_map(light), exposure)
            light = replace(light, radiance=brighter.radiance, unit=brighter.unit)
        if dry_run:
            print_facts(output, {"would write": [str(path) for path in _outputs(out, to)], "from": light.mapping.name})
            return
        if view is not None and put is None:
            picture = _cropped(light, seen_from, field or 90.0, pixels or "1024x1024")
            files.write(out, picture, encoding)
            print_facts(output, {"written": str(out), "size": list(picture.size), "unit": picture.unit})
            return
        if put is not None:
            light = _filled_in(light, put, seen_from, field or 90.0)
        before = light.audit(turn)
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
        paths = _write(out, to, written, encoding)
        after = _read_back(paths, to).audit()
        told = before.losses(after)
        shown = float(result.mapping.solid_angles(result.size).sum())
        whole = shown > 4 * math.pi * 0.999
        if not whole:
            note(output, f"a {result.mapping.name} map shows {shown:.3g} of the sphere's 12.6 sr; the rest is left out")
        for line in told:
            note(output, line)
        print_facts(
            output,
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
    if gamma is None and hot:
        raise ValueError("--hot is for paintings; give --gamma too, like 2.2 or srgb")


def _camera(text: str) -> np.ndarray:
    """The rotation of a camera: yaw to the right, pitch up, roll clockwise."""
    from relume.probe.panorama.views import orientation

    return orientation(*read_angles(text, "--view"))


def _fine_enough(light: EnvironmentMap, mapping: Mapping) -> int:
    """Rows as fine as the light's, rounded up: to a power of two a cube's face, else to a multiple of 64."""
    import math

    rows = light.matching_size(mapping)
    if mapping == light.mapping:
        return rows
    faces = getattr(mapping, "grid", (1, 1))[0] if mapping.name in CUBES else 0
    rounded = faces * 2 ** math.ceil(math.log2(rows / faces)) if faces else 64 * math.ceil(rows / 64)
    return min(rounded, LARGEST // max(faces, 1) * max(faces, 1))


def _laid_out(light: EnvironmentMap, host: str, size: int | None) -> tuple[EnvironmentMap, str]:
    from relume.sphere.mappings.orientation import orient_for, orientation_named

    orientation = orientation_named(host)
    rows = size or _fine_enough(light, orientation.mapping)
    return orient_for(light, orientation, rows), orientation.name


def _cropped(light: EnvironmentMap, rotation: np.ndarray | None, field: float, pixels: str) -> RadianceMap:
    import numpy as np

    from relume.sphere.mappings.perspective import perspective_view

    try:
        width, height = (int(word) for word in pixels.lower().split("x"))
    except ValueError:
        raise ValueError(f'--pixels: "{pixels}" is no size; write WIDTHxHEIGHT, like 1920x1080') from None
    assert rotation is not None
    return perspective_view(light, rotation, float(np.radians(field)), (width, height))


def _filled_in(light: EnvironmentMap, path: Path, rotation: np.ndarray | None, field: float) -> EnvironmentMap:
    """The map with a perspective picture put into it."""
    import numpy as np

    from relume.image import files
    from relume.sphere.mappings.perspective import insert_view

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
    return insert_view(light, picture, rotation, angle)


def _outputs(out: Path, to: str | None) -> list[Path]:
    """The files to write."""
    return [out.with_stem(f"{out.stem}_{word}") for word in FACE_WORDS] if to == "faces" else [out]


def _write(out: Path, to: str | None, picture: RadianceMap, encoding: Encoding | None) -> list[Path]:
    import numpy as np

    from relume.image import files
    from relume.image.radiance import RadianceMap

    paths = _outputs(out, to)
    if len(paths) == 1:
        files.write(out, picture, encoding)
        return paths
    clipped = [None] * 6 if picture.clipped is None else np.split(picture.clipped, 6, axis=1)
    for path, radiance, marks in zip(paths, np.split(picture.radiance, 6, axis=1), clipped, strict=True):
        face = {**picture.attributes, "face": path.stem.rpartition("_")[2]}
        del face["mapping"]
        files.write(path, RadianceMap(np.ascontiguousarray(radiance), None, marks, picture.unit, face), encoding)
    return paths


def _read_back(paths: list[Path], to: str | None) -> EnvironmentMap:
    """What was written, as any reader will find it, but in our frame."""
    return read_faces(paths, False, None) if to == "faces" else rl.read_environment(paths[0])
