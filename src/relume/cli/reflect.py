"""`relume reflect`: an illumination map in, reflection maps out, and what they look like on balls."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, made_folder, require_files
from relume.cli.console import OutputOptions, note, print_facts, progress, warnings_as_notes
from relume.errors import OutputNotWritten

if TYPE_CHECKING:
    import numpy as np

    from relume.light.reflection.brdf import Reflectance
    from relume.light.reflection.lobes import Lobe
    from relume.sphere.environment_map import EnvironmentMap
    from relume.sphere.mip_cube import Cube

LOBES = "lambert, self-luminous, mirror, phong:N, varnish:N, ggx:ALPHA, ward:ALPHA"
BRDFS = "ggx:ALPHA, ward:ALPHA, phong:N"
MOST_ROWS, MOST_GLOSSY_ROWS, LARGEST_CUBE = 8192, 1024, 4096
"""Beyond them the tables take more memory than machines have."""
DIFFUSE_CUBE = 32
"""Texels of the diffuse cube, at most: the 36 rows of D hold no more."""
Kind = TypeVar("Kind")
PICTURES = (".png", ".jpg", ".jpeg")


def reflect(
    light_map: Annotated[Path, Parameter(name="MAP", help="The illumination map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The folder for the tables; diffuse.exr (Lambert), specular.exr (Phong, n = 50) and harmonics.json "
            "unless lobes are named.",
        ),
    ],
    lobe: Annotated[
        list[str] | None, Parameter(negative="", help=f"Tables by direction, again for each: {LOBES}.")
    ] = None,
    brdf: Annotated[
        list[str] | None, Parameter(negative="", help=f"Tables by direction and view angle, again for each: {BRDFS}.")
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
    cube: Annotated[
        int | None,
        Parameter(
            help="Also write cubes with mips for game engines, this many texels an edge, a power of two: light; "
            "diffuse; specular, GGX of roughness i/(levels − 1) at level i. With --lobe, light and those lobes."
        ),
    ] = None,
    cube_format: Annotated[
        Literal["ktx2", "hdr"], Parameter(help="ktx2: one file a cube; hdr: a strip of six faces for each mip level.")
    ] = "ktx2",
    mirror: Annotated[
        Literal["x", "z"] | None,
        Parameter(
            help="Mirror the cubes for an engine that negates an axis before it looks up: x for three.js and "
            "PlayCanvas, z for Bevy and Stride; not for Filament and glTF Sample Viewer."
        ),
    ] = None,
    sheet: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            consume_multiple=(0, 1),
            help="Also draw balls of every surface under the map, as sheet.png in the folder or as the .png or .jpg "
            "given. Write it after the map.",
        ),
    ] = None,
    exposure: Annotated[
        float | None,
        Parameter(
            help="Stops to brighten the sheet by; at 0 the mean of its Lambert ball is middle grey.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Convolve an illumination map with what surfaces do to light: the reflection maps of Miller & Hoffman (1984)."""
    import numpy as np

    from relume.image import files
    from relume.light.reflection.glossy import glossy_map
    from relume.light.reflection.irradiance_harmonics import as_json, irradiance_harmonics
    from relume.light.reflection.lobes import Lambert
    from relume.light.reflection.reflection_map import Normalisation, reflection_map
    from relume.light.reflection.storage import as_layers, as_picture

    with warnings_as_notes(output):
        require_files([light_map])
        _check(out, rows, cube, mirror, normalisation, sheet, exposure, bool(brdf))
        tables, glossy = _tables(lobe or [], bool(brdf)), {f"glossy_{_name(w)}": _brdf(w) for w in brdf or []}
        picture = None if sheet is None else (sheet[0] if sheet else out / "sheet.png")
        light, divided = rl.read_environment(light_map), Normalisation(normalisation)
        written = [out / f"{name}.exr" for name in (*tables, *glossy)] + [out / "harmonics.json"]
        if dry_run:
            written += [] if cube is None else _cube_paths(out, _cube_names(lobe, tables), cube, cube_format)
            written += [] if picture is None else [picture]
            print_facts(output, {"would write": [str(path) for path in written], "normalisation": normalisation})
            return
        if glossy and divided is not Normalisation.RADIOMETRIC:
            note(output, "--normalisation is for --lobe; three-dimensional maps hold radiance, light in and light out")
        made_folder(out)
        bounds = {}
        with progress(output) as report:
            for index, (name, each) in enumerate(tables.items()):
                table = reflection_map(light, each, rows, divided)
                files.write(out / f"{name}.exr", as_picture(table))
                bounds[name] = table.error_bound
                report("tables", (index + 1) / len(tables))
            for index, (name, each) in enumerate(glossy.items()):
                layers, attributes = as_layers(glossy_map(light, each, rows))
                files.write_layers(out / f"{name}.exr", layers, unit=light.unit, attributes=attributes)
                report("views", (index + 1) / len(glossy))
            files.write_text(out / "harmonics.json", as_json(irradiance_harmonics(light), light.unit))
            if cube is not None:
                names = _cube_names(lobe, tables)
                for index, (name, levels) in enumerate(_cubes(light, tables if lobe else None, rows, cube)):
                    written += _write_cube(out / f"{name}.{cube_format}", levels, mirror)
                    report("cubes", (index + 1) / len(names))
            if picture is not None:
                _draw(picture, light, light_map.name, exposure or 0.0, lambda share: report("sheet", share))
                written.append(picture)
        diffuse = reflection_map(light, Lambert())
        print_facts(
            output,
            {
                "written": [str(path) for path in written],
                "normalisation": normalisation,
                "error bound": bounds,
                "unit": light.unit,
                "mean of D, radiometric": _rounded(diffuse.light.total() / (4 * np.pi)),
                "irradiance from above": _rounded(light.irradiance(np.array([0.0, 1.0, 0.0]))),
            },
        )


