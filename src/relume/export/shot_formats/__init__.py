"""Shots in the files of other programs, one module a program: camera, plate, real surfaces, objects and light."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from relume.export.blender import shot as blender
from relume.export.bundle import HandOver
from relume.export.folder import whole_folder
from relume.export.mitsuba import shot as mitsuba_xml
from relume.export.usd import shot as usd
from relume.image import files

__all__ = ["FORMATS", "Format", "HandOver", "hand_over"]


@dataclass(frozen=True)
class Format:
    """A program that a shot can be handed over to.

    name : what a person asks for
    main : the file to open, which names the others
    use : how, for the README
    write : writes the files into a folder that is there, and tells what they do not hold, a line each
    """

    name: str
    main: str
    use: str
    write: Callable[[HandOver, Path], tuple[str, ...]]


FORMATS: dict[str, Format] = {
    form.name: form
    for form in (
        Format("blender", "shot.py", blender.USE, blender.write),
        Format("usd", "shot.usda", usd.USE, usd.write),
        Format("mitsuba", "shot.xml", mitsuba_xml.USE, mitsuba_xml.write),
    )
}
"""Every program a shot can be handed over to, by its name."""


def hand_over(value: HandOver, folder: str | os.PathLike[str], form: Format) -> tuple[str, ...]:
    """Write a shot as a folder for another program, whole or not at all; what it does not hold, a line each.

    folder : made where it is missing (its parent is not); in one that exists, files of the same names are replaced
    form : one of `FORMATS`

    Every line is also a warning and stands in the folder's README.txt. Raises UnsupportedScene for what no other
    program has, ValueError for walls that the probe is not inside of, OutputNotWritten.
    """
    with whole_folder(folder, form.main) as temporary:
        notes = tuple(dict.fromkeys(form.write(value, temporary)))
        written = sorted(path.name for path in temporary.iterdir())
        files.write_text(temporary / "README.txt", _readme(form, written, notes))
    for note in notes:
        warnings.warn(f"{form.name}: {note}", stacklevel=2)
    return notes


def _readme(form: Format, written: list[str], notes: tuple[str, ...]) -> str:
    lost = "".join(f"- {note}\n" for note in notes) or "- nothing that the shot has\n"
    return (
        f"A shot for {form.name}, written by relume. Open {form.main}.\n\n{form.use}\n\n"
        "World: right-handed, +Y up, metres. Images are scene-linear Rec. 709, in the light's unit; a PNG is for the "
        "eye.\n\n"
        f"Files: {', '.join(written)}\n\nNot held, or not exactly:\n{lost}"
    )
