"""What the fovea averages: a picture in samples of one degree, and how such a grid lies over the picture.

A sample is an equal share of a flat picture's width and height; one in the middle covers a degree, those beside it
less, by the cube of the cosine of their angle (Ward Larson et al. 1997, eq. 1).
"""

from __future__ import annotations

import numpy as np

from relume.image.bands import in_threads
from relume.virtual_camera.tone.histogram.kernels import averaged
from relume.virtual_camera.view import View

FOVEA = np.radians(1.0)
"""The angle over which the eye adapts as one (Ward Larson et al. 1997, §4.1)."""


def foveal_shape(shape: tuple[int, int], view: View) -> tuple[int, int]:
    """Rows and columns of the foveal samples of a picture of (H, W) pixels: at least one, at most the pixels.

    A picture θ wide has 2·tan(θ/2)/1° of them (Ward Larson et al. 1997, eq. 1).
    """
    rows, columns = (min(max(round(side / (view.focal_length * FOVEA)), 1), side) for side in shape)
    return rows, columns


def foveal_samples(picture: np.ndarray, view: View, shape: tuple[int, int] | None = None) -> np.ndarray:
    """(h, w, 3) float32, the plain mean of a picture (H, W, 3) within each sample, in its unit.

    shape : rows and columns; None for samples of one degree
    """
    height, width = picture.shape[:2]
    rows, columns = shape or foveal_shape((height, width), view)
    samples = np.empty((rows, columns, 3), np.float32)
    tops, lefts = edges(height, rows), edges(width, columns)
    in_threads(lambda begin, end: averaged(picture, tops, lefts, begin, end, samples), rows, chunk=1)
    return samples


def edges(pixels: int, samples: int) -> np.ndarray:
    """(samples + 1,) int64, where each sample begins: a pixel belongs to that in which its upper left corner lies."""
    return -(-np.arange(samples + 1) * pixels // samples)


def directions(shape: tuple[int, int], picture: tuple[int, int], view: View) -> np.ndarray:
    """(h, w, 3) unit vectors to the middles of the samples: right, down, ahead.

    shape : rows and columns of the samples
    picture : rows and columns of its pixels
    """
    (rows, columns), (height, width) = shape, picture
    y = ((np.arange(rows) + 0.5) / rows - 0.5) * height / view.focal_length
    x = ((np.arange(columns) + 0.5) / columns - 0.5) * width / view.focal_length
    rays = np.stack(np.broadcast_arrays(x, y[:, None], 1.0), -1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)


def between(pixels: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """For every pixel of one axis the sample before its middle and the next one's share, for a bilinear look-up.

    Both of one sample are that sample; beyond the outermost middles the grid goes on as it ends.
    """
    place = np.clip((np.arange(pixels) + 0.5) * samples / pixels - 0.5, 0, samples - 1)
    first = np.minimum(place.astype(np.int64), max(samples - 2, 0))
    return first, (place - first).astype(np.float32)


def adaptation_grid(adaptation_luminance: np.ndarray | float) -> np.ndarray:
    """A luminance of adaptation as a grid (h, w) float64, cd/m²: a single one covers the picture.

    Raises ValueError for another number of axes, and for values that are not finite or below 0.
    """
    grid = np.asarray(adaptation_luminance, np.float64)
    grid = grid[None, None] if grid.ndim == 0 else grid
    if grid.ndim != 2 or not grid.size or not np.all(np.isfinite(grid) & (grid >= 0)):
        raise ValueError(
            f"the adaptation luminance is {grid.shape}; expected one number or a grid (h, w) over the picture, cd/m², "
            "finite and not below 0"
        )
    return grid
