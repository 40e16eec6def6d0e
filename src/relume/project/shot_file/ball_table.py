"""The shot file's camera.ball: the plate's camera by the outline of the mirrored ball, without a board or a tape.

The ball stands on the table where the objects will stand, and the plate's camera saw it from where it took the plate.
Its outline gives the place of the camera, as `pose_from_ball` says; which way is up is given here, or is found in the
plate's straight edges.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from relume.errors import BallNotFound, InvalidShot, warn
from relume.image.radiance import RadianceMap
from relume.project.schema import Positive, Table
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.scene.cameras.horizon import find_horizon
from relume.scene.cameras.pose_from_ball import (
    ball_in_view,
    camera_from_ball,
    pitch_of_height,
    raised_by,
    up_of,
)

GUESSED_PLACE, GUESSED_SIZE = (0.5, 0.62), 0.06
"""Where a ball is taken to stand that the plate's camera did not see, and its radius, in shares of the plate."""
GUESSED_ELEVATION = np.radians(25)
"""How far above the ball's level a camera is taken to stand of which nothing is known: as one sees a table standing."""
GUESS_OFF = np.radians(12)
"""By how much that guess is off, usually."""


class BallOnTable(Table):
    """The ball as the plate's camera saw it on the table.

    photograph : of the ball, by the plate's camera from the plate's place; the first of light.balls unless given
    rim : where it shows the ball: x, y and radius in pixels; found unless given. Without any photograph of the ball
        from the plate's place, where the plate would show a ball that stands where the objects shall
    radius : metres; that of light.ball unless given
    raised : metres between the table and the ball's lowest point, of a ball on a stand
    foot : where that stand meets the table, straight below the ball, x and y in pixels; in place of `raised`
    pitch, roll : degrees by which the camera looked down and leant
    camera_height : metres of the lens above the table, in place of `pitch`
    """

    photograph: str | None = None
    rim: tuple[float, float, Positive] | None = None
    radius: Positive | None = None
    raised: Annotated[float, Field(ge=0)] | None = None
    foot: tuple[float, float] | None = None
    pitch: float | None = None
    roll: float | None = None
    camera_height: Positive | None = None

    @model_validator(mode="after")
    def _one_pitch(self) -> BallOnTable:
        if self.pitch is not None and self.camera_height is not None:
            raise ValueError("both pitch and camera_height; give one of them")
        if self.raised is not None and self.foot is not None:
            raise ValueError("both raised and foot; give one of them")
        if self.foot is not None and self.camera_height is not None:
            raise ValueError("camera_height is above the table, which foot finds by the pitch; give raised with it")
        if self.pitch is not None and not -89 <= self.pitch <= 89:
            raise ValueError(f"pitch is {self.pitch:g}; degrees that the camera looks down, from −89 to 89")
        if self.roll is not None and abs(self.roll) > 45:
            raise ValueError(f"roll is {self.roll:g}; degrees that the camera leans, from −45 to 45")
        return self

    def camera(self, rim: np.ndarray, lens: Camera, radius: float, plate: RadianceMap) -> tuple[CameraFit, float]:
        """The plate's camera by the ball's rim, and by how many metres the ball is raised above the table.

        rim : (N, 2) points of it, pixels
        lens : of the plate's camera; its pose does not matter
        radius : of the ball, metres
        plate : its straight edges say which way is up, unless pitch or camera_height is given
        Warns of what is guessed. Raises InvalidShot.
        """
        try:
            up = self._up(rim, lens, radius, plate)
            raised = self._raised(up, rim, lens, radius)
            return camera_from_ball(rim, lens, radius=radius, up=up, raised=raised), raised
        except (ValueError, BallNotFound) as error:
            raise InvalidShot(f"camera.ball: {error}") from None

    def _raised(self, up: np.ndarray, rim: np.ndarray, lens: Camera, radius: float) -> float:
        """How far the ball is raised above the table, metres, where this way is up."""
        if self.foot is None:
            return self.raised or 0.0
        return radius * raised_by(self.foot, ball_in_view(rim, lens), lens, up)

    def _looks_down(self, up: np.ndarray, rim: np.ndarray, lens: Camera, radius: float) -> bool:
        """Whether the camera stands above the table where this way is up."""
        try:
            raised = self._raised(up, rim, lens, radius) / radius
        except ValueError:  # the foot would not be below the ball
            return False
        return bool(up @ ball_in_view(rim, lens).centre <= 0.9 + raised)

    def _up(self, rim: np.ndarray, lens: Camera, radius: float, plate: RadianceMap) -> np.ndarray:
        roll = np.radians(self.roll or 0.0)
        if self.pitch is not None:
            return up_of(np.radians(self.pitch), roll)
        ball = ball_in_view(rim, lens)
        if self.camera_height is not None:
            return up_of(pitch_of_height(ball, (self.camera_height - (self.raised or 0.0)) / radius - 1, roll), roll)
        # The camera must stand above the table, which edges alone do not say.
        horizon = find_horizon(plate.radiance, lens)
        if horizon is None or not self._looks_down(horizon.up, rim, lens, radius):
            pitch = GUESSED_ELEVATION - float(np.arctan2(-ball.centre[1], -ball.centre[2]))
            warn(
                "camera.ball: the plate's straight edges do not show how far the camera looked down; "
                f"{np.degrees(pitch):.0f}° are taken, and shadows and highlights turn with it; give pitch (degrees) or "
                "camera_height (metres of the lens above the table)",
                effect=_effect(GUESS_OFF),
            )
            return up_of(pitch, roll)
        warn(
            f"camera.ball: by the plate's straight edges the camera looked {np.degrees(horizon.pitch):.1f}° ± "
            f"{max(np.degrees(horizon.deviation), 0.1):.1f}° down and leant {np.degrees(horizon.roll):.1f}°; give "
            "pitch or camera_height where it is known",
            effect=_effect(horizon.deviation),
        )
        return horizon.up if self.roll is None else up_of(horizon.pitch, roll)


def _effect(turned: float) -> float:
    """The share by which light on a surface changes that is turned by an angle: at 45° to a lamp, tan 45° · angle."""
    return float(min(turned, 1.0))
