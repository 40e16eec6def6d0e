"""Environment maps that files hold otherwise than our mappings do, resampled once when they are read.

Two keep their samples at the rims of pixels, where ours are in their middles: lat-long maps that repeat their first
meridian as their last, and their poles as rows (721 × 361 for half degrees), and the cubes of OpenEXR.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.image.radiance import RadianceMap

_LEAST = 32  # rows; of smaller maps one pixel off is another shape
_OFF = 2  # columns: a row more or less, or a column
_REPEATED = 0.1  # of how much neighbouring columns differ: the first and the last then show one meridian
_CONSTANT = 1e-3  # of its mean: a row that shows a pole


def evened(picture: RadianceMap) -> RadianceMap:
    """A lat-long map that is a pixel off 2:1, made 2:1, with a warning; every other picture as it is.

    Where the last column repeats the first, samples stand at the rims of the pixels and are averaged into their
    middles; where the first and the last row are each one value, they stand at the poles, alike. What is then left of
    the difference is taken up by as many columns as the rows ask for.
    """
    width, height = picture.size
    if width == 2 * height or abs(width - 2 * height) > _OFF or height < _LEAST:
        return picture
    radiance, variance, clipped = picture.radiance, picture.variance, picture.clipped
    if _is_repeated(radiance):
        radiance = _between(radiance, 1)
        variance = None if variance is None else _between(variance, 1) / 2  # of the mean of two
        clipped = None if clipped is None else np.maximum(clipped[:, 1:], clipped[:, :-1])
    if radiance.shape[1] != 2 * height and _is_pole(radiance[0]) and _is_pole(radiance[-1]):
        radiance = _between(radiance, 0)
        variance = None if variance is None else _between(variance, 0) / 2
        clipped = None if clipped is None else np.maximum(clipped[1:], clipped[:-1])
    rows, columns = radiance.shape[:2]
    if columns != 2 * rows:
        at = (np.arange(2 * rows) + 0.5) * columns / (2 * rows) - 0.5
        left, share = np.floor(at).astype(int), (at - np.floor(at)).astype(np.float32)[:, None]
        right = (left + 1) % columns
        radiance = radiance[:, left % columns] * (1 - share) + radiance[:, right] * share
        if variance is not None:
            variance = variance[:, left % columns] * (1 - share) ** 2 + variance[:, right] * share**2
        clipped = None if clipped is None else np.maximum(clipped[:, left % columns], clipped[:, right])
    made = radiance.astype(np.float32)
    warn(f"{width}×{height} pixels, one off 2:1: taken for a lat-long map, and resampled to {made.shape[1]}×{rows}")
    variance = None if variance is None else variance.astype(np.float32)
    return replace(picture, radiance=made, variance=variance, clipped=clipped)


def strip_of_openexr(picture: RadianceMap) -> RadianceMap:
    """A cube of OpenEXR, N × 6N pixels, as a strip of faces as OpenGL reads them, 6N × N.

    Its faces, +X, −X, +Y, −Y, +Z, −Z from the top, are seen from inside a right-handed world with Y up; their samples
    stand at the edges of the cube, which faces share (ImfEnvmap.h, ImfEnvmap.cpp). OpenGL's are mirrored: those of Y
    upside down, all others side to side.
    """
    side = picture.size[0]
    faces = picture.radiance[: 6 * side].reshape(6, side, side, 3)
    marks = None if picture.clipped is None else picture.clipped[: 6 * side].reshape(6, side, side)
    made = [_mirrored(_centred(_centred(face, 0), 1), index) for index, face in enumerate(faces)]
    clipped = None if marks is None else np.concatenate([_mirrored(face, index) for index, face in enumerate(marks)], 1)
    attributes = {key: text for key, text in picture.attributes.items() if key != "envmap"} | {"mapping": "strip"}
    radiance = np.ascontiguousarray(np.concatenate(made, axis=1), np.float32)
    return RadianceMap(radiance, None, clipped, picture.unit, attributes)


def is_openexr_cube(picture: RadianceMap) -> bool:
    """Whether a file says that it holds one, and nothing else of its mapping."""
    width, height = picture.size
    return picture.attributes.get("envmap") == "cube" and "mapping" not in picture.attributes and height == 6 * width


def _mirrored(face: np.ndarray, index: int) -> np.ndarray:
    return face[::-1] if index in (2, 3) else face[:, ::-1]


def _centred(face: np.ndarray, axis: int) -> np.ndarray:
    """As many samples along an axis, moved from 0, 1/(N − 1), …, 1 to ½/N, 1½/N, …"""
    count = face.shape[axis]
    if count == 1:
        return face
    at = (np.arange(count) + 0.5) * (count - 1) / count
    first = np.floor(at).astype(int)
    share = (at - first).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
    return np.take(face, first, axis) * (1 - share) + np.take(face, first + 1, axis) * share


def _between(pixels: np.ndarray, axis: int) -> np.ndarray:
    """The means of neighbours, one fewer."""
    before, after = (pixels[:-1], pixels[1:]) if axis == 0 else (pixels[:, :-1], pixels[:, 1:])
    return (before + after) * np.float32(0.5)


def _is_repeated(radiance: np.ndarray) -> bool:
    seam, step = (np.abs(radiance[:, 0] - radiance[:, column]).mean(dtype=np.float64) for column in (-1, 1))
    return bool(seam <= _REPEATED * step)


def _is_pole(row: np.ndarray) -> bool:
    return bool(np.ptp(row, axis=0).max() <= _CONSTANT * np.abs(row).mean(dtype=np.float64))
