"""What every mapping between directions and image points offers, and the equirectangular (lat-long) one.

Image points (…, 2) are (u, v) in [0, 1]², u to the right and v down; the centre of pixel (column i, row j) of an image
of W × H pixels is ((i + ½)/W, (j + ½)/H). `size` is always the number of rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Mapping(Protocol):
    """How the sphere of directions is laid out in an image."""

    @property
    def name(self) -> str:
        """What a file remembers: `mapping_named` finds the mapping by it."""
        ...

    def shape(self, size: int) -> tuple[int, int]:
        """Rows and columns of an image of `size` rows; raises ValueError where no image has so many."""
        ...

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2); NaN where the image does not show them."""
        ...

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2); NaN where the image shows none."""
        ...

    def shown(self, points: np.ndarray) -> np.ndarray:
        """The points (…, 2) themselves, drawn to the nearest rim where they lie beside the image's discs."""
        ...

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel, of `shape(size)`; they sum to 4π, or to what the image shows of the sphere."""
        ...


@dataclass(frozen=True)
class LatLong:
    """Equirectangular (lat-long): row 0 is +Y, the centre is −Z and +X lies to its right, as seen from inside."""

    name = "latlong"

    def shape(self, size: int) -> tuple[int, int]:
        """Rows and columns, (size, 2·size); raises ValueError for fewer than one row."""
        refuse_size(size, self.name)
        return size, 2 * size

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2)."""
        x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
        u = 0.5 + np.arctan2(x, -z) / (2 * np.pi)
        return np.stack([u % 1.0, np.arctan2(np.hypot(x, z), y) / np.pi], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2)."""
        longitude, polar = 2 * np.pi * (points[..., 0] - 0.5), np.pi * points[..., 1]
        ring = np.sin(polar)
        return np.stack([ring * np.sin(longitude), np.cos(polar), -ring * np.cos(longitude)], axis=-1)

    def shown(self, points: np.ndarray) -> np.ndarray:
        """The points (…, 2) themselves: the whole image shows the sphere."""
        return points

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel of an image of `size` rows, (rows, columns); they sum to 4π."""
        rows, columns = self.shape(size)
        cosines = np.cos(np.pi * np.arange(rows + 1) / rows)
        rings = (cosines[:-1] - cosines[1:]) * 2 * np.pi / columns
        return np.broadcast_to(rings[:, None], (rows, columns))


def continued_round(pixels: np.ndarray) -> np.ndarray:
    """A lat-long map (H, 2H, …) with one more pixel on every side: round the seam, and over the poles."""
    half = pixels.shape[1] // 2
    tall = np.concatenate([np.roll(pixels[:1], half, 1), pixels, np.roll(pixels[-1:], half, 1)])
    return np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1)


def pixel_points(mapping: Mapping, size: int, subdivision: int = 1, rows: slice = slice(None)) -> np.ndarray:
    """Image points of pixel centres, or of subdivision² cells in each pixel: (rows·s, columns·s, 2).

    rows : those of the cells that are wanted
    """
    height, columns = (subdivision * count for count in mapping.shape(size))
    v, u = (np.arange(height)[rows] + 0.5) / height, (np.arange(columns) + 0.5) / columns
    return np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)


def pixel_directions(mapping: Mapping, size: int, rows: slice = slice(None)) -> np.ndarray:
    """The unit directions of the middles of all pixels, or of some rows, (rows, columns, 3), finite everywhere.

    mapping : how the image lays out the sphere
    size : rows of the image
    rows : those that are wanted; all unless given

    Where a rim cuts a pixel it is the nearest direction shown; where the image shows none, and the pixel's solid
    angle is 0, it is straight ahead.
    """
    directions = mapping.directions(mapping.shown(pixel_points(mapping, size, rows=rows)))
    return np.where(np.isnan(directions), (0.0, 0.0, -1.0), directions)


def shown(areas: np.ndarray) -> np.ndarray:
    """Where an image shows something: its solid angles are not 0, nor what rounding leaves of a disc's rim.

    A pixel whose corner the rim meets in one point, as by 3² + 4² = 5², may have 1e-15 of another's.
    """
    return areas > 1e-12 * areas.max()


def refuse_size(size: int, name: str, factor: int = 1) -> None:
    """Raise ValueError where a `name` map cannot have `size` rows: they are a multiple of `factor`, and not 0."""
    if size < factor or size % factor:
        several = f"a multiple of {factor}" if factor > 1 else "1 or more"
        raise ValueError(f"a {name} map of {size} rows; expected {several}, like {256 * factor}")


_TRIAL = 384
"""Rows of which every mapping has an image."""


def matching_size(mapping: Mapping, size: int, other: Mapping) -> int:
    """Rows of an image in `other` with at least as many pixels a steradian, on average, as `size` rows of `mapping`.

    `size` itself where both mappings are the same.
    """
    if other == mapping:
        return size
    here, there = mapping.solid_angles(size), other.solid_angles(_TRIAL)
    density = np.count_nonzero(here) / here.sum()
    rows = _TRIAL * np.sqrt(density * there.sum() / np.count_nonzero(there))
    grid = getattr(other, "grid", (1, 1))[0]
    return grid * max(1, int(np.ceil(rows / grid - 0.01)))
