"""Numbers that spread evenly over a square or a cube: Kronecker sequences, shifted by chance (Cranley 1976).

Roberts's generalised golden ratios are the steps ("The unreasonable effectiveness of quasirandom sequences", 2018).
Each number alone is uniform, so that what is summed with them has no bias.
"""

from __future__ import annotations

import numpy as np


def spread(random: np.random.Generator, count: int, dimensions: int, sets: int = 1) -> np.ndarray:
    """`sets` sequences of `count` points in [0, 1), each shifted by itself: (sets, count, dimensions)."""
    # The root of x^(d+1) = x + 1.
    ratio = 2.0
    for _ in range(64):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    points = (np.arange(1, count + 1)[:, None] * steps) % 1
    return (points + random.random((sets, 1, dimensions))) % 1


def cosine_directions(u: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Unit directions (…, 3) about unit normals (…, 3), as likely as their cosine; u : (…, 2) in [0, 1)."""
    radius, angle = np.sqrt(u[..., 0]), 2 * np.pi * u[..., 1]
    across, along = frames(normals)
    local = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - u[..., 0])
    directions = local[0][..., None] * across + local[1][..., None] * along + local[2][..., None] * normals
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def frames(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (…, 3) across each unit normal (…, 3) and each other (Duff et al. 2017)."""
    x, y, z = np.moveaxis(normals, -1, 0)
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    across = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    along = np.stack([b, sign + y * y * a, -y], axis=-1)
    return across, along


def within_triangles(u: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) spread evenly over triangles (N, 3, 3), and their weights (N, 3); u : (N, 2) in [0, 1)."""
    root = np.sqrt(u[:, 0])
    weights = np.stack([1 - root, root * (1 - u[:, 1]), root * u[:, 1]], axis=-1)
    return np.einsum("nk,nkx->nx", weights, corners), weights
