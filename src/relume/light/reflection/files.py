"""Reflection maps as files: tables by direction, by view angle, harmonics, and prefiltered cubes for game engines.

`write_reflection_maps` is what `relume reflect` does.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from relume.image import files
from relume.image.files.atomic import made_folder
from relume.image.files.textures import ktx2
from relume.light.harmonics.spherical_harmonics import project_sh
from relume.light.reflection.brdf import Reflectance
from relume.light.reflection.glossy import glossy_map
from relume.light.reflection.lobes import GGXLobe, Lambert, Lobe, Phong
from relume.light.reflection.reflection_map import Normalisation, reflection_map, rows_for
from relume.light.reflection.storage import as_json, as_layers, as_picture
from relume.sphere.audit import six_digits
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mip_cube import faces_of, mips, mirrored_strip

MOST_ROWS, MOST_GLOSSY_ROWS, LARGEST_CUBE = 8192, 1024, 4096
"""Beyond them the tables take more memory than machines have."""
DIFFUSE_CUBE = 32
"""Texels of the diffuse cube, at most: the 36 rows of D hold no more."""
_ROWS_A_TEXEL = 4
"""Rows of the lobe's table for each texel of a roughness level, twice as fine as the texels."""
_FEWEST_ROWS = 64


@dataclass(frozen=True)
class ReflectionFiles:
    """Which reflection maps are written.

    tables : file names without suffix, and the lobes of their tables; the two of the paper unless given
    glossy : file names, and the BRDFs of tables by direction and view angle
    rows : height of the tables; as each lobe needs unless given
    normalisation : of `tables`
    cube : texels along an edge of cubes with mip levels, a power of two; None for no cubes
    roughness_cubes : the cubes are light, diffuse, and specular (GGX, a roughness a level); else light and `tables`
    cube_format : "ktx2", one file a cube, or "hdr", a strip of six faces for each level
    mirror : "x" or "z" for an engine that negates that axis before it looks a cube up

    Raises ValueError for sizes that cannot be.
    """

    tables: dict[str, Lobe] = field(default_factory=lambda: {"diffuse": Lambert(), "specular": Phong()})
    glossy: dict[str, Reflectance] = field(default_factory=dict)
    rows: int | None = None
    normalisation: Normalisation = Normalisation.RADIOMETRIC
    cube: int | None = None
    roughness_cubes: bool = True
    cube_format: Literal["ktx2", "hdr"] = "ktx2"
    mirror: Literal["x", "z"] | None = None

    def __post_init__(self) -> None:
        least, most = (2, MOST_GLOSSY_ROWS) if self.glossy else (1, MOST_ROWS)
        if self.rows is not None and not least <= self.rows <= most:
            raise ValueError(f"rows are {self.rows}; give {least} to {most}, like 36 for Lambert")
        if self.cube is not None and (self.cube < 1 or self.cube & (self.cube - 1) or self.cube > LARGEST_CUBE):
            raise ValueError(f"the cube is {self.cube} texels; give a power of two up to {LARGEST_CUBE}, like 256")
        if self.cube is not None and self.normalisation is not Normalisation.RADIOMETRIC:
            raise ValueError(
                f"cubes with the normalisation {self.normalisation.value}: engines expect radiance; leave one out"
            )
        if self.mirror is not None and self.cube is None:
            raise ValueError(f"mirrored in {self.mirror}: only cubes are, and no cube is asked for")

    @property
    def cube_names(self) -> tuple[str, ...]:
        """File names of the cubes, without suffix."""
        if self.cube is None:
            return ()
        return ("light", "diffuse", "specular") if self.roughness_cubes else ("light", *self.tables)

    def paths(self, folder: Path) -> list[Path]:
        """All files that will be written into `folder`."""
        paths = [folder / f"{name}.exr" for name in (*self.tables, *self.glossy)] + [folder / "harmonics.json"]
        for name in self.cube_names:
            if self.cube_format == "ktx2":
                paths.append(folder / f"{name}.ktx2")
            else:
                size = min(self.cube or 1, DIFFUSE_CUBE) if name == "diffuse" else self.cube or 1
                paths += [folder / f"{name}_{level}.hdr" for level in range(size.bit_length())]
        return paths


@dataclass(frozen=True)
class WrittenReflectionMaps:
    """What was written.

    paths : the files
    error_bounds : of each table, by its name
    notes : what the user should know
    """

    paths: tuple[Path, ...]
    error_bounds: dict[str, float]
    notes: tuple[str, ...] = ()


