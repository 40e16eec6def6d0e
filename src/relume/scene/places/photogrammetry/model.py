"""What every program of photogrammetry gives: cameras and points in a frame and a unit of its own."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.scene.cameras.distortion import Distortion

SQUARE = 0.005
"""Share by which the two focal lengths of a camera may differ: pixels of lenses that were fitted are square to that."""
DOWN_AND_AHEAD = np.diag([1.0, -1.0, -1.0])
"""Our camera's axes, right, up and backward, from those of computer vision: right, down and ahead."""


@dataclass(frozen=True, eq=False)
class FoundView:
    """A photograph's camera as the program has it.

    name : the picture's file
    size : pixels; focal, centre : pixels from the upper left corner
    rotation : (3, 3) camera-from-world, rows right, down and ahead
    position : (3,) in the program's unit
    """

    name: str
    size: tuple[int, int]
    focal: float
    centre: tuple[float, float]
    rotation: np.ndarray
    position: np.ndarray
    distortion: Distortion | None = None


@dataclass(frozen=True, eq=False)
class FoundModel:
    """All cameras, and the points (N, 3) with their numbers (N,), in the program's frame and unit.

    up : (3,) what a program without a sense of gravity has pointing up, where its first camera was level
    scaled : whether its unit is the metre
    """

    views: tuple[FoundView, ...]
    points: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    numbers: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    scaled: bool = False


def one_focal_length(path: Path, what: str, across: float, down: float) -> float:
    """The focal length of square pixels; refuses others, as no camera here has them."""
    if not (0 < across < np.inf and 0 < down < np.inf):
        raise UnreadableFile(f"{path}: {what} has focal lengths {across:g} and {down:g}; expected pixels above 0")
    apart = abs(across / down - 1)
    if apart > SQUARE:
        raise UnreadableFile(
            f"{path}: {what} has focal lengths {across:g} and {down:g} pixels, so that its pixels are not square; "
            "undistort the photographs first, or fit one focal length"
        )
    if apart > 1e-9:
        warn(f"{path}: {what} has focal lengths {across:g} and {down:g} pixels; their mean is used for both")
    return 0.5 * (across + down)


def lens_of(k1: float = 0.0, k2: float = 0.0, p1: float = 0.0, p2: float = 0.0, k3: float = 0.0) -> Distortion | None:
    """The distortion, or None where all is 0."""
    return Distortion(k1, k2, p1, p2, k3) if any((k1, k2, p1, p2, k3)) else None
