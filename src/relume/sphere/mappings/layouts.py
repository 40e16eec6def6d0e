"""How kernels see a mapping's image: one or more planes, each a patch of one of seven projections.

A plane's points (x, y) run over [−1, 1]², x to the right and y down. Its frame's rows are the directions to its right,
down and outward, so that kernels need to know a projection in one position only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.sphere.mappings.cubes import OUTWARD, CubeCross, Strip, VerticalCubeCross
from relume.sphere.mappings.discs import Angular, Fisheye, Hemispheres, MirrorBall
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.mappings.squares import EqualArea, Octahedral

LAT_LONG, EQUIDISTANT, EQUISOLID, ORTHOGRAPHIC, FLAT, OCTAHEDRAL, EQUAL_AREA = range(7)
_FRONT = np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1]], np.float64)
_BACK = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1]], np.float64)
_ABOVE = np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]], np.float64)


class Planes(NamedTuple):
    """What kernels need of an image.

    kind : LAT_LONG … EQUAL_AREA
    across, down : the projection's numbers: the angle at a disc's rim (EQUIDISTANT), the sine of half of it
        (EQUISOLID), or the tangents at the right and lower edge (FLAT)
    rows, columns : pixels of one plane
    stride : columns of the image
    origins : (P,) each plane's first pixel, counted along the image's rows
    frames : (P, 3, 3) float32, each plane's frame as seen in the first one's
    whole : whether the planes show the whole sphere
    """

    kind: int
    across: np.float32
    down: np.float32
    rows: int
    columns: int
    stride: int
    origins: np.ndarray
    frames: np.ndarray
    whole: bool


@dataclass(frozen=True, eq=False)
class Layout:
    """An image's planes and where they look.

    shape : rows and columns of the image
    frames : (P, 3, 3), rows right, down and outward in the world
    """

    shape: tuple[int, int]
    planes: Planes
    frames: np.ndarray

    @property
    def lines(self) -> int:
        """Rows of all planes together."""
        return self.planes.rows * len(self.frames)

    def turns(self, other: Layout, rotation: np.ndarray) -> np.ndarray:
        """(P, 3, 3) float32: what takes a direction in each plane's frame to `other`'s first, turned in the world."""
        return np.ascontiguousarray(other.frames[0] @ rotation @ self.frames.transpose(0, 2, 1), np.float32)


def layout(mapping: Mapping, size: int) -> Layout:
    """The planes of a mapping's image of `size` rows; raises ValueError for a mapping that is none of ours."""
    shape = mapping.shape(size)
    if isinstance(mapping, LatLong):
        return laid_out(LAT_LONG, shape, shape, _FRONT[None])
    if isinstance(mapping, Angular | MirrorBall | Fisheye):
        kind, rim = (EQUISOLID, np.sin(mapping.field / 4)) if mapping.equisolid else (EQUIDISTANT, mapping.field / 2)
        frame = _FRONT if mapping.pole < 0 else _BACK
        return laid_out(kind, shape, shape, frame[None], across=rim, whole=mapping.field == 2 * np.pi)
    if isinstance(mapping, Hemispheres):
        places = np.array([[0, 0], [0, size]])
        return laid_out(ORTHOGRAPHIC, shape, (size, size), np.stack([_FRONT, _BACK]), places)
    if isinstance(mapping, (CubeCross, VerticalCubeCross, Strip)):
        side = size // mapping.grid[0]
        frames = np.stack([mapping.axes.right, mapping.axes.down, OUTWARD], axis=1)
        return laid_out(FLAT, shape, (side, side), frames, mapping.cells * side)
    if isinstance(mapping, (Octahedral, EqualArea)):
        kind = OCTAHEDRAL if isinstance(mapping, Octahedral) else EQUAL_AREA
        return laid_out(kind, shape, shape, _ABOVE[None])
    raise ValueError(f"{mapping!r} cannot be resampled; expected one of the mappings of relume.sphere")


def laid_out(
    kind: int,
    shape: tuple[int, int],
    plane: tuple[int, int],
    frames: np.ndarray,
    places: np.ndarray = np.zeros((1, 2), int),
    *,
    across: float = 1.0,
    down: float = 1.0,
    whole: bool = True,
) -> Layout:
    """Planes of `plane` = (rows, columns) pixels whose first pixels are at `places`, (P, 2) row and column."""
    origins = np.ascontiguousarray(places[:, 0] * shape[1] + places[:, 1], np.int64)
    relative = np.ascontiguousarray(frames @ frames[0].T, np.float32)
    numbers = np.float32(across), np.float32(down)
    return Layout(shape, Planes(kind, *numbers, *plane, shape[1], origins, relative, whole), frames)