def write_reflection_maps(
    light: EnvironmentMap,
    folder: str | os.PathLike[str],
    wanted: ReflectionFiles | None = None,
    progress: Callable[[str, float], None] = lambda stage, share: None,
) -> WrittenReflectionMaps:
    """Write an environment map convolved with what surfaces do to light (Miller & Hoffman 1984).

    light : in any mapping
    folder : made where it is missing
    wanted : the paper's two tables unless given; nine spherical harmonics always go to harmonics.json
    progress : called with the name of each step and the share of it that is done, 0 to 1
    Raises OutputNotWritten.
    """
    folder = made_folder(folder)
    wanted = wanted or ReflectionFiles()
    notes = []
    if wanted.glossy and wanted.normalisation is not Normalisation.RADIOMETRIC:
        notes.append("the normalisation is for lobes; three-dimensional maps hold radiance, light in and light out")

    # Tables by direction.
    written, bounds = [], {}
    for index, (name, lobe) in enumerate(wanted.tables.items()):
        table = reflection_map(light, lobe, wanted.rows, wanted.normalisation)
        files.write(folder / f"{name}.exr", as_picture(table))
        written.append(folder / f"{name}.exr")
        bounds[name] = table.error_bound
        progress("tables", (index + 1) / len(wanted.tables))

    # Tables by direction and view angle.
    for index, (name, brdf) in enumerate(wanted.glossy.items()):
        layers, attributes = as_layers(glossy_map(light, brdf, wanted.rows))
        files.write_layers(folder / f"{name}.exr", layers, unit=light.unit, attributes=attributes)
        written.append(folder / f"{name}.exr")
        progress("views", (index + 1) / len(wanted.glossy))

    # Harmonics and cubes.
    files.write_text(folder / "harmonics.json", as_json(project_sh(light)))
    written.append(folder / "harmonics.json")
    for index, (name, levels) in enumerate(_cubes(light, wanted)):
        written += _write_cube(folder / f"{name}.{wanted.cube_format}", levels, wanted.mirror)
        progress("cubes", (index + 1) / len(wanted.cube_names))
    return WrittenReflectionMaps(tuple(written), bounds, tuple(notes))


def _cubes(light: EnvironmentMap, wanted: ReflectionFiles) -> Iterator[tuple[str, tuple[EnvironmentMap, ...]]]:
    """Names and levels of the cubes, each made when it is asked for."""
    if wanted.cube is None:
        return
    yield "light", mips(light.remapped(Strip(), wanted.cube))
    if wanted.roughness_cubes:
        diffuse = reflection_map(light, Lambert(), wanted.rows)
        yield "diffuse", mips(diffuse.light.remapped(Strip(), min(wanted.cube, DIFFUSE_CUBE)))
        yield "specular", roughness_levels(light, wanted.cube)
    else:
        for name, lobe in wanted.tables.items():
            yield name, mips(reflection_map(light, lobe, wanted.rows).light.remapped(Strip(), wanted.cube))


def roughness_levels(light: EnvironmentMap, size: int) -> tuple[EnvironmentMap, ...]:
    """The specular cube that engines look up by roughness: a mirror at level 0, the roughest surface at the last.

    Cubes of `size`, size/2, … 1 texels an edge, level i for the perceptual roughness i / (levels − 1), α its square.
    The usual approximation of real-time shading, N = V = R (Karis 2013); `glossy_map` holds what it leaves out.
    Constant light stays what it is at every level. Raises ValueError for a size that is no power of two.
    """
    if size < 1 or size & (size - 1):
        raise ValueError(f"the cube is {size} texels along an edge; roughness levels need a power of two, as 256")
    levels, last = [light.remapped(Strip(), size)], size.bit_length() - 1
    for level in range(1, last + 1):
        lobe, texels = GGXLobe((level / last) ** 2), size >> level
        rows = min(rows_for(lobe, light.size), max(_FEWEST_ROWS, _ROWS_A_TEXEL * texels))
        levels.append(reflection_map(light, lobe, rows).light.remapped(Strip(), texels))
    return tuple(levels)


def _write_cube(path: Path, levels: tuple[EnvironmentMap, ...], mirror: str | None) -> list[Path]:
    faces = [faces_of(level if mirror is None else mirrored_strip(level, mirror)) for level in levels]
    if path.suffix == ".hdr":
        return ktx2.write_cube_hdr(path, faces, unit=levels[0].unit)
    ktx2.write_cube(path, faces)
    return [path]


def reflection_facts(light: EnvironmentMap) -> dict[str, object]:
    """Two numbers to compare with other programs: the mean of the diffuse table, and the irradiance from above.

    light : in any mapping
    """
    diffuse = reflection_map(light, Lambert())
    return {
        "mean of D, radiometric": six_digits(diffuse.light.total() / (4 * np.pi)),
        "irradiance from above": six_digits(light.irradiance(np.array([0.0, 1.0, 0.0]))),
    }
