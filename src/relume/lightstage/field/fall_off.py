"""How unevenly each light shines over the picture, as patterns that are 1 on average.

The paper's spotlight was "calibrated to produce an even field of illumination across the subject's head" and its
cameras "for their flat-field response" (Debevec et al. 2000, §3.1). Lamps on a desk are nearer and not even: what they
give at a pixel, relative to their mean, is seen in pictures of a white board in the subject's place, or by where they
stand. `Corrected` divides by it. Patterns are smooth, so that a board's dust and grain stay out of the pictures.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.errors import warn
from relume.lightstage.field.field import ReflectanceField
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

_CELLS = 24
"""A board's pictures are read as the medians of this many cells across the longer side."""
_DARK = 0.02
"""A cell is part of the board where it is this bright relative to the brightest tenth."""


@dataclass(frozen=True, eq=False)
class FlatField:
    """Smooth patterns: the exponential of a quadratic in the picture's coordinates, which is never 0 or below.

    A quadratic in the logarithm follows 1/d² of a lamp twice as far as the picture is wide to 1.2 %.

    coefficients : (N, 6), of 1, x, y, x², xy and y²; x to the right and y down, −1 and 1 at the ends of the longer side
    shape : rows and columns of the pictures
    """

    coefficients: np.ndarray
    shape: tuple[int, int]

    def pattern(self, lights: slice, rows: slice) -> np.ndarray:
        """Relative irradiances (lights, rows, columns) float32, above 0; their mean over the picture is 1."""
        terms = _terms(*_coordinates(self.shape, rows))
        return np.exp(np.einsum("nt,tyx->nyx", self.coefficients[lights], terms)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class NearLights:
    """The patterns of lamps that stand near: as 1/d², relative to what they give at the subject's centre.

    positions : (N, 3) of the lights, world, metres
    points : (H, W, 3) of the surface seen by each pixel, world, metres; NaN where unknown, and the pattern 1 there
    centre : (3,) where a pattern is 1
    """

    positions: np.ndarray
    points: np.ndarray
    centre: np.ndarray

    def pattern(self, lights: slice, rows: slice) -> np.ndarray:
        """Irradiances (lights, rows, columns) float32 relative to those at the centre."""
        return np.stack([self._of_one(position, self.points[rows]) for position in self.positions[lights]])

    def _of_one(self, position: np.ndarray, points: np.ndarray) -> np.ndarray:
        square = ((position - points) ** 2).sum(axis=-1)
        reference = float(((self.centre - position) ** 2).sum())
        if reference == 0 or np.any(square == 0):
            raise ValueError(f"the light at {position.tolist()} stands in the subject; give metres, world")
        # Where no point is known the light is taken as it is at the centre.
        return np.where(np.isnan(square), 1.0, reference / square).astype(np.float32)


def points_on_plane(camera: Camera, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The points (H, W, 3) of a plane that a camera's pixels see, metres; NaN where they see none.

    point, normal : of the plane, world
    """
    rays = camera.rays()
    facing = rays @ normalised(normal)
    height = float((np.asarray(point, np.float64) - camera.position) @ normalised(normal))
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(height / facing > 0, height / facing, np.nan)
    return camera.position + along[..., None] * rays


def flat_field_of_board(board: ReflectanceField) -> FlatField:
    """The patterns of lights from pictures of a white board that stands where the subject will.

    board : the board under each light, in the subject's lights' order; it is where the pictures are not dark
    A light that the board does not show keeps an even pattern, and a warning counts such lights. Raises ValueError
    where all are such.

    A board shows the irradiance times n·l of its own normal: fair for surfaces that face the camera as it does.
    """
    shape = board.shape
    x, y = _coordinates(shape, slice(0, shape[0]))
    everywhere = _terms(x, y)
    in_cells = _terms(_cell_medians(x), _cell_medians(y))
    coefficients, unseen = np.zeros((len(board.lights), len(everywhere))), 0
    for light in range(len(board.lights)):
        picture = board.block(slice(light, light + 1), slice(0, shape[0]))[0].mean(axis=-1, dtype=np.float64)
        levels = _cell_medians(picture)
        lit = levels > _DARK * levels.max()
        if lit.sum() < 2 * coefficients.shape[1] or not levels[lit].max() > 0:
            unseen += 1
            continue
        cells = in_cells[:, lit]
        # The error of a logarithm is relative, so that a cell counts by its brightness.
        weights = levels[lit]
        coefficients[light] = np.linalg.lstsq((cells * weights).T, np.log(levels[lit]) * weights, rcond=None)[0]
        coefficients[light, 0] -= np.log(np.exp(np.tensordot(coefficients[light], everywhere, 1)).mean())
    if unseen == len(board.lights):
        raise ValueError("the board is dark under every light; check its pictures")
    if unseen:
        warn(f"{unseen} of {len(board.lights)} lights do not show on the board; taken as even")
    return FlatField(coefficients, shape)


def _coordinates(shape: tuple[int, int], rows: slice) -> tuple[np.ndarray, np.ndarray]:
    """x and y (rows, columns) of pixel centres, −1 and 1 at the ends of the longer side."""
    height, width = shape
    x = (2 * np.arange(width) + 1 - width) / max(shape)
    y = ((2 * np.arange(height) + 1 - height) / max(shape))[rows]
    across, down = np.broadcast_arrays(x[None, :], y[:, None])
    return across, down


def _terms(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _cell_medians(picture: np.ndarray) -> np.ndarray:
    """The medians (cells down, cells across) of cells that are about square."""
    cell = max(1.0, max(picture.shape) / _CELLS)
    down, across = (
        np.unique(np.linspace(0, pixels, int(np.ceil(pixels / cell)) + 1).astype(int)) for pixels in picture.shape
    )
    return np.array(
        [
            [np.median(picture[top:bottom, left:right]) for left, right in pairwise(across)]
            for top, bottom in pairwise(down)
        ]
    )
