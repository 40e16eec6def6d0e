"""`relume reflect`: an environment map in, reflection maps and prefiltered cubes out, and balls that show them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, MapsOptions, require_files, require_output_folder
from relume.cli.console import (
    OutputOptions,
    finish_each,
    note,
    print_facts,
    progress,
    spread,
    warnings_as_doubts,
    warnings_as_notes,
)

PICTURES = (".png", ".jpg", ".jpeg")


@Parameter(name="*")
@dataclass(frozen=True)
class CubeOptions:
    """Cubes for game engines."""

    cube: Annotated[
        int | None,
        Parameter(
            help="Also write cubes with mips for game engines, this many texels an edge, a power of two: light; "
            "diffuse; specular, GGX of roughness i/(levels − 1) at level i. With --lobe, light and those lobes."
        ),
    ] = None
    cube_format: Annotated[
        Literal["ktx2", "hdr"], Parameter(help="ktx2: one file a cube; hdr: a strip of six faces for each mip level.")
    ] = "ktx2"
    mirror: Annotated[
        Literal["x", "z"] | None,
        Parameter(
            help="Mirror the cubes for an engine that negates an axis before it looks up: x for three.js and "
            "PlayCanvas, z for Bevy and Stride; not for Filament and glTF Sample Viewer."
        ),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class SheetOptions:
    """Balls of every surface under the map."""

    sheet: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            consume_multiple=(0, 1),
            help="Also draw balls of every surface under the map, as sheet.png in the folder or as the .png or .jpg "
            "given. Write it after the map.",
        ),
    ] = None
    exposure: Annotated[
        float | None,
        Parameter(
            help="Stops to brighten the sheet by; at 0 the mean of its Lambert ball is middle grey.",
            allow_leading_hyphen=True,
        ),
    ] = None


def reflect(
    light_map: Annotated[
        Path,
        Parameter(name="MAP", help="The environment map, .exr, .hdr or another format; or a folder of maps of a film."),
    ],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The folder for the tables; diffuse.exr (Lambert), specular.exr (Phong, n = 50) and harmonics.json "
            "unless lobes are named. Of a folder of maps a folder frame_0001 and so on for each picture.",
        ),
    ],
    lobe: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="Tables by direction, again for each: lambert, self-luminous, mirror, phong:N, varnish:N, ggx:ALPHA, "
            "ward:ALPHA.",
        ),
    ] = None,
    brdf: Annotated[
        list[str] | None,
        Parameter(
            negative="", help="Tables by direction and view angle, again for each: ggx:ALPHA, ward:ALPHA, phong:N."
        ),
    ] = None,
    rows: Annotated[
        int | None, Parameter(help="Height of the tables, half their width; as the lobe needs unless given.")
    ] = None,
    normalisation: Annotated[
        Literal["radiometric", "paper", "sum"],
        Parameter(
            help="What sums are divided by. radiometric: constant light stays what it is; paper: 4π, as Miller & "
            "Hoffman print it; sum: nothing, Lambert's table is irradiance."
        ),
    ] = "radiometric",
    cubes: CubeOptions = CubeOptions(),
    sheets: SheetOptions = SheetOptions(),
    maps: MapsOptions = MapsOptions(),
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Convolve an environment map (Miller & Hoffman's illumination map) with what surfaces do to light (1984)."""
    with warnings_as_notes(output):
        # Everything that can be refused is refused before any work.
        if light_map.is_dir():
            if sheets.sheet is not None:
                raise ValueError("--sheet is of one map; leave it out, or name a map")
        else:
            maps.refuse()
            if cluster is not None:
                raise ValueError("--cluster is for the pictures of a film; give a folder of maps, or leave it out")
            require_files([light_map])
        if sheets.exposure is not None and sheets.sheet is None:
            raise ValueError("--exposure is for the sheet; give --sheet too")
        require_output_folder(out)
        _require_sheets(sheets.sheet or [], out)
        # What is asked for.
        chosen = {"tables": rl.light.tables_named(lobe or ())} if lobe or brdf else {}
        wanted = rl.light.ReflectionFiles(
            **chosen,
            glossy=rl.light.glossy_named(brdf or ()),
            rows=rows,
            normalisation=rl.light.Normalisation(normalisation),
            cube=cubes.cube,
            roughness_cubes=not lobe,
            cube_format=cubes.cube_format,
            mirror=cubes.mirror,
        )
        if light_map.is_dir():
            _each(maps.sequence(light_map), out, wanted, cluster, dry_run, output)
            return
        picture = None if sheets.sheet is None else next(iter(sheets.sheet), out / "sheet.png")
        drawn = [] if picture is None else [picture]
        light = rl.read_environment(light_map)
        if dry_run:
            paths = [str(path) for path in (*wanted.paths(out), *drawn)]
            print_facts(output, {"would write": paths, "normalisation": normalisation})
            return

        # The maps, their balls and what came of them.
        with progress(output) as report:
            made = rl.light.write_reflection_maps(light, out, wanted, report)
            if picture is not None:
                rl.report.draw_reflection_sheet(
                    picture, light, light_map.name, sheets.exposure or 0.0, lambda share: report("sheet", share)
                )
        note(output, *made.notes)
        facts = {
            "written": [str(path) for path in (*made.paths, *drawn)],
            "normalisation": normalisation,
            "error bound": made.error_bounds,
            "unit": light.unit,
        }
        print_facts(output, facts | rl.light.reflection_facts(light))


def _each(
    lights: rl.light.LightSequence, out: Path, wanted: rl.light.ReflectionFiles, cluster: str | None, dry_run: bool,
    output: OutputOptions,
) -> None:  # fmt: skip
    """The maps of every picture of a film."""
    with warnings_as_doubts(output) as doubts, spread(None if dry_run else cluster, output) as (workers, advance):
        made = rl.light.reflect_each(lights, out, wanted, dry_run=dry_run, cluster=workers, progress=advance)
    finish_each(output, made, out, "pictures", doubts, dry_run=dry_run, accept=True)


def _require_sheets(sheets: list[Path], out: Path) -> None:
    """Refuse a sheet that cannot be written; the folder `out` is made."""
    for path in sheets:
        if path.suffix.lower() not in PICTURES:
            raise ValueError(f"--sheet {path}: the file must end in {' or '.join(PICTURES)}")
        if path.parent.resolve() != out.resolve() and not path.parent.is_dir():
            raise rl.errors.OutputNotWritten(f"--sheet {path}: no folder {path.parent}; make it first")
