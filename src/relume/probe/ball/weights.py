"""How far a view of a ball is believed, direction by direction: sampling, and what its own camera hides."""

from __future__ import annotations

import numpy as np

from relume.probe.ball.unwrapping import BallView
from relume.sphere.directions import angle_between

CAMERA_CONE = np.radians(14)
"""Half-angle round each camera that its own view must not show: tripod and photographer at arm's length of 1 m."""
TRIPOD = np.radians(30)
"""How far below the camera its tripod and photographer reach in the view."""
STILL_SEEN = 0.1
"""What remains of the trust in a view's own camera: it stands there, if no other view sees past it."""


def clear_of_camera(view: BallView, directions: np.ndarray) -> np.ndarray:
    """1 away from a view's own camera and what is under it, `STILL_SEEN` in its midst: (…)."""
    angle = _angle_to_stand(view.towards_camera, directions)
    clear = np.clip((angle - CAMERA_CONE) / (0.5 * CAMERA_CONE), 0, 1)
    return STILL_SEEN + (1 - STILL_SEEN) * clear * clear * (3 - 2 * clear)


def trust(view: BallView, directions: np.ndarray, nearness: float = 0.0) -> np.ndarray:
    """How far a view among others is believed, 0 to 1: how finely it samples (…), away from its camera."""
    return view.sampling(directions, nearness) / finest(view) * clear_of_camera(view, directions)


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
