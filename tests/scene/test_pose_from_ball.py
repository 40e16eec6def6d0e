"""The camera from a ball's outline: exact for an exact outline, whatever the lens, the lean and the stand."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import BallNotFound
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.pose_from_ball import (
    ball_in_view,
    camera_from_ball,
    pitch_of_height,
    raised_by,
    up_of,
)
from relume.sphere.directions import rotation_about

RADIUS = 0.05


def placed(pitch: float, roll: float = 0.0, raised: float = 0.0, **lens: object) -> tuple[Camera, np.ndarray]:
    """A camera that sees the ball to the left of its middle and above it, and the rim as it shows it."""
    centre = np.array([0.0, RADIUS + raised, 0.0])
    turn = rotation_about((1, 0, 0), -pitch) @ rotation_about((0, 0, 1), roll)
    toward = turn @ np.array([-0.12, 0.1, -1.0])
    position = centre - 0.9 * toward
    # The frame is the one of which the camera lies straight ahead.
    spin = rotation_about((0, 1, 0), -np.arctan2(position[0], position[2]))
    position, turn = spin @ (position - centre) + centre, spin @ turn
    camera = Camera(900, 600, 1000.0, position, turn, **lens)  # pyright: ignore[reportArgumentType]
    # Where rays graze: the circle of tangency, a little nearer than the middle.
    away = centre - position
    distance = float(np.linalg.norm(away))
    axis = away / distance
    side = np.cross(axis, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    turns = np.linspace(0, 2 * np.pi, 60, endpoint=False)[:, None]
    ring = np.cos(turns) * side + np.sin(turns) * other
    sine = RADIUS / distance
    grazing = centre - RADIUS * sine * axis + RADIUS * np.sqrt(1 - sine**2) * ring
    return camera, camera.project(grazing)


@pytest.mark.parametrize(
    "lens",
    [{}, {"centre": (470.0, 280.0)}, {"distortion": Distortion(k1=-0.12, p1=0.002)}],
    ids=["plain", "shifted", "bent"],
)
def test_an_exact_outline_gives_the_exact_camera(lens: dict[str, object]) -> None:
    true, rim = placed(np.radians(22), np.radians(2), 0.03, **lens)
    bare = Camera(900, 600, 1000.0, np.zeros(3), np.eye(3), **lens)  # pyright: ignore[reportArgumentType]
    fit = camera_from_ball(rim, bare, radius=RADIUS, up=true.rotation.T @ [0, 1, 0], raised=0.03)
    assert np.allclose(fit.camera.position, true.position, atol=1e-7)
    assert np.allclose(fit.camera.rotation, true.rotation, atol=1e-7)
    assert fit.residual is not None and fit.residual < 1e-4 and len(fit.points) == 60
    # The points are drawn along a fitted outline: that they lie on it says nothing of how well it fits.
    assert fit.agreement == f"the ball's rim, {np.ptp(rim[:, 0]):.0f} pixels across"
    # The frame: the camera lies towards +Z, at no side of it.
    assert abs(fit.camera.position[0]) < 1e-9 and fit.camera.position[2] > 0.5


def test_which_way_is_up_follows_pitch_and_roll() -> None:
    assert np.allclose(up_of(0.0), [0, 1, 0]) and np.allclose(up_of(np.pi / 2), [0, 0, 1])
    assert np.allclose(up_of(np.radians(30)), [0, np.sqrt(3) / 2, 0.5])
    true, _ = placed(np.radians(22), np.radians(2))
    assert np.allclose(true.rotation.T @ [0, 1, 0], up_of(np.radians(22), np.radians(2)))


def test_the_height_of_the_lens_gives_how_far_it_looks_down() -> None:
    true, rim = placed(np.radians(22))
    ball = ball_in_view(rim, Camera(900, 600, 1000.0, np.zeros(3), np.eye(3)))
    assert 1 / np.sin(ball.half_angle) * RADIUS == pytest.approx(np.linalg.norm(true.position - [0, RADIUS, 0]))
    assert pitch_of_height(ball, true.position[1] / RADIUS - 1) == pytest.approx(np.radians(22), abs=1e-9)
    with pytest.raises(ValueError, match=r"camera_height puts the lens 40 ball radii .* lengths are metres"):
        pitch_of_height(ball, 40.0)


def test_a_stand_is_as_high_as_its_foot_shows() -> None:
    true, rim = placed(np.radians(22), np.radians(2), 0.07)
    bare = Camera(900, 600, 1000.0, np.zeros(3), np.eye(3))
    foot = true.project(np.zeros(3))
    up = true.rotation.T @ [0, 1, 0]
    assert raised_by((foot[0], foot[1]), ball_in_view(rim, bare), bare, up) * RADIUS == pytest.approx(0.07, abs=1e-6)
    with pytest.raises(ValueError, match="foot 300,20 is not below the ball"):
        raised_by((300.0, 20.0), ball_in_view(rim, bare), bare, up)


def test_a_camera_under_the_table_and_a_rim_of_no_ball_are_refused() -> None:
    _, rim = placed(np.radians(22))
    bare = Camera(900, 600, 1000.0, np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match=r"under the table .* check pitch or camera_height"):
        camera_from_ball(rim, bare, radius=RADIUS, up=up_of(np.radians(-25)))
    with pytest.raises(BallNotFound, match="fits no ball in front of the camera"):
        ball_in_view(np.array([[450.0, 300.0]] * 3), bare)


def test_a_camera_that_leans_is_as_high_as_it_was_measured() -> None:
    true, rim = placed(np.radians(22), np.radians(8))
    lens = Camera(900, 600, 1000.0, np.zeros(3), np.eye(3))
    ball = ball_in_view(rim, lens)
    pitch = pitch_of_height(ball, true.position[1] / RADIUS - 1, np.radians(8))
    assert pitch == pytest.approx(np.radians(22), abs=1e-9)
    fit = camera_from_ball(rim, lens, radius=RADIUS, up=up_of(pitch, np.radians(8)))
    assert fit.camera.position[1] == pytest.approx(true.position[1], abs=1e-9)
