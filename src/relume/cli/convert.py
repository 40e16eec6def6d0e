"""`relume convert`: a file in another format, an environment map in another mapping, and audited."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

import relume as rl
from relume.cli.arguments import (
    Clamp,
    ClusterWord,
    DryRun,
    ReadingOptions,
    mapping_of,
    refuse_file_for_folder,
    refuse_input,
    require_files,
    require_suffix,
)
from relume.cli.console import (
    OutputOptions,
    finish,
    finish_each,
    note,
    print_facts,
    spread,
    warnings_as_doubts,
    warnings_as_notes,
)
from relume.cli.option_types import Angles, Box, Size, numbers

MAPPINGS = (
    "latlong, angular, ball, cross, cross-vertical, strip, faces, octahedral, equalarea, hemispheres, "
    "fisheye (:equisolid) (:DEGREES)"
)
HOSTS = "blender, usd, gltf, three, mitsuba, pbrt, arnold, radiance"
FORMAT = Group("The format of the output", sort_key=1)
FLOATS = (".exr", ".tif", ".tiff", ".pfm", ".float", ".float.gz")


@Parameter(name="*")
@dataclass(frozen=True)
class FormatOptions:
    """What the name of the output does not say."""

    half: Annotated[
        bool, Parameter(group=FORMAT, negative="", help="16 bits a value in an .exr; 32 where 16 lose too much.")
    ] = False
    float_: Annotated[
        bool,
        Parameter(
            name="--float",
            group=FORMAT,
            negative="",
            help="Store 32 bits a value, as is done unless another format is asked for.",
        ),
    ] = False
    as_: Annotated[
        Literal["xyze", "logluv32", "logluv24", "logl16", "grey"] | None,
        Parameter(
            name="--as",
            group=FORMAT,
            help="xyze: a .hdr in CIE XYZ. logluv32, logluv24, logl16: a .tif of log luminance. grey: a .pfm of one "
            "channel.",
        ),
    ] = None
    roi: Annotated[Box | None, Parameter(group=FORMAT, help="Keep this rectangle of the input, in pixels.")] = None

    def encoding(self, out: Path) -> rl.files.Encoding | None:
        """How the output is written; None as its name says. Raises ValueError for options that do not fit it."""
        radiance, tiff = (".hdr", ".pic", ".rgbe", ".xyze"), (".tif", ".tiff")
        choices: dict[str, tuple[bool, Callable[[], rl.files.Encoding | None], tuple[str, ...]]] = {
            "--half": (self.half, lambda: rl.files.OpenEXR(half=True), (".exr",)),
            "--float": (self.float_, lambda: None, FLOATS),
            "--as xyze": (self.as_ == "xyze", lambda: rl.files.RadianceHDR(xyz=True), radiance),
            "--as logluv32": (self.as_ == "logluv32", lambda: rl.files.LogLuv(32), tiff),
            "--as logluv24": (self.as_ == "logluv24", lambda: rl.files.LogLuv(24), tiff),
            "--as logl16": (self.as_ == "logl16", lambda: rl.files.LogLuv(16), tiff),
            "--as grey": (self.as_ == "grey", lambda: rl.files.PFM(grey=True), (".pfm",)),
        }
        asked = {option: choice for option, choice in choices.items() if choice[0]}
        if len(asked) > 1:
            raise ValueError(f"{' and '.join(asked)} contradict each other; keep one")
        for option, (_, encoding, fits) in asked.items():
            if rl.files.encodings.suffix_of(out) not in fits:
                raise ValueError(f"{option} is for {', '.join(fits)}; {out.name} is not one")
            return encoding()
        return None


@Parameter(name="*")
@dataclass(frozen=True)
class MapOptions:
    """What becomes of an environment map."""

    from_: Annotated[
        str | None,
        Parameter(name="--from", help=f"Mapping of the input, where the file does not store it: {MAPPINGS}."),
    ] = None
    to: Annotated[str | None, Parameter(help="Mapping to convert to, one of the same; as it is unless given.")] = None
    for_: Annotated[
        str | None,
        Parameter(name="--for", help=f"Lay the map out as a program loads it by default: {HOSTS}. Not with --to."),
    ] = None
    size: Annotated[
        int | None, Parameter(help="Rows of the map; with --to faces of each face; as fine as the input unless given.")
    ] = None
    rotate: Annotated[
        Angles | None,
        Parameter(
            help="Turn the light by YAW[,PITCH[,ROLL]] degrees, about +Y, then +X, then +Z, right-handed: yaw 90 "
            "moves what lies ahead to the left."
        ),
    ] = None
    mirror: Annotated[
        Literal["x", "z"] | None,
        Parameter(
            help="The cube faces, read or written, are for an engine that negates an axis before it looks up: x for "
            "three.js and PlayCanvas, z for Bevy and Stride; not for OpenGL, glTF and Filament."
        ),
    ] = None

    def conversion(self, *, reads_faces: bool) -> rl.light.MapConversion:
        """The same as the library has it; `mirror` may be meant for six faces that are read."""
        cubes = reads_faces, self.to in ("faces", "strip")
        if self.mirror is not None and any(cubes) == all(cubes):
            raise ValueError("--mirror is for six faces that are read, or for --to faces and --to strip; not for both")
        return rl.light.MapConversion(
            mapping=mapping_of("strip" if self.to == "faces" else self.to, "--to") if self.for_ is None else None,
            faces=self.to == "faces",
            size=self.size,
            turn=None if self.rotate is None else radians(self.rotate),
            program=self.for_,
            mirror=None if reads_faces else self.mirror,
        )


@Parameter(name="*")
@dataclass(frozen=True)
class ViewOptions:
    """Perspective pictures, out of a map and into it."""

    view: Annotated[
        Angles | None,
        Parameter(
            help="Crop a perspective picture out of the map, from a camera turned by YAW[,PITCH[,ROLL]] degrees, "
            "to the right, up and clockwise, as panorama's --orientations."
        ),
    ] = None
    field: Annotated[float | None, Parameter(help="Horizontal field of view of --view, degrees; 90 unless given.")] = (
        None
    )
    pixels: Annotated[Size | None, Parameter(help="Size of --view; 1024x1024 unless given.")] = None
    put: Annotated[
        Path | None,
        Parameter(help="Put a perspective picture into the map, where its file says it came from, or at --view."),
    ] = None

    def camera(self) -> rl.light.CameraView | None:
        """The camera of --view."""
        if self.view is None:
            return None
        return rl.light.CameraView(radians(self.view), math.radians(self.field or 90.0))


@Parameter(name="*")
@dataclass(frozen=True)
class PaintingOptions:
    """Brightness, and paintings as maps."""

    gamma: Annotated[
        str | None, Parameter(help="The input is a painting for a display of this gamma: a number like 2.2, or srgb.")
    ] = None
    exposure: Annotated[
        float, Parameter(help="Stops to brighten by; a painting's white is 1 at 0.", allow_leading_hyphen=True)
    ] = 0.0
    hot: Annotated[
        list[tuple[Path, float]] | None,
        numbers(
            "MASK=STOPS", like="sun.png=12", help="Brighten a painting where a picture is white; again for each mask."
        ),
    ] = None


def radians(degrees: tuple[float, float, float]) -> tuple[float, float, float]:
    """Three angles in radians."""
    yaw, pitch, roll = (math.radians(each) for each in degrees)
    return yaw, pitch, roll


PHOTOGRAPHS = (".png", ".tif", ".tiff", ".jpg", ".jpeg")


def convert(
    files_in: Annotated[
        list[Path] | None,
        Parameter(
            name="IN",
            negative="",
            help="A picture in any format; an environment map; six cube faces, +X −X +Y −Y +Z −Z as OpenGL has "
            "them; or, with --gamma, a painting.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The file to write; its ending says the format: .exr, .hdr, .tif, .pfm, .float or .float.gz "
            "for radiance, .png, .tif or .jpg for a photograph. Faces become OUT_px, OUT_nx, ….",
        ),
    ],
    maps: MapOptions = MapOptions(),
    views: ViewOptions = ViewOptions(),
    painting: PaintingOptions = PaintingOptions(),
    labelled: Annotated[
        bool,
        Parameter(negative="", help="Instead of a file: a test map with its axes written on it, to check a program."),
    ] = False,
    clamp: Clamp = False,
    form: FormatOptions = FormatOptions(),
    accepted: ReadingOptions = ReadingOptions(),
    each: Annotated[
        bool,
        Parameter(
            negative="",
            help="Convert every file, and all pictures in folders, to -o FOLDER/name.exr; one that cannot be converted "
            "is named, the others are written, and what is there is kept.",
        ),
    ] = False,
    ending: Annotated[str | None, Parameter(help="Of the files that --each writes, like .hdr; .exr unless given.")] = (
        None
    ),
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Convert pictures between formats and environment maps between mappings; what a file cannot hold is reported.

    With none of the options about light, only the format changes, and pixels that cannot be light are kept too.
    """
    if each:
        chosen = EachOptions(maps, views, painting, clamp, form, accepted, ending or ".exr", labelled)
        _each(files_in or [], out, chosen, cluster, dry_run, output)
        return
    if cluster is not None or ending is not None:
        raise ValueError(
            f"--{'ending' if cluster is None else 'cluster'} is for many files; give --each too, or leave it out"
        )
    with warnings_as_notes(output):
        paths, options = files_in or [], accepted.reading()
        # A change of format alone.
        untouched = maps == MapOptions() and views == ViewOptions() and not (painting.gamma or painting.hot)
        if untouched and not labelled and len(paths) == 1:
            require_suffix(out, *dict.fromkeys([*rl.files.encodings.SUFFIXES, *PHOTOGRAPHS]))
            require_files(paths)
            refuse_input(out, paths)
            change = rl.light.FormatChange(form.encoding(out), form.float_, form.roi, painting.exposure, clamp)
            print_facts(output, rl.light.change_format(paths[0], out, change, options, dry_run=dry_run))
            return

        # Everything about maps that can be refused is refused before any work.
        require_suffix(out, ".exr", ".hdr", ".pic", ".tif", ".tiff")
        if form.roi is not None:
            raise ValueError("--roi is for a change of format alone; crop the picture in a step of its own")
        encoding = form.encoding(out)
        require_files([*paths, *([views.put] if views.put else [])])
        refuse_input(out, paths)
        if bool(paths) == labelled:
            raise ValueError("name a map to convert, or ask for --labelled")
        _refuse_mixtures(maps, views, painting)
        conversion = maps.conversion(reads_faces=len(paths) == 6)
        light = rl.mappings.orientation_chart(512) if labelled else _read(paths, maps, painting, clamp, options)
        if dry_run:
            written = [str(path) for path in conversion.paths(out)]
            print_facts(output, {"would write": written, "from": light.mapping.name})
            return

        # Views out of the map or into it, then the map itself.
        camera = views.camera()
        if camera is not None and views.put is None:
            picture = rl.light.crop_view(light, camera, views.pixels or (1024, 1024))
            rl.write(out, picture, encoding)
            print_facts(output, {"written": str(out), "size": list(picture.size), "unit": picture.unit})
            return
        if views.put is not None:
            light = rl.light.put_view(light, views.put, camera)
        made = rl.light.convert_map(light, out, conversion, encoding)
        note(output, *made.notes)
        print_facts(output, made.facts)
        finish(output, made.doubts)


