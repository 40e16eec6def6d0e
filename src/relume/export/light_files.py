"""Lights as files of other programs: `write_lights` writes them, `FORMATS` lists the kinds of files."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from relume.export import gltf, json_lights, radiance
from relume.export.blender import lights as blender
from relume.export.lamps import LampFile
from relume.export.mitsuba import lights as mitsuba_xml
from relume.export.usd import lights as usd
from relume.image import files
from relume.light.light_set import LightSet
from relume.sphere.environment_files import as_radiance_map


@dataclass(frozen=True)
class Format:
    """A kind of file that holds lights.

    name : what a person asks for
    suffix : of its files
    background_suffix : of the lat-long file with the light that the lights do not carry, as the program reads it
    text : writes it
    """

    name: str
    suffix: str
    background_suffix: str
    text: Callable[[LampFile], str]


FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        Format("json", ".json", ".exr", json_lights.text),
        Format("usd", ".usda", ".exr", usd.text),
        Format("gltf", ".gltf", ".exr", gltf.text),
        Format("blender", ".py", ".exr", blender.text),
        Format("radiance", ".rad", ".hdr", radiance.text),
        Format("mitsuba", ".xml", ".exr", mitsuba_xml.text),
    )
}
"""Every kind of file that lights can be written to, by its name."""


@dataclass(frozen=True)
class LightFiles:
    """Which files lights are written to.

    paths : a file each, whose suffix says the program
    residual : of the map with the light that the lights do not carry, .exr or .hdr; the files name it as background
    program : "json", "usd", "gltf", "blender", "radiance" or "mitsuba" for a single path with another suffix

    Raises ValueError for files that no program reads.
    """

    paths: tuple[Path, ...]
    residual: Path | None = None
    program: str | None = None

    def __post_init__(self) -> None:
        if self.program is not None and len(self.paths) > 1:
            raise ValueError(f"the format {self.program} is for a single file; {len(self.paths)} go by their suffixes")
        if len(set(self.paths)) < len(self.paths):
            raise ValueError("the files to write: one is named twice")
        for form in self.formats:
            wrong = self.residual is not None and self.residual.suffix.lower() != ".hdr"
            if form.background_suffix == ".hdr" and wrong:
                raise ValueError(f"{self.residual}: {form.name} reads .hdr backgrounds only; name the residual so")

    @property
    def formats(self) -> list[Format]:
        """The kind of each file."""
        if self.program is not None:
            if self.program not in FORMATS:
                raise ValueError(f'there is no format "{self.program}"; there are {", ".join(FORMATS)}')
            return [FORMATS[self.program]]
        kinds = {form.suffix: form for form in FORMATS.values()}
        for path in self.paths:
            if path.suffix.lower() not in kinds:
                raise ValueError(f"{path}: the file must end in {' or '.join(kinds)}")
        return [kinds[path.suffix.lower()] for path in self.paths]


def write_lights(lights: LightSet, to: LightFiles) -> tuple[str, ...]:
    """Write lights for other programs, and their residual map where there is one; notes on what the files do not hold.

    lights : as `make_lights`, `constellation` or `rl.light.key_lights` made them
    to : the files
    Raises OutputNotWritten for files that cannot be written, ValueError for a residual on another drive.
    """
    for path, form in zip(to.paths, to.formats, strict=True):
        background = None if to.residual is None else _relative(to.residual, path)
        held = LampFile(lights.distant, lights.light.unit, background, lights.angles, lights.points)
        files.write_text(path, form.text(held))
    if to.residual is None or lights.residual is None:
        return ()
    files.write(to.residual, as_radiance_map(lights.residual))
    if to.residual.suffix.lower() == ".hdr":
        return (f"{to.residual}: an .hdr file rounds its pixels to a 256th; the totals shown are those before that",)
    return ()


def _relative(background: Path, file: Path) -> str:
    """The background's path as the file beside it may name it."""
    try:
        return Path(os.path.relpath(background, file.parent)).as_posix()
    except ValueError:
        raise ValueError(f"{background}: on another drive than {file}; write them to the same") from None
