"""The example room with photographs of half their width: what is asked of a whole job needs no more pixels."""

from __future__ import annotations

import shutil
from pathlib import Path

from PIL import Image

ROOM = Path(__file__).parents[2] / "examples" / "room"
RIM = (320.0, 320.0, 296.255)
"""Of the ball in the room's own photographs: 5960.26 pixels of focal length, √(20.144² − 1) radii away."""


def smaller(path: Path, copy: Path, times: int = 4) -> None:
    """A photograph of so many times less width, with what the camera wrote beside it."""
    with Image.open(path) as picture:
        size = (picture.width // times, picture.height // times)
        picture.resize(size, Image.Resampling.BOX).save(copy, exif=picture.info["exif"], quality=95)


def write_half_room(folder: Path) -> None:
    """Copy the room into a folder that does not exist."""
    for path in (each for each in ROOM.rglob("*") if each.is_file()):
        copy = folder / path.relative_to(ROOM)
        copy.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".jpg":
            smaller(path, copy, 2)
        else:
            shutil.copyfile(path, copy)