def _check(
    out: Path,
    rows: int | None,
    cube: int | None,
    mirror: str | None,
    normalisation: str,
    sheet: list[Path] | None,
    exposure: float | None,
    glossy: bool,
) -> None:
    """Refuse what cannot be, before any work."""
    least, most = (2, MOST_GLOSSY_ROWS) if glossy else (1, MOST_ROWS)
    if rows is not None and not least <= rows <= most:
        raise ValueError(f"--rows is {rows}; give {least} to {most}, like 36 for Lambert")
    if cube is not None and (cube < 1 or cube & (cube - 1) or cube > LARGEST_CUBE):
        raise ValueError(f"--cube is {cube}; give a power of two up to {LARGEST_CUBE}, like 256")
    if cube is not None and normalisation != "radiometric":
        raise ValueError(f"--cube with --normalisation {normalisation}: engines expect radiance; leave one of them out")
    if mirror is not None and cube is None:
        raise ValueError("--mirror is for cubes; give --cube SIZE too")
    if exposure is not None and sheet is None:
        raise ValueError("--exposure is for the sheet; give --sheet too")
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: a file, not a folder; choose another name")
    for path in sheet or ():
        if path.suffix.lower() not in PICTURES:
            raise ValueError(f"--sheet {path}: the file must end in {' or '.join(PICTURES)}")
        if path.parent.resolve() != out.resolve() and not path.parent.is_dir():
            raise OutputNotWritten(f"--sheet {path}: no folder {path.parent}; make it first or choose another")


def _tables(words: list[str], others: bool) -> dict[str, Lobe]:
    """File names and lobes; the paper's two where nothing is named."""
    from relume.light.reflection.lobes import Lambert, Phong

    if not words:
        return {} if others else {"diffuse": Lambert(), "specular": Phong()}
    lobes = {}
    for word in words:
        kind = "diffuse" if word in ("lambert", "self-luminous") else "specular"
        lobes[f"{kind}_{_name(word)}"] = _lobe(word)
    return lobes


