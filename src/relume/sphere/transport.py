"""Moving light between two pixelations of the sphere so that nothing is lost and constant light stays constant.

The weights start as bilinear look-ups from cells of every target pixel and are balanced (Sinkhorn & Knopp 1967)
until each target pixel receives exactly its own solid angle and each source pixel gives exactly its own.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from relume.sphere.mappings import LatLong, Mapping, pixel_points

ROUNDS = 60
"""Balancing steps; the worst source pixel, near a pole, then gives within a thousandth of its solid angle."""
RELAXATION = 1.8
"""Power of each step, for plain steps (1) settle wide imbalances slowly: 1.8 leaves a tenth of the error or less."""


def balanced_transport(
    source: Mapping, source_size: int, target: Mapping, target_size: int, rotation: np.ndarray
) -> sparse.csr_array:
    """The matrix that turns radiance in `source`'s pixels into radiance in `target`'s, turned by `rotation`.

    Each row sums to 1; solid angles weigh each column to the source pixel's own. Pixels that show no direction
    are empty rows and columns.
    """
    # Cells small enough that no source pixel falls between them.
    subdivision = max(4, int(np.ceil(2 * source_size / target_size)))
    points = pixel_points(target, target_size, subdivision)
    directions = target.directions(points) @ rotation
    inside = ~np.isnan(directions[..., 0])
    down, across = points.shape[:2]
    rows, columns = np.arange(down)[:, None] // subdivision, np.arange(across)[None, :] // subdivision
    target_shape, source_shape = target.shape(target_size), source.shape(source_size)
    cell_pixel = (rows * target_shape[1] + columns)[inside]
    cell_weight = _cell_solid_angles(target, points)[inside]

    taps, weights = _bilinear_taps(source, source_size, source.image_points(directions[inside]))
    source_solid_angle = source.solid_angles(source_size).ravel()
    weights = weights * (source_solid_angle[taps] > 0) * cell_weight
    shape = (target_shape[0] * target_shape[1], source_shape[0] * source_shape[1])
    plan = sparse.coo_array((weights.ravel(), (np.tile(cell_pixel, 4), taps.ravel())), shape).tocsr()

    target_solid_angle = target.solid_angles(target_size).ravel() * (plan.sum(axis=1) > 0)
    transposed = plan.T.tocsr()
    give = np.ones(shape[1])
    receive = np.ones(shape[0])
    for _ in range(ROUNDS):
        receive = _relaxed(receive, _ratio(target_solid_angle, plan @ give))
        give = _relaxed(give, _ratio(source_solid_angle, transposed @ receive))
    receive = _ratio(target_solid_angle, plan @ give)
    scale = _ratio(receive, target_solid_angle)
    return sparse.csr_array(sparse.diags_array(scale) @ plan @ sparse.diags_array(give))


def _cell_solid_angles(mapping: Mapping, points: np.ndarray) -> np.ndarray:
    """The solid angle of every cell up to a common factor; balancing settles the rest."""
    if isinstance(mapping, LatLong):
        return np.sin(np.pi * points[..., 1])
    radius = np.hypot(2 * points[..., 0] - 1, 2 * points[..., 1] - 1)
    step = 1e-4
    near, far = np.clip(radius - step, 0, 1), np.clip(radius + step, 0, 1)
    z = [mapping.directions(np.stack([0.5 + r / 2, np.full_like(r, 0.5)], -1))[..., 2] for r in (near, far)]
    return np.abs(z[1] - z[0]) / np.maximum(far**2 - near**2, 1e-12)


def _bilinear_taps(mapping: Mapping, size: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Flat indices (4, N) of the pixels round each image point, and their weights."""
    _, width = mapping.shape(size)
    x, y = points[:, 0] * width - 0.5, points[:, 1] * size - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - left, y - top
    indices, weights = [], []
    for down, wy in ((0, 1 - fy), (1, fy)):
        for right, wx in ((0, 1 - fx), (1, fx)):
            row, column = top + down, left + right
            if isinstance(mapping, LatLong):
                # Over a pole the neighbour is in the same row, on the other side.
                beyond = (row < 0) | (row >= size)
                column = (column + beyond * (width // 2)) % width
            row, column = np.clip(row, 0, size - 1), np.clip(column, 0, width - 1)
            indices.append(row * width + column)
            weights.append(wy * wx)
    return np.stack(indices), np.stack(weights)


def _relaxed(before: np.ndarray, balanced: np.ndarray) -> np.ndarray:
    """From `before` past `balanced` (successive over-relaxation of the logarithms; Thibault et al. 2021)."""
    return before * _ratio(balanced, before) ** RELAXATION


def _ratio(wanted: np.ndarray, present: np.ndarray) -> np.ndarray:
    return np.divide(wanted, present, out=np.zeros_like(present), where=present > 0)
