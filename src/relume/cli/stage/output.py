"""How the commands of a light stage write what they made: a picture in the format of its suffix, frames, a movie."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from relume.cli.arguments import made_folder, require_suffix
from relume.errors import OutputNotWritten

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.virtual_camera.film.film import Film

PICTURES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")
BRIGHT = 99
"""Per cent of a picture's lit pixels that are to be darker than white."""


def require_picture(out: Path) -> None:
    """Refuse a name that no picture can be written to."""
    require_suffix(out, *PICTURES)


def require_frames(out: Path, frames: int) -> None:
    """Refuse a number or a name that no frames can be written to."""
    if frames < 2:
        raise ValueError(f"--frames is {frames}; give 2 or more, like 72")
    if out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        raise ValueError(f"-o {out}: --frames writes a folder or an .mp4; give one of them")
    elif out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: a file, not a folder; choose another name")


def require_output_folder(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: a file, not a folder; choose another name")


def film_for(picture: RadianceMap, stops: float) -> Film:
    """The sRGB curve, exposed so that all but the brightest of what is lit is darker than white."""
    import numpy as np

    from relume.virtual_camera.film.film import Film

    lit = picture.radiance[picture.radiance.max(axis=-1) > 0]
    bright = float(np.percentile(lit, BRIGHT)) if len(lit) else 1.0
    return Film(1 / max(bright, 1e-30)).brighter(stops)


def write_picture(out: Path, picture: RadianceMap, stops: float) -> None:
    """Write a radiance map as it is, or developed where the suffix is a photograph's."""
    from relume.image import files
    from relume.virtual_camera.developing import develop

    if out.suffix.lower() in (".exr", ".hdr"):
        files.write(out, picture)
    else:
        files.write(out, develop(picture.radiance, film_for(picture, stops)))


def write_frames(out: Path, pictures: Iterator[RadianceMap], stops: float) -> int:
    """Write a movie, or a folder of frame_0001.exr and .png …; all are exposed as the first is. How many there were."""
    from relume.image import files
    from relume.virtual_camera.developing import develop

    film, count = None, 0
    if out.suffix.lower() == ".mp4":
        from relume.image.files.video import Movie

        with Movie(out) as movie:
            for picture in pictures:
                film, count = film or film_for(picture, stops), count + 1
                movie.add(develop(picture.radiance, film).pixels)
        return count
    made_folder(out)
    for picture in pictures:
        film, count = film or film_for(picture, stops), count + 1
        files.write(out / f"frame_{count:04d}.exr", picture)
        files.write(out / f"frame_{count:04d}.png", develop(picture.radiance, film))
    return count
