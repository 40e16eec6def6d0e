"""Where a film's subject moves between some of its frames, and frames brought from one time to another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from relume.image.colour import luminance

_WHITE = 99.5
"""Per cent of the pixels of two frames that are darker than white where motion is sought."""
_ROUNDS = 6
"""Of the search for where a point came from: each leaves a share of the error that is the motion's own gradient."""


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Motion along a film, from frames at known times; even between two of them.

    times : (K,) of those frames, rising
    flow : of k, from frame k to k + 1: (H, W, 2) pixels right and down, at the places of frame k
    """

    times: np.ndarray
    flow: Callable[[int], np.ndarray]

    def places(self, shown: float, taken: float) -> np.ndarray:
        """Where what a picture of time `shown` has at each pixel was at time `taken`: (H, W, 2) float32, x and y.

        Before the first of the times, and after the last, motion goes on as it was.
        """
        first, last = self._interval(shown), self._interval(taken)
        begin = self._share(first, shown)
        flow = self.flow(first)
        rows, columns = flow.shape[:2]
        grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float32)
        # Back to the interval's own frame, then on or back by whole intervals, and by the last one's share.
        place = _came_from(grid, flow, begin)
        for interval in range(first, last):
            place = place + _looked_up(self.flow(interval), place)
        for interval in range(first - 1, last - 1, -1):
            place = _came_from(place, self.flow(interval), 1.0)
        return place + np.float32(self._share(last, taken)) * _looked_up(self.flow(last), place)

    def _interval(self, time: float) -> int:
        return int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.times) - 2))

    def _share(self, interval: int, time: float) -> float:
        return float((time - self.times[interval]) / (self.times[interval + 1] - self.times[interval]))


def motion_of(times: np.ndarray, frame: Callable[[int], np.ndarray]) -> FrameMotion:
    """The motion of a film between frames (K,) of it, at least two; what was found of the last 64 pairs is kept.

    frame : the radiance (H, W, 3) of the film's frame of a number
    """
    numbers = [int(time) for time in times]

    @lru_cache(64)
    def flow(interval: int) -> np.ndarray:
        return flow_from(frame(numbers[interval]), frame(numbers[interval + 1]))

    return FrameMotion(np.asarray(times, np.float64), flow)


def flow_from(frame: np.ndarray, later: np.ndarray) -> np.ndarray:
    """(H, W, 2) float32, pixels right and down from where one frame shows something to where a later one does.

    Dense inverse search (Kroeger et al. 2016) in the root of luminance, in which shadows count as highlights do.
    """
    light = [np.maximum(luminance(each), 0) for each in (frame, later)]
    white = max(float(np.percentile(np.stack(light), _WHITE)), 1e-30)
    first, second = ((255 * np.sqrt(np.minimum(each / white, 1))).astype(np.uint8) for each in light)
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return finder.calc(first, second, np.zeros((*first.shape, 2), np.float32))


def warped(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """A picture (H, W, 3) at places (H, W, 2), linear between pixels; its edge goes on beyond it."""
    source = np.ascontiguousarray(picture, np.float32)
    return cv2.remap(source, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def _came_from(places: np.ndarray, flow: np.ndarray, share: float) -> np.ndarray:
    """The places that a share of the flow has brought to `places`, by fixed-point iteration."""
    found = places
    for _ in range(_ROUNDS if share else 0):
        found = places - np.float32(share) * _looked_up(flow, found)
    return found


def _looked_up(flow: np.ndarray, places: np.ndarray) -> np.ndarray:
    return cv2.remap(flow, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
