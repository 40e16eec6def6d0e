"""Directions and rotations: the one statement of our frame.

World: right-handed, +Y up, metres. A camera looks along −Z with +X to its right. Directions are unit vectors
(…, 3); angles are radians; rotations are active 3×3 matrices, so `directions @ rotation.T` turns directions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

UP = np.array([0.0, 1.0, 0.0])


def lengths(vectors: np.ndarray) -> np.ndarray:
    """(…) of vectors (…, 3), float64: NumPy's norm, to the bit, in a fifth of its time."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.sqrt(x * x + y * y + z * z)


def normalised(vectors: ArrayLike) -> np.ndarray:
    """Vectors (…, 3) scaled to unit length."""
    array = np.asarray(vectors, np.float64)
    return array / lengths(array)[..., None]


def angle_between(first: ArrayLike, second: ArrayLike) -> np.ndarray:
    """Radians (…) between unit vectors (…, 3), as accurate for nearly equal ones as for any (Kahan 2006, §12)."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    return 2 * np.arctan2(lengths(first - second), lengths(first + second))


def rotation_angle(rotation: np.ndarray) -> float:
    """Radians by which a rotation matrix (3, 3) turns, 0 to π, accurate for small ones too."""
    twice_sine = np.linalg.norm(rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]])
    return float(np.arctan2(twice_sine, np.trace(rotation) - 1))


def rotation_about(axis: ArrayLike, angle: float) -> np.ndarray:
    """The active rotation by `angle` radians about `axis`, right-handed (Rodrigues' formula)."""
    x, y, z = normalised(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def required_rotation(matrix: ArrayLike) -> np.ndarray:
    """The matrix (3, 3) itself, float64; raises ValueError where it is not orthonormal or mirrors."""
    rotation = np.asarray(matrix, np.float64)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6):
        raise ValueError(f"a rotation of {np.round(rotation, 3).tolist()}; expected an orthonormal (3, 3) matrix")
    if np.linalg.det(rotation) < 0:
        raise ValueError("the matrix mirrors; expected a rotation, whose determinant is 1")
    return rotation


def rotation_from_vector(vector: np.ndarray) -> np.ndarray:
    """The rotation whose axis is `vector` and whose angle, in radians, is its length."""
    angle = float(np.linalg.norm(vector))
    return np.eye(3) if angle == 0 else rotation_about(vector, angle)


def rotation_between(start: ArrayLike, end: ArrayLike) -> np.ndarray:
    """The smallest rotation that turns direction `start` into direction `end`."""
    start, end = normalised(start), normalised(end)
    axis, cosine = np.cross(start, end), float(start @ end)
    if cosine < -1 + 1e-12:
        return rotation_about(np.cross(start, np.eye(3)[np.argmin(np.abs(start))]), np.pi)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def look_at(position: ArrayLike, target: ArrayLike) -> np.ndarray:
    """World-from-camera rotation of a camera at `position` that looks at `target` with a level horizon.

    Its columns are the camera's right (+X), up (+Y) and backward (+Z) axes in the world.
    Raises ValueError when the camera looks straight up or down: "level" says nothing there.
    """
    backward = np.asarray(position, np.float64) - np.asarray(target, np.float64)
    right = np.cross(UP, backward)
    if np.linalg.norm(right) < 1e-9 * max(np.linalg.norm(backward), 1e-30):
        raise ValueError(f"a camera at {position} looking at {target} has no level horizon; move it sideways")
    backward, right = normalised(backward), normalised(right)
    return np.stack([right, np.cross(backward, right), backward], axis=1)