def _lobe(word: str) -> Lobe:
    from relume.light.reflection import lobes

    def varnished(n: float) -> Lobe:
        return lobes.Phong(n, varnish=lobes.VARNISH)

    plain = {each.name: each for each in (lobes.Lambert(), lobes.SelfLuminous(), lobes.Mirror())}
    if word in plain:
        return plain[word]
    numbered = {"phong": lobes.Phong, "varnish": varnished, "ggx": lobes.GGXLobe, "ward": lobes.WardLobe}
    return _numbered("--lobe", word, numbered, LOBES)


def _brdf(word: str) -> Reflectance:
    from relume.light.reflection.brdf import GGX, PhongReflectance, Ward

    return _numbered("--brdf", word, {"ggx": GGX, "ward": Ward, "phong": PhongReflectance}, BRDFS)


def _numbered(option: str, word: str, kinds: dict[str, Callable[[float], Kind]], known: str) -> Kind:
    """What a word like "phong:50" names; raises ValueError telling the known ones."""
    name, _, text = word.partition(":")
    if name not in kinds:
        raise ValueError(f'{option}: "{word}" is not known; choose of {known}')
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f'{option}: "{word}" needs a number after "{name}:", as in {known}') from None
    try:
        return kinds[name](number)
    except ValueError as error:
        raise ValueError(f"{option} {word}: {error}") from None


def _name(word: str) -> str:
    """A word as a part of a file's name: phong:50 is phong_50."""
    name, colon, text = word.partition(":")
    try:
        text = f"{float(text):.12g}" if colon else ""
    except ValueError:
        pass  # the word is refused where it is read
    return name.replace("-", "_") + (f"_{text}" if colon else "")


def _cube_names(words: list[str] | None, tables: dict[str, Lobe]) -> list[str]:
    return ["light", *tables] if words else ["light", "diffuse", "specular"]


def _cube_paths(out: Path, names: list[str], size: int, suffix: str) -> list[Path]:
    """What `_write_cube` will write."""
    if suffix == "ktx2":
        return [out / f"{name}.ktx2" for name in names]
    sizes = {name: min(size, DIFFUSE_CUBE) if name == "diffuse" else size for name in names}
    return [out / f"{name}_{level}.hdr" for name in names for level in range(sizes[name].bit_length())]


def _cubes(
    light: EnvironmentMap, lobes: dict[str, Lobe] | None, rows: int | None, size: int
) -> Iterator[tuple[str, tuple[Cube, ...]]]:
    """Names and levels of the cubes, each made when it is asked for."""
    from relume.light.reflection.lobes import Lambert
    from relume.light.reflection.reflection_map import reflection_map
    from relume.light.reflection.roughness_levels import roughness_levels
    from relume.sphere.mip_cube import cube_of, mips

    yield "light", mips(cube_of(light, size))
    if lobes is None:
        diffuse = reflection_map(light, Lambert(), rows)
        yield "diffuse", mips(cube_of(diffuse.light, min(size, DIFFUSE_CUBE)))
        yield "specular", roughness_levels(light, size)
    else:
        for name, lobe in lobes.items():
            yield name, mips(cube_of(reflection_map(light, lobe, rows).light, size))


def _write_cube(path: Path, levels: tuple[Cube, ...], mirror: str | None) -> list[Path]:
    from relume.image.files import ktx2

    faces = [(level if mirror is None else level.mirrored(mirror)).faces for level in levels]
    if path.suffix == ".hdr":
        return ktx2.write_cube_hdr(path, faces, unit=levels[0].unit)
    ktx2.write_cube(path, faces)
    return [path]


def _draw(path: Path, light: EnvironmentMap, name: str, stops: float, report: Callable[[float], None]) -> None:
    from relume.image import files
    from relume.renderers.prefiltered.contact_sheet import balls
    from relume.virtual_camera.tone.display.contact_sheet import contact_sheet, exposed_for

    made = balls(light, progress=report)
    lambert = next(ball for ball in made if ball.caption == "Lambert")
    files.write(path, contact_sheet(made, light, exposed_for(lambert).brighter(stops), name))


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