def _read(
    paths: list[Path], maps: MapOptions, painting: PaintingOptions, clamp: bool, options: rl.files.ReadOptions
) -> rl.EnvironmentMap:
    """The environment map that the files hold: a map, the six faces of a cube, or a painting."""
    reading = _reading(maps, painting, clamp)
    if painting.gamma is not None and len(paths) != 1:
        raise ValueError(f"{len(paths)} paintings; give one, or --each")
    if len(paths) == 6:
        if maps.from_ not in (None, "faces"):
            raise ValueError(f"--from {maps.from_}: six files are the faces of a cube; leave it out, or give one map")
        light = rl.light.read_cube_faces(paths, clamp=clamp, mirror=maps.mirror, options=options)
    elif len(paths) != 1:
        raise ValueError(f"{len(paths)} files; give one map, the six faces +X −X +Y −Y +Z −Z, or --each for many maps")
    elif maps.from_ == "faces":
        raise ValueError("--from faces: give the six files +X −X +Y −Y +Z −Z; one file with all of them is a strip")
    else:
        return reading.read(paths[0], options)
    return rl.light.change_exposure(light, painting.exposure)


def _reading(maps: MapOptions, painting: PaintingOptions, clamp: bool) -> rl.light.MapInFile:
    """How a file is read as a map."""
    mapping = mapping_of("strip" if maps.from_ == "faces" else maps.from_)
    return rl.light.MapInFile(mapping, painting.gamma, painting.exposure, tuple(painting.hot or ()), clamp)


