"""The images that a scene file's materials name, and faults named by file and key."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import InvalidScene, UnreadableFile
from relume.image import files
from relume.image.colour import decode_srgb
from relume.image.radiance import RadianceMap
from relume.scene.materials.materials import Colour


@contextmanager
def naming(place: str) -> Iterator[None]:
    """Raises InvalidScene with the place, a file and a key, before what a value or a file is found to lack."""
    try:
        yield
    except (ValueError, UnreadableFile) as error:
        raise InvalidScene(f"{place}: {error}") from None


def colour_of(paint: Colour | str, folder: Path, place: str) -> Colour | np.ndarray:
    """A colour, or the image (H, W, 3) of one, scene-linear; raises InvalidScene naming `place` and the file."""
    if not isinstance(paint, str):
        return paint
    with naming(place):
        return picture(folder / paint, encoded=False)


def number_of(value: float | str, folder: Path, place: str) -> Any:
    """A number, or the image (H, W) of one: code values from 0 to 1, or a float file's values as they are."""
    if not isinstance(value, str):
        return value
    with naming(place):
        return np.ascontiguousarray(picture(folder / value, encoded=True).mean(axis=-1))


def picture(path: Path, encoded: bool) -> np.ndarray:
    """An image (H, W, 3) float32: a radiance map as it is; a photograph's code values, or linear ones by sRGB."""
    image = files.read(path)
    if isinstance(image, RadianceMap):
        return image.radiance
    codes = image.pixels.astype(np.float32) / np.iinfo(image.pixels.dtype).max
    return codes if encoded else decode_srgb(codes)
