"""Shots in the files of other programs: `export_shot` and the formats it writes."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from relume.cluster.renaming import put_in_place
from relume.errors import OutputNotWritten, warn
from relume.export.blender import shot as blender
from relume.export.mitsuba import shot as mitsuba_xml
from relume.export.usd import shot as usd
from relume.image import files
from relume.project.insertion.prepared import PreparedShot

Program = Literal["blender", "usd", "mitsuba"]


@dataclass(frozen=True)
class ExportedShot:
    """What `export_shot` wrote.

    main : the file to open, which names the others
    not_held : what the files do not hold, or not exactly, a line each
    """

    main: Path
    not_held: tuple[str, ...]


@dataclass(frozen=True)
class ShotFormat:
    """A program that a shot can be exported for.

    name : of the program
    main : the file to open, which names the others
    use : how, for the README
    write : writes the files into a folder that exists; returns what they do not hold, a line each
    """

    name: str
    main: str
    use: str
    write: Callable[[PreparedShot, Path], tuple[str, ...]]


SHOT_FORMATS: dict[str, ShotFormat] = {
    form.name: form
    for form in (
        ShotFormat("blender", "shot.py", blender.USE, blender.write),
        ShotFormat("usd", "shot.usda", usd.USE, usd.write),
        ShotFormat("mitsuba", "shot.xml", mitsuba_xml.USE, mitsuba_xml.write),
    )
}
"""Every program that a shot can be exported for, by its name."""


def export_shot(shot: PreparedShot, folder: str | os.PathLike[str], program: Program) -> ExportedShot:
    """Write a shot as a folder for another program, complete or not at all.

    shot : from `prepare_shot`
    folder : made where it is missing (its parent is not); in one that exists, files of the same names are replaced
    program : that is to open it: "blender", "usd" or "mitsuba"

    Every line of what the files do not hold is also a warning and stands in the folder's README.txt. Raises
    UnsupportedScene for what no other program has, ValueError for another program and for walls that the probe is not
    inside of, OutputNotWritten.
    """
    if program not in SHOT_FORMATS:
        raise ValueError(f'program is "{program}"; choose one of {", ".join(SHOT_FORMATS)}')
    form = SHOT_FORMATS[program]
    with complete_folder(folder, form.main) as temporary:
        notes = tuple(dict.fromkeys(form.write(shot, temporary)))
        written = sorted(path.name for path in temporary.iterdir())
        files.write_text(temporary / "README.txt", _readme(form, written, notes))
    for note in notes:
        warn(f"{form.name}: {note}")
    return ExportedShot(Path(folder) / form.main, notes)


def _readme(form: ShotFormat, written: list[str], notes: tuple[str, ...]) -> str:
    lost = "".join(f"- {note}\n" for note in notes) or "- nothing that the shot has\n"
    return (
        f"A shot for {form.name}, written by relume. Open {form.main}.\n\n{form.use}\n\n"
        "World: right-handed, +Y up, metres. Images are scene-linear Rec. 709, in the light's unit; a PNG is for the "
        "eye.\n\n"
        f"Files: {', '.join(written)}\n\nNot held, or not exactly:\n{lost}"
    )


@contextmanager
def complete_folder(folder: str | os.PathLike[str], last: str) -> Iterator[Path]:
    """A temporary folder to write to; when the block ends well its files are in `folder`, when it fails none is.

    last : name of the file that names the others; in a folder that exists already it is put there last

    A new folder appears at once. In one that exists each file replaces that of its name, and others stay as they are:
    they may be somebody's work. Raises OutputNotWritten.
    """
    folder = Path(folder)
    temporary = folder.with_name(f".{folder.name[:80]}.{secrets.token_hex(4)}")
    try:
        if folder.exists() and not folder.is_dir():
            raise NotADirectoryError(None, "a file has that name; choose another")
        temporary.mkdir()
        try:
            yield temporary
            if not folder.exists() or not any(folder.iterdir()):
                if folder.exists() and os.name == "nt":
                    folder.rmdir()  # Windows puts no folder in the place of another
                put_in_place(temporary, folder)
                return
            names = sorted(path.name for path in temporary.iterdir())
            for name in sorted(names, key=lambda name: name == last):
                with files.replacing(folder / name) as place:
                    shutil.copyfile(temporary / name, place)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        reason = " ".join(str(error.strerror or error).split())
        raise OutputNotWritten(f"{folder}: cannot be written: {reason}; choose another place, or mend it") from error
