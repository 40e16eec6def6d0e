"""The camera's pose from the outline of a ball of known radius that stands on the table, and from which way is up.

The rays that graze a ball form a circular cone about its centre, of half angle α with sin α = radius ∕ distance: so the
outline gives direction and distance of the centre, and the focal length is all that has to be known of the lens. The
ball leaves open how the camera was turned about that direction; which way is up closes that (`horizon`).

The frame is the ball's: origin on the table below its centre, +Y up, +Z level towards the camera, +X to the right.
Camera coordinates here are x right, y up, z backward, as in `Camera`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.errors import BallNotFound
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.sphere.directions import normalised

LEAST_ABOVE = 0.05
"""Radii above the table below which no camera stands: its lens has a size."""
SMALLEST = 1e-8
"""Of 1 − cos α: a ball of a hundredth of a degree is a pixel."""
OVERHEAD = 1e-3
"""Radians from straight down within which "towards the camera" is taken from the photograph's lower edge."""


@dataclass(frozen=True, eq=False)
class BallInView:
    """The ball as a camera sees it, in that camera's coordinates.

    centre : (3,) of the ball, in its radii
    half_angle : α of its cone, radians
    """

    centre: np.ndarray
    half_angle: float


def ball_in_view(rim: np.ndarray, lens: Camera) -> BallInView:
    """The cone through points of a ball's rim, by least squares.

    rim : (N ≥ 3, 2) pixels, x right and y down from the corner of the first pixel
    lens : its pose does not matter
    Raises BallNotFound where no cone goes through them.
    """
    rays = lens.rays_through(np.asarray(rim, np.float64)) @ lens.rotation
    # Linear in m = axis ∕ cos α: d·m = 1 on every ray.
    m, *_ = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)
    cosine = 1 / max(float(np.linalg.norm(m)), 1e-12)
    if not np.isfinite(m).all() or not 0 < cosine < 1 - SMALLEST:
        raise BallNotFound("the rim of the ball fits no ball in front of the camera; is the focal length right?")
    sine = float(np.sqrt(1 - cosine**2))
    return BallInView(normalised(m) / sine, float(np.arcsin(sine)))


def up_of(pitch: float, roll: float = 0.0) -> np.ndarray:
    """Which way is up in the coordinates of a camera that looks down by `pitch` and leans by `roll`, radians.

    A roll above 0 leans the photograph's verticals to the right, as a camera does that is turned counter-clockwise.
    """
    cosine = np.cos(pitch)
    return np.array([np.sin(roll) * cosine, np.cos(roll) * cosine, np.sin(pitch)])


def pitch_of_height(ball: BallInView, height: float, roll: float = 0.0) -> float:
    """How far a camera looks down, radians, whose lens is `height` ball radii above the ball's centre.

    roll : by which it leans, radians; see `up_of`
    Raises ValueError for a height that its distance does not allow.
    """
    # up · (−centre) = height with up = (sin r cos p, cos r cos p, sin p): one sine of p, shifted.
    x, y, z = (-ball.centre).tolist()
    y = float(np.sin(roll) * x + np.cos(roll) * y)
    reach = float(np.hypot(y, z))
    if abs(height) > reach:
        raise ValueError(
            f"camera_height puts the lens {abs(height):.3g} ball radii above or below the ball, which is only "
            f"{reach:.3g} away; lengths are metres"
        )
    return float(np.arcsin(height / reach) - np.arctan2(y, z))


def raised_by(foot: tuple[float, float], ball: BallInView, lens: Camera, up: np.ndarray) -> float:
    """Radii between the table and the ball's lowest point, of a ball whose stand is seen to meet the table at `foot`.

    foot : pixels; the point straight below the ball that its ray passes nearest is taken
    Raises ValueError for a foot that is not below the ball.
    """
    ray = lens.rays_through(np.array(foot, np.float64)) @ lens.rotation
    # Where centre − t·up and s·ray are nearest: two equations in t and s.
    along = float(ray @ up)
    t = (float(ball.centre @ up) - float(ball.centre @ ray) * along) / max(1 - along**2, 1e-12)
    if not 1 <= t < np.inf:
        raise ValueError(
            f"foot {foot[0]:g},{foot[1]:g} is not below the ball; give where its stand meets the table, pixels"
        )
    return t - 1


def camera_from_ball(rim: np.ndarray, lens: Camera, *, radius: float, up: np.ndarray, raised: float = 0.0) -> CameraFit:
    """Place a camera in the frame of a ball that stands on the table y = 0.

    rim : (N ≥ 3, 2) pixels on the ball's rim
    lens : focal length, principal point and distortion; its pose does not matter
    radius : of the ball, metres
    up : (3,) which way is up, in the camera's coordinates; `up_of` or `horizon.find_horizon` gives it
    raised : metres between the table and the ball's lowest point, of a ball on a stand
    The fit's offsets are those of the rim. Raises BallNotFound, and ValueError where the camera would be under the
    table.
    """
    ball, up = ball_in_view(rim, lens), normalised(up)
    lifted = 1 + raised / radius
    height = lifted - float(up @ ball.centre)
    if height < LEAST_ABOVE:
        raise ValueError(
            f"the camera would stand {-height * radius:.2g} m under the table on which the ball stands; check pitch or "
            "camera_height"
        )
    # The world's axes in the camera's coordinates; towards the camera is level.
    backward = -ball.centre + (ball.centre @ up) * up
    if np.linalg.norm(backward) < OVERHEAD * np.linalg.norm(ball.centre):
        backward = -(np.array([0.0, 1.0, 0.0]) - up[1] * up)
    backward = normalised(backward)
    rotation = np.stack([np.cross(up, backward), up, backward])
    # The origin lies on the table, straight below the centre.
    position = -radius * (rotation @ (ball.centre - lifted * up))
    camera = replace(lens, position=position, rotation=rotation)
    return CameraFit(camera, np.asarray(rim, np.float64), _offsets(rim, lens, ball), "the ball's rim")


def _offsets(rim: np.ndarray, lens: Camera, ball: BallInView) -> np.ndarray:
    """From the rim's points to the cone's outline, pixels: each ray turned towards or from the axis until it grazes."""
    rays, axis = lens.rays_through(np.asarray(rim, np.float64)) @ lens.rotation, normalised(ball.centre)
    beside = rays - (rays @ axis)[:, None] * axis
    grazing = np.cos(ball.half_angle) * axis + np.sin(ball.half_angle) * normalised(beside)
    return lens.project(lens.position + grazing @ lens.rotation.T) - rim
