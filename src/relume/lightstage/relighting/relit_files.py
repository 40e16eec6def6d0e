"""Files of relit pictures: a picture in the format of its suffix, frames in a folder, a movie."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from relume.image import files
from relume.image.files.atomic import made_folder
from relume.image.files.video import Movie
from relume.image.radiance import RadianceMap
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

BRIGHT = 99
"""Per cent of a picture's lit pixels that are to be darker than white."""


def film_for(picture: RadianceMap, stops: float = 0.0) -> Film:
    """The sRGB curve, exposed so that all but the brightest of the lit pixels are darker than white, plus stops."""
    lit = picture.radiance[picture.radiance.max(axis=-1) > 0]
    bright = float(np.percentile(lit, BRIGHT)) if len(lit) else 1.0
    return Film(1 / max(bright, 1e-30)).brighter(stops)


def write_picture(path: str | os.PathLike[str], picture: RadianceMap, stops: float = 0.0) -> None:
    """Write a radiance map as it is to .exr and .hdr, developed to .png and .jpg.

    path : .exr, .hdr, .png or .jpg
    picture : the radiance map
    stops : by which developed pictures are brighter than they would be, with all but the brightest pixels below white
    Raises OutputNotWritten.
    """
    if Path(path).suffix.lower() in (".exr", ".hdr"):
        files.write(path, picture)
    else:
        files.write(path, develop(picture.radiance, film_for(picture, stops)))


def write_frames(path: str | os.PathLike[str], pictures: Iterable[RadianceMap], stops: float = 0.0) -> int:
    """Write an .mp4, or a folder of frame_0001.exr and .png …, and return how many frames there were.

    path : the .mp4, or the folder
    pictures : the frames, one after another
    stops : to brighten .mp4 and .png by; 0 unless given
    All frames are exposed as the first is. Raises OutputNotWritten.
    """
    out, film, count = Path(path), None, 0
    if out.suffix.lower() == ".mp4":
        with Movie(out) as movie:
            for picture in pictures:
                film, count = film or film_for(picture, stops), count + 1
                movie.add(develop(picture.radiance, film).pixels)
                del picture
        return count
    made_folder(out)
    for picture in pictures:
        film, count = film or film_for(picture, stops), count + 1
        write_frame(out, count, picture, film)
        del picture  # before the next is made
    return count


def write_frame(folder: Path, number: int, picture: RadianceMap, film: Film) -> None:
    """Write frame_0001.exr and .png of a frame into a folder, each whole or not at all."""
    files.write(folder / f"frame_{number:04d}.exr", picture)
    files.write(folder / f"frame_{number:04d}.png", develop(picture.radiance, film))