@dataclass(frozen=True)
class EachOptions:
    """What --each does to every file."""

    maps: MapOptions
    views: ViewOptions
    painting: PaintingOptions
    clamp: bool
    form: FormatOptions
    accepted: ReadingOptions
    ending: str
    labelled: bool

    @property
    def untouched(self) -> bool:
        """Whether the format alone changes."""
        maps, views, painting = self.maps, self.views, self.painting
        return maps == MapOptions() and views == ViewOptions() and not (painting.gamma or painting.hot)

    def conversion(self) -> rl.light.FormatChange | rl.light.MapConversion | rl.light.ViewOutOfMap:
        """What becomes of each; raises ValueError for what is of one file alone."""
        if self.labelled:
            raise ValueError("--labelled is one map, and --each converts many; leave it out")
        form, encoding = self.form, self.encoding()
        if self.untouched:
            return rl.light.FormatChange(encoding, form.float_, form.roi, self.painting.exposure, self.clamp)
        if form.roi is not None:
            raise ValueError("--roi is for a change of format alone; crop the pictures in a step of their own")
        if self.maps.from_ == "faces" or self.views.put is not None:
            name = "--from faces" if self.maps.from_ == "faces" else "--put"
            raise ValueError(f"{name} is for one map, and --each converts many; leave it out")
        _refuse_mixtures(self.maps, self.views, self.painting)
        camera = self.views.camera()
        if camera is not None:
            return rl.light.ViewOutOfMap(camera, self.views.pixels or (1024, 1024))
        return self.maps.conversion(reads_faces=False)

    def encoding(self) -> rl.files.Encoding | None:
        """How each is written."""
        return self.form.encoding(Path(f"map{self.ending}"))


