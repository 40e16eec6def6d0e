"""Parts of a picture at the scale a task needs, so that a picture of 24 megapixels costs no more than one of one.

Pixel coordinates: x right, y down, (0, 0) the outer corner of the first pixel, in the picture and in its parts alike.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from relume.image.colour import luminance
from relume.probe.ball.silhouette import Outline, cone_through, outline_of

LEAST_SIDE = 128
"""Longer side, in pixels, at which halving ends."""
SMALLEST, MOST_ENLARGED = 48.0, 4.0
"""Radius, in pixels, below which a ball is enlarged before its rim is followed, and how many times at most."""


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a picture, reduced or enlarged.

    light : (h, w) luminance
    corner : (x, y) of its upper left corner in the whole picture
    scale : (across, down) its pixels for each of the whole picture's
    size, focal_length : what its principal point and its focal length would be a whole picture's of; see `Cone`
    """

    light: np.ndarray
    corner: tuple[float, float]
    scale: tuple[float, float]
    size: tuple[float, float]
    focal_length: float

    @property
    def factor(self) -> float:
        """Its pixels for each of the whole picture's, the mean of both ways."""
        return float(np.sqrt(self.scale[0] * self.scale[1]))

    def whole(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 2) of the window, in the whole picture."""
        return np.asarray(points) / np.array(self.scale) + np.array(self.corner)

    def whole_circle(self, circle: tuple[float, float, float]) -> tuple[float, float, float]:
        """A circle (x, y, radius) of the window, in the whole picture."""
        (x, y), factor = self.whole(np.array(circle[:2])).tolist(), self.factor
        return x, y, circle[2] / factor

    def part(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 2) of the whole picture, in the window."""
        return (np.asarray(points) - np.array(self.corner)) * np.array(self.scale)


@dataclass(frozen=True, eq=False)
class Pyramid:
    """A picture's luminance at halving sizes, the finest first.

    focal_length : pixels of the finest; the principal point is the picture's middle
    """

    levels: tuple[np.ndarray, ...]
    focal_length: float

    @staticmethod
    def of(radiance: np.ndarray, focal_length: float) -> Pyramid:
        """Of radiance (H, W, 3); each level's pixels hold the mean of those below them."""
        light = np.ascontiguousarray(luminance(radiance), np.float32)
        # What is no light is none: neither holes nor negative noise reach the means.
        light = np.maximum(np.nan_to_num(light, nan=0.0, posinf=float(np.finfo(np.float32).max) / 1e6), 0)
        levels = [light]
        while max(levels[-1].shape) > 2 * LEAST_SIDE:
            height, width = levels[-1].shape
            size = (max(width // 2, 1), max(height // 2, 1))
            levels.append(cv2.resize(levels[-1], size, interpolation=cv2.INTER_AREA))
        return Pyramid(tuple(levels), focal_length)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the whole picture."""
        return self.levels[0].shape[1], self.levels[0].shape[0]

    def window(self, centre: tuple[float, float], reach: float, factor: float) -> Window:
        """What lies up to `reach` pixels to all sides of a place, `factor` pixels for one of the picture's."""
        level = 0
        while level + 1 < len(self.levels) and self._scale(level + 1)[0] >= factor:
            level += 1
        across, down = self._scale(level)
        height, width = self.levels[level].shape
        left, right = (int(np.clip(round((centre[0] + s * reach) * across), 0, width)) for s in (-1, 1))
        top, bottom = (int(np.clip(round((centre[1] + s * reach) * down), 0, height)) for s in (-1, 1))
        part = self.levels[level][top : max(bottom, top + 2), left : max(right, left + 2)]
        size = (max(round(part.shape[1] * factor / across), 2), max(round(part.shape[0] * factor / down), 2))
        smaller = size[0] <= part.shape[1] and size[1] <= part.shape[0]
        how = cv2.INTER_AREA if smaller else cv2.INTER_CUBIC
        light = part if size == part.shape[::-1] else cv2.resize(part, size, interpolation=how)
        scale = (across * size[0] / part.shape[1], down * size[1] / part.shape[0])
        corner = (left / across, top / down)
        # Twice the principal point, as a whole picture would have it in the middle.
        virtual = (self.size[0] - 2 * corner[0]) * scale[0], (self.size[1] - 2 * corner[1]) * scale[1]
        focal_length = self.focal_length * float(np.sqrt(scale[0] * scale[1]))
        return Window(np.maximum(light, 0), corner, scale, virtual, focal_length)

    def _scale(self, level: int) -> tuple[float, float]:
        height, width = self.levels[level].shape
        return width / self.size[0], height / self.size[1]

    def about(self, circle: tuple[float, float, float], radius: float, reach: float = 1.75) -> Window:
        """What lies round a circle (x, y, radius), up to `reach` of its radii, so that it has `radius` pixels there.

        A circle that is smaller already stays as it is; a very small one is enlarged, up to `MOST_ENLARGED`.
        """
        x, y, own = circle
        factor = min(radius / own, max(1.0, min(SMALLEST / own, MOST_ENLARGED)))
        return self.window((x, y), reach * own, factor)


def outline_within(window: Window, outline: Outline) -> Outline:
    """An outline of the whole picture, in pixels of the window."""
    points = window.part(outline.points)
    cone = cone_through(points, window.size, window.focal_length)
    return outline_of(cone, window.size, window.focal_length, points, outline.coverage)


def outline_without(window: Window, outline: Outline, pyramid: Pyramid) -> Outline:
    """An outline of the window, in pixels of the whole picture."""
    points = window.whole(outline.points)
    cone = cone_through(points, pyramid.size, pyramid.focal_length)
    whole = outline_of(cone, pyramid.size, pyramid.focal_length, points, outline.coverage)
    return replace(whole, rivals=tuple(window.whole_circle(each) for each in outline.rivals))
