"""A camera's place as other programs write it: a matrix, an axis that points up and a unit of length."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from relume.errors import UnreadableFile, warn

UpAxis = Literal["y", "z"]
"""The axis of a file that points up."""
WORLD_FROM: dict[UpAxis, np.ndarray] = {
    "y": np.eye(3),
    # What Blender calls up is our +Y, and what it calls forward, its +Y, is our −Z.
    "z": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
}
"""Our frame from one in which the axis points up."""
UNEVEN = 1e-3
"""By how much the columns of a rotation may differ from unit length and right angles: single precision, with room."""
SAME_ASPECT = 0.01
"""The share by which width ∕ height may differ: a pixel of a hundred, as a reduced photograph has."""


def pose(path: Path, matrix: object, up: UpAxis, unit: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,), metres, and world-from-camera rotation (3, 3) in our frame.

    matrix : (4, 4) world-from-camera in the file's frame, of column vectors; the camera looks along −Z, +Y up; a scale
        that is even is left out
    up : the axis of the file's frame that points up
    unit : metres to a unit of the file
    Raises UnreadableFile for a matrix that is none, mirrors or shears.
    """
    try:
        placed = np.asarray(matrix, np.float64)
    except (TypeError, ValueError):
        placed = np.empty(0)
    if placed.shape != (4, 4) or not np.isfinite(placed).all():
        raise UnreadableFile(f"{path}: the camera's matrix is not 4 × 4 finite numbers; export it again")
    if not 0 < unit < np.inf:
        raise UnreadableFile(f"{path}: its unit of length is {unit} metres; export it in metres")
    lengths = np.linalg.norm(placed[:3, :3], axis=0)
    if not np.all(lengths > 0):
        raise UnreadableFile(f"{path}: the camera's matrix has no extent; export it again")
    turn = placed[:3, :3] / lengths
    even = np.ptp(lengths) <= UNEVEN * lengths.mean()
    if not even or not np.allclose(turn.T @ turn, np.eye(3), atol=UNEVEN) or np.linalg.det(turn) < 0:
        raise UnreadableFile(f"{path}: the camera is mirrored, sheared or scaled unevenly; apply its scale and export")
    left, _, right = np.linalg.svd(turn)
    return WORLD_FROM[up] @ placed[:3, 3] * unit, WORLD_FROM[up] @ left @ right


def the_only(path: Path, chosen: Sequence[Any], name: str | None, labels: Iterable[str]) -> Any:
    """The one camera that a file holds, or that has the name; raises UnreadableFile with the labels of all."""
    if len(chosen) == 1:
        return chosen[0]
    fault = "holds" if name is None else f"{len(chosen)} of its cameras are named {name!r}; it holds"
    raise UnreadableFile(f"{path}: {fault} {', '.join(map(repr, labels))}; give the name of one")


def require_aspect(path: Path, size: tuple[int, int], made_for: tuple[float, float]) -> None:
    """Raises UnreadableFile unless a file made for one picture has the aspect of the picture it is used with."""
    (width, height), (file_width, file_height) = size, made_for
    if not (file_width > 0 and file_height > 0):
        raise UnreadableFile(f"{path}: made for a picture of {file_width:g}×{file_height:g}; export it again")
    if abs(width * file_height / (height * file_width) - 1) > SAME_ASPECT:
        raise UnreadableFile(
            f"{path}: made for a picture of {file_width:g}×{file_height:g}, not {width}×{height}; make it from the "
            "plate itself, uncropped"
        )


def warn_of_aspect(path: Path, size: tuple[int, int], aspect: float, kept: str) -> None:
    """Warn where a camera's own width ∕ height is not that of the picture; `kept` says what stays."""
    width, height = size
    if abs(width / height / aspect - 1) > SAME_ASPECT:
        warn(
            f"{path}: the camera's aspect is {aspect:.3f}, the picture's {width / height:.3f}; {kept} is kept: check "
            "it against the photograph"
        )
