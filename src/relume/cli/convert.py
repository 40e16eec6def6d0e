"""`relume convert`: a file in another format, an environment map in another mapping, and audited."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, warnings_as_notes
from relume.cli.convert_options import FormatOptions, MapOptions, PaintingOptions, ViewOptions
from relume.cli.light_input import Clamp, mapping_of
from relume.cli.reading_options import ReadingOptions

PHOTOGRAPHS = (".png", ".tif", ".tiff", ".jpg", ".jpeg")


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
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Convert pictures between formats and environment maps between mappings; what a file cannot hold is reported.

    With none of the options about light, only the format changes, and pixels that cannot be light are kept too.
    """
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
        for line in made.notes:
            note(output, line)
        print_facts(output, made.facts)
        finish(output, made.doubts)


def _read(
    paths: list[Path], maps: MapOptions, painting: PaintingOptions, clamp: bool, options: rl.files.ReadOptions
) -> rl.EnvironmentMap:
    """The environment map that the files hold: a map, the six faces of a cube, or a painting."""
    mapping = mapping_of("strip" if maps.from_ == "faces" else maps.from_)
    if painting.gamma is not None:
        if len(paths) != 1:
            raise ValueError(f"{len(paths)} paintings; give one")
        return rl.light.read_painting(paths[0], painting.gamma, painting.exposure, painting.hot or (), mapping)
    if len(paths) == 6:
        if maps.from_ not in (None, "faces"):
            raise ValueError(f"--from {maps.from_}: six files are the faces of a cube; leave it out, or give one map")
        light = rl.light.read_cube_faces(paths, clamp=clamp, mirror=maps.mirror, options=options)
    elif len(paths) != 1:
        raise ValueError(f"{len(paths)} files; give one map, or the six faces +X −X +Y −Y +Z −Z")
    elif maps.from_ == "faces":
        raise ValueError("--from faces: give the six files +X −X +Y −Y +Z −Z; one file with all of them is a strip")
    else:
        rl.light.require_radiance(paths[0])
        light = rl.read_environment(paths[0], mapping, clamp=clamp, options=options)
    return rl.light.brightened(light, painting.exposure)


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
