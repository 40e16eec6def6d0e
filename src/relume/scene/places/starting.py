"""A place file begun, for a folder of photographs or for photogrammetry made elsewhere."""

from __future__ import annotations

import os
import re
import textwrap
from dataclasses import dataclass
from pathlib import Path

from relume.errors import InvalidPlace
from relume.image import files
from relume.image.files.atomic import relative_name
from relume.scene.places.bodies import BODIES
from relume.scene.places.photogrammetry.reading import KnownDistance, read_photogrammetry
from relume.scene.places.photographs import photograph_facts, pictures_in

INTRODUCTION = """# A place: mark edges of blocks in the photographs, then run `relume model` on this file.
# `relume studio` on it marks by the pointer.
# deviation = 0.5     # of a mark, pixels

"""
FIRST_BLOCK = """
# Sizes in metres; what is left out is found. Give one size, or a distance in [[lengths]], to set the scale.
[[blocks]]
name = "house"
kind = "box"          # or roof, gable, wedge, pyramid, wall, floor, arch, revolution
width = 10.0

# Points on edges, pixels: x to the right, y down from the upper left corner of the picture. Two or more on each edge
# that the photograph shows; of a corner one. Which side of the first block is its front is yours to say: right is then
# to the right of who stands before it. It is the same side in all photographs.
"""


@dataclass(frozen=True)
class NewPlace:
    """A place file that was begun.

    photographs : how many it names; of photogrammetry those that have a camera
    points, meshes : of photogrammetry
    solved : whether it can be used as it is
    """

    photographs: int
    points: int = 0
    meshes: int = 0
    solved: bool = False


def new_place_file(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    scale: float | KnownDistance | None = None,
    up: tuple[float, float, float] | None = None,
    mesh: str | os.PathLike[str] | None = None,
    photographs: str | os.PathLike[str] | None = None,
) -> NewPlace:
    """Write a place file for a folder of photographs, with room for marks, or for photogrammetry made elsewhere.

    source : a folder of photographs; or what `read_photogrammetry` reads
    out : the file, .toml, which must not be there yet: marks are work
    scale, up, mesh, photographs : of photogrammetry, as `read_photogrammetry` has them
    Raises InvalidPlace for a folder without photographs, UnreadableFile, OutputNotWritten; ValueError for a model
    without scale.
    """
    source, out = Path(source), Path(out)
    if out.exists():
        raise ValueError(f"{out}: is there already, and may hold marks; give another name")
    if not source.is_dir() or any((source / f"cameras{kind}").is_file() for kind in (".bin", ".txt")):
        place = read_photogrammetry(source, scale=scale, up=up, mesh=mesh, photographs=photographs)
        files.write_text(out, _photogrammetry_text(source, out, scale, up, mesh, photographs))
        return NewPlace(len(place.photographs), len(place.points), len(place.blocks), solved=True)
    if given := [word for word, value in (("scale", scale), ("up", up), ("mesh", mesh)) if value is not None]:
        raise ValueError(f"{source}: {given[0]} is of photogrammetry; blocks are found from marks, leave it out")
    found = pictures_in(source)
    if not found:
        raise InvalidPlace(
            f"{source}: no photographs in it; give a folder of photographs, or a model of photogrammetry"
        )
    tables, marks, names = [], [], set()
    for path in found:
        facts = photograph_facts(path)
        name = re.sub(r"[^\w-]+", "_", path.stem)
        name = name if name not in names else re.sub(r"[^\w-]+", "_", path.name)
        names.add(name)
        width, height = facts.size
        focal = facts.exif_focal_length
        known = f"EXIF: about {focal:.0f} pixels" if focal else "not in the file"
        tables.append(
            f"[[photographs]]\nname = {_quoted(name)}\nfile = {_relative(path, out)}\nsize = [{width}, {height}]\n"
            f"# focal_length = 1000.0     # pixels, where it is known exactly; {known}\n"
        )
        marks.append(f"[marks.{_quoted(name)}.house]\n# front_top = [[100.0, 200.0], [400.0, 210.0]]\n")
    files.write_text(out, INTRODUCTION + "\n".join(tables) + FIRST_BLOCK + _names_of_edges() + "\n".join(marks))
    return NewPlace(len(found))


def _names_of_edges() -> str:
    """The edges and corners of each kind of block, as comments."""
    lines = []
    for kind, body in BODIES.items():
        names = ", ".join(body.edges) + "; corners " + ", ".join(body.corners)
        lines += textwrap.wrap(f"{kind}: {names}", 118, initial_indent="# ", subsequent_indent="#     ")
    ring = "# revolution: ring_0, which is bottom, and so on up to the last, which is top"
    return "\n".join([*lines, ring]) + "\n\n"


def _photogrammetry_text(
    source: Path, out: Path, scale: float | KnownDistance | None, up: tuple[float, float, float] | None,
    mesh: str | os.PathLike[str] | None, photographs: str | os.PathLike[str] | None,
) -> str:  # fmt: skip
    lines = ["# A place of photogrammetry made elsewhere.", "[photogrammetry]", f"model = {_relative(source, out)}"]
    if isinstance(scale, KnownDistance):
        ends = ", ".join(_quoted(e) if isinstance(e, str) else str(list(e) if isinstance(e, tuple) else e)
                         for e in (scale.start, scale.end))  # fmt: skip
        lines += [f"between = [{ends}]", f"metres = {float(scale.metres)!r}"]
    elif scale is not None:
        lines.append(f"metres_per_unit = {float(scale)!r}")
    if up is not None:
        lines.append(f"up = {[float(u) for u in up]}")
    lines += [f"mesh = {_relative(Path(mesh), out)}"] if mesh is not None else []
    lines += [f"photographs = {_relative(Path(photographs), out)}"] if photographs is not None else []
    return "\n".join(lines) + "\n"


def _relative(path: Path, out: Path) -> str:
    """The path from the place file's folder, quoted."""
    return _quoted(relative_name(path.absolute(), out.absolute().parent))


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
