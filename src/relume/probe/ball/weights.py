"""How far a view of a ball is believed, direction by direction: sampling, its own camera, and what other views say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.image.bilinear import bilinear
from relume.image.colour import luminance
from relume.probe.ball.unwrapping import BallView
from relume.sphere.directions import angle_between
from relume.sphere.mappings.mapping import LatLong, pixel_points

CAMERA_CONE = np.radians(14)
"""Half-angle round each camera that its own view must not show: tripod and photographer at arm's length of 1 m."""
TRIPOD = np.radians(30)
"""How far below the camera its tripod and photographer reach in the view."""
STILL_SEEN = 0.1
"""What remains of the trust in a view's own camera: it stands there, if no other view sees past it."""
ROWS = 96
"""Rows of the charts that are compared: 1.9° each, more than registration leaves between views."""
TOLERANCE = 0.35
"""Difference in ln luminance, half a stop, at which a view counts half: edges that are blurred differ by less."""
EDGES: Any = ("nearest", "wrap")
"""How a lat-long chart goes on beyond its edges when it is blurred."""
LEAST = 0.05
"""What the view that contradicts all others keeps, so that it still serves where it is the only one."""


def clear_of_camera(view: BallView, directions: np.ndarray) -> np.ndarray:
    """1 away from a view's own camera and what is under it, `STILL_SEEN` in its midst: (…)."""
    angle = _angle_to_stand(view.towards_camera, directions)
    clear = np.clip((angle - CAMERA_CONE) / (0.5 * CAMERA_CONE), 0, 1)
    return STILL_SEEN + (1 - STILL_SEEN) * clear * clear * (3 - 2 * clear)


def trust(view: BallView, directions: np.ndarray, nearness: float = 0.0) -> np.ndarray:
    """How far a view among others is believed, 0 to 1: how finely it samples (…), away from its camera."""
    return view.see(directions, nearness).sampling / finest(view) * clear_of_camera(view, directions)


def finest(view: BallView) -> float:
    """Pixels per radian in the middle of the ball, where a view samples most finely."""
    return view.focal_length / ((view.distance - 1) * (1 + view.distance / (view.distance - 1)))


def _angle_to_stand(camera: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The angle of directions from the arc that begins at the camera and goes straight down."""
    towards = angle_between(directions, camera)
    down = np.array([0.0, -1.0, 0.0]) + camera[1] * camera
    length = np.linalg.norm(down)
    if length < 1e-6:
        return towards
    down /= length
    reach = min(float(TRIPOD), float(angle_between(camera, (0.0, -1.0, 0.0))))
    end = np.cos(reach) * camera + np.sin(reach) * down
    to_end = angle_between(directions, end)
    # Beside the arc the distance is that to its great circle, beyond its ends that to the nearer end.
    along = np.arctan2(directions @ down, directions @ camera)
    across = np.arcsin(np.clip(np.abs(directions @ np.cross(camera, down)), 0, 1))
    return np.where((along > 0) & (along < reach), across, np.minimum(towards, to_end))


@dataclass(frozen=True, eq=False)
class Agreement:
    """How far each view agrees with the others, 0 to 1, as lat-long charts (N, ROWS, 2·ROWS)."""

    charts: np.ndarray

    def of(self, view: int, directions: np.ndarray) -> np.ndarray:
        """Of one view, at directions (…, 3): (…)."""
        points = LatLong().image_points(directions)
        wide = np.concatenate([self.charts[view][:, -1:], self.charts[view], self.charts[view][:, :1]], axis=1)
        return bilinear(wide, points[..., 0] * 2 * ROWS + 1, points[..., 1] * ROWS)


def agreement(views: Sequence[BallView], nearness: float, gains: Sequence[float]) -> Agreement | None:
    """Compare the views, laid on one another; None for fewer than three, of which none is the odd one out.

    nearness, gains : as registration found them

    In each direction the views' ln luminance is compared with its median, every view counting as it is trusted there.
    """
    if len(views) < 3:
        return None
    directions = LatLong().directions(pixel_points(LatLong(), ROWS, 2))
    cells = (ROWS, 2, 2 * ROWS, 2)
    levels, shares = [], []
    for view, gain in zip(views, gains, strict=True):
        light = luminance(view.see(directions, nearness).radiance).reshape(cells).mean((1, 3)) / gain
        levels.append(np.log(gaussian_filter(light, 1.0, mode=EDGES) + 1e-9))
        shares.append(trust(view, directions, nearness).reshape(cells).mean((1, 3)))
    level, share = np.stack(levels), np.stack(shares)
    # The sharp power of the blending gives a view that samples badly no say; here it has little.
    off = np.abs(level - _weighted_median(level, share**2))
    agreed = LEAST + (1 - LEAST) / (1 + (off / TOLERANCE) ** 4)
    return Agreement(np.stack([gaussian_filter(each, 0.7, mode=EDGES) for each in agreed]))


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The value (…) that half the weight lies below, of values and weights (N, …)."""
    order = np.argsort(values, axis=0)
    values, weights = np.take_along_axis(values, order, 0), np.take_along_axis(weights, order, 0)
    middle = np.cumsum(weights, axis=0) - 0.5 * weights.sum(0)
    chosen = np.argmax(middle >= 0, axis=0)
    return np.take_along_axis(values, chosen[None], 0)[0]
