"""The scale of a photographed place: a length on the ground, an upright one, or the camera's height."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.scene.cameras.camera import Camera

Point = tuple[float, float]


class KnownLength(Protocol):
    """A length that was measured at the place."""

    def metres_per_unit(self, camera: Camera) -> float:
        """Metres to the unit a camera was placed in, the ground at y = 0; raises ValueError where it shows none."""
        ...


@dataclass(frozen=True)
class GroundLength:
    """The distance between two points of the ground y = 0.

    start, end : where the photograph shows them, pixels from the upper left corner
    metres : between them
    """

    start: Point
    end: Point
    metres: float

    def __post_init__(self) -> None:
        _check(self.metres, self.start, self.end)

    def metres_per_unit(self, camera: Camera) -> float:
        return self.metres / float(np.linalg.norm(on_ground(camera, self.end) - on_ground(camera, self.start)))


@dataclass(frozen=True)
class UprightLength:
    """The height of something that stands on the ground.

    foot : where the photograph shows the point of the ground that it stands on, pixels
    top : where it shows the point straight above
    metres : between them
    """

    foot: Point
    top: Point
    metres: float

    def __post_init__(self) -> None:
        _check(self.metres, self.foot, self.top)

    def metres_per_unit(self, camera: Camera) -> float:
        foot = on_ground(camera, self.foot)
        ray = camera.rays_through(np.asarray(self.top, np.float64))
        # The height at which the upright comes nearest to the ray, both in the plane that holds neither's end.
        level = ray[[0, 2]]
        away = (foot - camera.position)[[0, 2]]
        if not level @ away > 0:
            raise ValueError(f"upright top {_written(self.top)} lies behind its foot; is it the point straight above?")
        height = camera.position[1] + ray[1] * (level @ away) / (level @ level)
        if not height > 0:
            raise ValueError(f"upright top {_written(self.top)} lies below its foot {_written(self.foot)}; swap them")
        return self.metres / float(height)


@dataclass(frozen=True)
class CameraHeight:
    """The height of the lens above the ground, metres: the easiest length to measure with a tape."""

    metres: float

    def __post_init__(self) -> None:
        if not 0 < self.metres < np.inf:
            raise ValueError(f"a camera height of {self.metres}; expected metres above 0")

    def metres_per_unit(self, camera: Camera) -> float:
        return self.metres / float(camera.position[1])


def on_ground(camera: Camera, point: Point) -> np.ndarray:
    """The point (3,) of the ground y = 0 that the photograph shows at `point`; raises ValueError where it is none."""
    ray = camera.rays_through(np.asarray(point, np.float64))
    if not ray[1] < 0:
        raise ValueError(f"point {_written(point)} lies above the horizon; expected a point of the ground")
    return camera.position - camera.position[1] / ray[1] * ray


def _written(point: Point) -> str:
    return f"{point[0]:g}, {point[1]:g}"


def _check(metres: float, first: Point, second: Point) -> None:
    if not 0 < metres < np.inf:
        raise ValueError(f"a length of {metres}; expected metres above 0")
    if np.hypot(second[0] - first[0], second[1] - first[1]) < 2:
        raise ValueError(f"points {_written(first)} and {_written(second)} of a length are less than 2 pixels apart")
