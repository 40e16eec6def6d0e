"""How unevenly each light shines over the picture, as patterns that are 1 on average.

The paper's spotlight was "calibrated to produce an even field of illumination across the subject's head" and its
cameras "for their flat-field response" (Debevec et al. 2000, §3.1). Lamps on a desk are nearer and not even: what they
give at a pixel, relative to their mean, is seen in pictures of a white board in the subject's place, or by where they
stand. `Corrected` divides by it. Patterns are smooth, so that a board's dust and grain stay out of the pictures.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.lightstage.acquire.near_lights import near_light
from relume.lightstage.field.field import ReflectanceField
from relume.sphere.directions import normalised

_CELLS = 24
"""A board's pictures are read as the medians of this many cells across the longer side."""
_DARK = 0.02
"""A cell is part of the board where it is this bright relative to the brightest tenth."""


class FallOff(Protocol):
    """How bright each light is at each pixel, relative to its mean over the picture (or to a point)."""

    def pattern(self, lights: slice, rows: slice) -> np.ndarray:
        """Relative irradiances (lights, rows, columns) float32, above 0."""
        ...


@dataclass(frozen=True, eq=False)
class FlatField:
    """Smooth patterns: the exponential of a polynomial in the picture's coordinates, which is never 0 or below.

    coefficients : (N, T), of the terms x^i y^j with i + j ≤ order, in the order of `exponents`; x to the right and y
        down, −1 and 1 at the ends of the longer side
    order : of the polynomials
    shape : rows and columns of the pictures
    """

    coefficients: np.ndarray
    order: int
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        terms = len(exponents(self.order))
        if self.coefficients.ndim != 2 or self.coefficients.shape[1] != terms:
            raise ValueError(
                f"coefficients are {self.coefficients.shape}; a polynomial of order {self.order} has {terms} a light"
            )

    def pattern(self, lights: slice, rows: slice) -> np.ndarray:
        terms = _terms(*_coordinates(self.shape, rows), self.order)
        return np.exp(np.einsum("nt,tyx->nyx", self.coefficients[lights], terms)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class NearLights:
    """The patterns of lamps that stand near: as 1/d², relative to what they give at the subject's centre.

    positions : (N, 3) of the lights, world, metres
    points : (H, W, 3) of the surface seen by each pixel, world, metres (`near_lights.points_on_plane`, or a depth
        map's); NaN where unknown, and the pattern 1 there
    centre : (3,) where a pattern is 1, and where the lamps point
    beam : m of a lamp whose intensity goes as cosᵐ of the angle to its axis; 0 shines alike all around, 1 is a flat
        matte panel
    """

    positions: np.ndarray
    points: np.ndarray
    centre: np.ndarray
    beam: float = 0.0

    def __post_init__(self) -> None:
        if self.positions.ndim != 2 or self.positions.shape[1] != 3 or self.points.ndim != 3 or self.beam < 0:
            raise ValueError(
                f"positions {self.positions.shape}, points {self.points.shape} and a beam of {self.beam}; expected "
                "(N, 3), (H, W, 3) and a number that is not below 0"
            )
        if not (np.linalg.norm(self.positions - self.centre, axis=1) > 0).all():
            raise ValueError("a light stands in the subject's centre; give its position in metres from there")

    def pattern(self, lights: slice, rows: slice) -> np.ndarray:
        return np.stack([self._of_one(position, self.points[rows]) for position in self.positions[lights]])

    def _of_one(self, position: np.ndarray, points: np.ndarray) -> np.ndarray:
        towards, spread = near_light(position, points, self.centre)
        if self.beam:
            axis = normalised(position - self.centre)
            aligned = towards @ axis
            if np.any(aligned <= 0):
                raise ValueError("a point of the surface lies behind a light that shines to one side; set beam to 0")
            spread = spread * aligned**self.beam
        # Where no point is known the light is taken as it is at the centre.
        return np.where(np.isnan(spread), 1.0, spread).astype(np.float32)


def flat_field_of_board(board: ReflectanceField, *, order: int = 2, pixels: np.ndarray | None = None) -> FlatField:
    """The patterns of lights from pictures of a white board that stands where the subject will.

    board : the board under each light, in the subject's lights' order
    order : of the polynomial in the logarithm; 2 follows 1/d² of a lamp twice as far as the board is wide to 1.2 %
    pixels : (H, W) bool, where the board is seen; else wherever the pictures are not dark
    A light that the board does not show keeps an even pattern, and a warning counts such lights. Raises ValueError for
    a mask of another size and for an order that the board's cells do not determine.

    A board shows the irradiance times n·l of its own normal: fair for surfaces that face the camera as it does.
    """
    shape = board.shape
    if pixels is not None and (pixels.shape != shape or pixels.dtype != bool):
        raise ValueError(f"pixels are {pixels.shape} {pixels.dtype}; expected {shape} bool")
    if not 1 <= order <= 4:
        raise ValueError(f"a polynomial of order {order}; expected 1 to 4: more would follow the board's dust")
    across, down = _cell_edges(shape)
    x, y = _coordinates(shape, slice(0, shape[0]))
    coefficients, unseen = np.zeros((len(board.lights), len(exponents(order)))), 0
    everywhere = _terms(x, y, order)
    middles = [_cell_medians(c if pixels is None else np.where(pixels, c, np.nan), across, down) for c in (x, y)]
    for light in range(len(board.lights)):
        picture = board.block(slice(light, light + 1), slice(0, shape[0]))[0].mean(axis=-1, dtype=np.float64)
        levels = _cell_medians(np.where(pixels, picture, np.nan) if pixels is not None else picture, across, down)
        with np.errstate(invalid="ignore"):
            lit = levels > _DARK * np.nan_to_num(levels, nan=0.0).max()
        if lit.sum() < 2 * coefficients.shape[1] or not levels[lit].max() > 0:
            unseen += 1
            continue
        cells = _terms(middles[0], middles[1], order)[:, lit]
        # The error of a logarithm is relative, so that a cell counts by its brightness.
        weights = levels[lit]
        coefficients[light] = np.linalg.lstsq((cells * weights).T, np.log(levels[lit]) * weights, rcond=None)[0]
        pattern = np.exp(np.tensordot(coefficients[light], everywhere, 1))
        coefficients[light, 0] -= np.log(pattern[pixels].mean() if pixels is not None else pattern.mean())
    if unseen == len(board.lights):
        raise ValueError("the board is dark under every light; check its pictures and its mask")
    if unseen:
        warnings.warn(f"{unseen} of {len(board.lights)} lights do not show on the board; taken as even", stacklevel=2)
    return FlatField(coefficients, order, shape)


def exponents(order: int) -> list[tuple[int, int]]:
    """The exponents (i, j) of x and y in a polynomial's terms, the constant first."""
    return [(total - j, j) for total in range(order + 1) for j in range(total + 1)]


def _coordinates(shape: tuple[int, int], rows: slice) -> tuple[np.ndarray, np.ndarray]:
    """x and y (rows, columns) of pixel centres, −1 and 1 at the ends of the longer side."""
    height, width = shape
    x = (2 * np.arange(width) + 1 - width) / max(shape)
    y = ((2 * np.arange(height) + 1 - height) / max(shape))[rows]
    across, down = np.broadcast_arrays(x[None, :], y[:, None])
    return across, down


def _terms(x: np.ndarray, y: np.ndarray, order: int) -> np.ndarray:
    return np.stack([x**i * y**j for i, j in exponents(order)])


def _cell_edges(shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Column and row edges of cells that are about square."""
    size = max(1.0, max(shape) / _CELLS)
    height, width = shape
    return (
        np.unique(np.linspace(0, width, int(np.ceil(width / size)) + 1).astype(int)),
        np.unique(np.linspace(0, height, int(np.ceil(height / size)) + 1).astype(int)),
    )


def _cell_medians(picture: np.ndarray, across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """The median of each cell (cells down, cells across); NaN where less than half of a cell is known."""
    result = np.full((len(down) - 1, len(across) - 1), np.nan)
    for row in range(len(down) - 1):
        for column in range(len(across) - 1):
            cell = picture[down[row] : down[row + 1], across[column] : across[column + 1]].ravel()
            known = cell[np.isfinite(cell)]
            if 2 * len(known) >= len(cell):
                result[row, column] = np.median(known)
    return result
