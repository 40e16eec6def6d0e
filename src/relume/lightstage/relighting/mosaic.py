"""Mosaics of reflectance functions: how a sampling of pixels answers to light from everywhere (Debevec et al. 2000).

Each pixel of the sampling is drawn as its reflectance function R_xy(θ, φ) (eq. 2; Figs. 3 and 4), a small lat-long
picture over the directions of the light. "The middle of each function corresponds to the pixel being illuminated from
the direction of the camera; as one moves within the reflectance function the light direction moves in the same manner":
right in it is light from the camera's right, up is light from above, its left and right edges are light from behind.
Values are the field's, linear; the paper shows its own four times as bright.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera
from relume.sphere.mappings.mapping import LatLong, pixel_directions

# Lat-long maps have −Z in their middle and +X to its right, as seen from inside; seen from the camera the light that
# comes from it is in the middle, and what is to its right is to the right.
_FRONT = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True, eq=False)
class Mosaic:
    """Reflectance functions side by side.

    radiance : (H, W, 3) float32, per unit irradiance, black between the functions
    points : (m, n, 2) int, column and row in the field of the pixel that each function is of
    function_shape : rows and columns of one function
    gap : pixels between two
    """

    radiance: np.ndarray
    points: np.ndarray
    function_shape: tuple[int, int]
    gap: int

    def corner(self, down: int, across: int) -> tuple[int, int]:
        """Row and column of the upper left pixel of a function, the one of `points[down, across]`."""
        return down * (self.function_shape[0] + self.gap), across * (self.function_shape[1] + self.gap)

    def function(self, down: int, across: int) -> np.ndarray:
        """One function, (rows, columns, 3)."""
        (row, column), (rows, columns) = self.corner(down, across), self.function_shape
        return self.radiance[row : row + rows, column : column + columns]


def mosaic(
    field: ReflectanceField,
    down: int = 15,
    across: int = 15,
    *,
    mask: np.ndarray | None = None,
    size: int | None = None,
    gap: int = 1,
) -> Mosaic:
    """The reflectance functions of an even sampling of pixels, `down` × `across` of them.

    field : whose functions are drawn
    down, across : how many pixels are sampled each way; the paper samples 44 rows of 15 from 720 rows of 480 (Fig. 3)
    mask : (H, W) bool, the subject: its bounding box is what is sampled; all of the picture unless given
    size : rows of a function; unless given, those of the stage's grid, or about one pixel a light
    gap : black pixels between functions
    Raises ValueError for a sampling finer than the pixels.
    """
    points = sampled_points(field.shape, down, across, mask)
    order = function_lights(field.lights, field.camera, size)
    rows, columns = order.shape
    picture = np.zeros((down * (rows + gap) - gap, across * (columns + gap) - gap, 3), np.float32)
    lights = slice(0, len(field.lights))
    for i in range(down):
        row = int(points[i, 0, 1])
        values = field.block(lights, slice(row, row + 1))[:, 0]
        for j in range(across):
            corner = i * (rows + gap), j * (columns + gap)
            picture[corner[0] : corner[0] + rows, corner[1] : corner[1] + columns] = values[order, points[i, j, 0]]
    return Mosaic(picture, points, (rows, columns), gap)


def mosaic_size(shape: tuple[int, int]) -> tuple[int, int]:
    """Functions down and across for pictures of a shape (rows, columns): 20 along the longer side."""
    scale = 20 / max(shape)
    return max(2, min(shape[0], round(shape[0] * scale))), max(2, min(shape[1], round(shape[1] * scale)))


def reflectance_function(field: ReflectanceField, column: int, row: int, size: int | None = None) -> np.ndarray:
    """The reflectance function of one pixel, (rows, columns, 3) float32 (Debevec et al. 2000, §3.2).

    field : whose function is drawn
    column, row : of the pixel
    size : rows of the function, as of `mosaic`
    Raises ValueError for a pixel outside of the pictures.
    """
    height, width = field.shape
    if not (0 <= column < width and 0 <= row < height):
        raise ValueError(f"pixel ({column}, {row}) lies outside the pictures of {width}×{height}")
    values = field.block(slice(0, len(field.lights)), slice(row, row + 1))[:, 0, column]
    return values[function_lights(field.lights, field.camera, size)]


def sampled_points(shape: tuple[int, int], down: int, across: int, mask: np.ndarray | None = None) -> np.ndarray:
    """Column and row, (down, across, 2) int, of pixels evenly spread over a picture or a mask's bounding box."""
    top, left, bottom, right = 0, 0, *shape
    if mask is not None:
        if mask.shape != shape or not mask.any():
            raise ValueError(f"the mask is {mask.shape}; expected {shape}, with pixels of the subject")
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    if not (1 <= down <= bottom - top and 1 <= across <= right - left):
        raise ValueError(f"{down}×{across} functions of {bottom - top}×{right - left} pixels; expected from 1 to that")
    row = top + np.floor((np.arange(down) + 0.5) * (bottom - top) / down).astype(int)
    column = left + np.floor((np.arange(across) + 0.5) * (right - left) / across).astype(int)
    return np.stack(np.broadcast_arrays(column[None, :], row[:, None]), axis=-1)


def function_lights(lights: StageLights, camera: Camera | None = None, size: int | None = None) -> np.ndarray:
    """Which light each pixel of a reflectance function shows, (rows, columns) int.

    A grid's lights stand as they are, rows by inclination and columns by azimuth, turned until the camera's azimuth is
    in the middle. Scattered lights are drawn as their cells, in the camera's own frame.

    camera : one on +Z that looks along −Z where none is known
    size : rows; a grid is drawn as its cells where they differ from its own
    """
    frame = np.eye(3) if camera is None else camera.rotation
    front = frame[:, 2] * [1, 0, 1]
    if lights.grid is not None and size in (None, lights.grid[0]) and np.linalg.norm(front) > 1e-6:
        return _grid(lights.directions, lights.grid, front)
    rows = max(4, round(np.sqrt(len(lights) / 2))) if size is None else size
    towards = pixel_directions(LatLong(), rows) @ _FRONT @ frame.T
    return np.asarray(KDTree(lights.directions).query(towards)[1])


def _grid(directions: np.ndarray, grid: tuple[int, int], front: np.ndarray) -> np.ndarray:
    """The lights of a grid, its columns by azimuth about +Y, 0 in the middle towards `front` and growing rightwards."""
    order = np.arange(grid[0] * grid[1]).reshape(grid)
    middle = directions[order].sum(axis=0)
    azimuth = np.arctan2(middle @ np.cross([0.0, 1.0, 0.0], front), middle @ front)
    return order[:, np.argsort(azimuth, kind="stable")]