def _each(
    paths: list[Path], out: Path, options: EachOptions, cluster: str | None, dry_run: bool, output: OutputOptions
) -> None:
    """Convert every file by itself, or list what would be written."""
    refuse_file_for_folder(out)
    with warnings_as_doubts(output) as doubts:
        conversion = options.conversion()
        words: dict[str, Any] = {"ending": options.ending, "encoding": options.encoding(), "dry_run": dry_run}
        words |= {"options": options.accepted.reading()}
        words |= {"reading": _reading(options.maps, options.painting, options.clamp)}
        with spread(None if dry_run else cluster, output) as (workers, advance):
            made = rl.light.convert_each(paths, out, conversion, **words, cluster=workers, progress=advance)
        finish_each(output, made, out, "files", doubts, dry_run=dry_run)


def _refuse_mixtures(maps: MapOptions, views: ViewOptions, painting: PaintingOptions) -> None:
    """Refuse options that contradict each other or would do nothing."""
    if maps.for_ is not None and maps.to is not None:
        raise ValueError("--for decides the mapping; leave --to out")
    if views.view is not None and views.put is None and (maps.to or maps.for_ or maps.size or maps.rotate):
        raise ValueError(
            "--view writes a perspective picture; leave --to, --for, --rotate and --size out (--pixels is its size)"
        )
    if views.view is None and (views.field is not None or views.pixels is not None):
        raise ValueError("--field and --pixels are for --view; give it too")
    if views.put is not None and views.pixels is not None:
        raise ValueError("--pixels is for a --view that is cropped; with --put leave it out")
    if painting.gamma is None and painting.hot:
        raise ValueError("--hot is for paintings; give --gamma too, like 2.2 or srgb")
