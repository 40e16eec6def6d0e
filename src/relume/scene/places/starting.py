"""The first lines of a place file, for a folder of photographs."""

from __future__ import annotations

import os
import re
from pathlib import Path

from relume.errors import InvalidPlace
from relume.image import files
from relume.scene.places.photographs import photograph_facts, pictures_in

INTRODUCTION = """# A place: mark edges of blocks in the photographs, then run `relume model` on this file.
# deviation = 0.5     # of a mark, pixels

"""
FIRST_BLOCK = """
# Sizes in metres; what is left out is found. Give one size, or a distance in [[lengths]], to set the scale.
[[blocks]]
name = "house"
kind = "box"          # or roof, gable, wedge, pyramid, wall, floor, arch, revolution
width = 10.0

# Points on edges, pixels: x to the right, y down from the upper left corner of the picture.
"""


def new_place_file(folder: str | os.PathLike[str], out: str | os.PathLike[str]) -> Path:
    """Write a place file that names all photographs of a folder, with a first block and room for marks.

    out : the file, .toml, which must not be there yet: marks are work
    Raises InvalidPlace for a folder without photographs, OutputNotWritten.
    """
    folder, out = Path(folder), Path(out)
    if out.exists():
        raise ValueError(f"{out}: is there already, and may hold marks; give another name")
    found = pictures_in(folder)
    if not found:
        raise InvalidPlace(f"{folder}: no photographs in it; give a folder of JPEG, PNG, TIFF or HEIF files")
    tables, marks, names = [], [], set()
    for path in found:
        facts = photograph_facts(path)
        name = re.sub(r"[^\w-]+", "_", path.stem)
        name = name if name not in names else re.sub(r"[^\w-]+", "_", path.name)
        names.add(name)
        relative = os.path.relpath(path.absolute(), out.absolute().parent).replace(os.sep, "/")
        width, height = facts.size
        focal = facts.exif_focal_length
        known = f"EXIF: about {focal:.0f} pixels" if focal else "not in the file"
        tables.append(
            f"[[photographs]]\nname = {_quoted(name)}\nfile = {_quoted(relative)}\nsize = [{width}, {height}]\n"
            f"# focal_length = 1000.0     # pixels, where it is known exactly; {known}\n"
        )
        marks.append(
            f"[marks.{_quoted(name)}.house]\n# front_top = [[100.0, 200.0], [400.0, 210.0]]\n"
        )
    files.write_text(out, INTRODUCTION + "\n".join(tables) + FIRST_BLOCK + "\n".join(marks))
    return out


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
