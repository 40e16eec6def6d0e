"""Round pictures: mirrors by their own reflection, fisheyes by their radii, joined into the light they show."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import DoubtWarning
from relume.image.radiance import SATURATED, RadianceMap
from relume.probe.round_views import (
    FisheyeLens,
    ParabolicMirror,
    RoundView,
    TelecentricBall,
    join_round_views,
)
from relume.sphere.directions import UP, rotation_about
from relume.sphere.mappings.mapping import LatLong, pixel_directions

SIDE, RIM = 400, 190.0


def sky(directions: np.ndarray) -> np.ndarray:
    """Light that is smooth and differs everywhere."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([1.5 + x + 0.4 * y * z, 1.5 + 0.8 * z - 0.3 * x * y, 1.2 + 0.9 * y + 0.2 * z * z], axis=-1)


def disc() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, up (H, W) in radii of the rim, and what lies within it."""
    right, down = np.meshgrid(*[(np.arange(SIDE) + 0.5 - SIDE / 2) / RIM] * 2)
    return right, -down, np.hypot(right, down) < 1


def mirrored(normal: np.ndarray) -> np.ndarray:
    """Where rays along −Z go from a mirror of these normals (…, 3)."""
    ray = np.array([0.0, 0, -1])
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return ray - 2 * np.sum(ray * normal, axis=-1, keepdims=True) * normal


def view(lens, directions: np.ndarray, inside: np.ndarray, turn: np.ndarray, gain: float = 1.0) -> RoundView:
    picture = np.where(inside[..., None], sky(directions @ turn.T), 0) * gain
    return RoundView(RadianceMap(picture.astype(np.float32)), lens, (SIDE / 2, SIDE / 2), RIM, turn)


def ball(turn: np.ndarray = np.eye(3)) -> RoundView:
    x, y, inside = disc()
    return view(
        TelecentricBall(), mirrored(np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0))], -1)), inside, turn
    )


def parabola(turn: np.ndarray = np.eye(3)) -> RoundView:
    """z = (1 − ρ²)/2: its focus is in the plane of its rim, so that it shows a half space."""
    x, y, inside = disc()
    return view(ParabolicMirror(), mirrored(np.stack([x, y, np.ones_like(x)], -1)), inside, turn)


def fisheye(turn: np.ndarray, gain: float = 1.0, degrees: float = 200) -> RoundView:
    x, y, inside = disc()
    radius = np.hypot(x, y)
    angle = radius * np.radians(degrees) / 2
    ways = np.stack([x / radius * np.sin(angle), y / radius * np.sin(angle), -np.cos(angle)], axis=-1)
    return view(FisheyeLens(np.radians(degrees)), ways, inside, turn, gain)


def error(probe, where: np.ndarray) -> float:
    true = sky(pixel_directions(LatLong(), 64))
    return float(np.abs(probe.light.radiance / true - 1)[where].max())


def test_a_ball_and_a_parabola_show_what_their_surfaces_mirror():
    turn = rotation_about(UP, 0.7) @ rotation_about(np.array([1.0, 0, 0]), 0.3)
    towards = pixel_directions(LatLong(), 64) @ turn[:, 2]
    # The last thousandths of the rim of the ball show the surroundings of the direction behind it.
    assert error(join_round_views([ball(turn)], 64), towards > -0.9) < 0.01
    with pytest.warns(DoubtWarning, match="are shown by no view; they are black"):
        half = join_round_views([parabola(turn)], 64)
    assert error(half, towards > 0.05) < 0.01
    assert not half.light.radiance[towards < -0.05].any() and not half.seen[towards < -0.05].any()


def test_two_fisheyes_back_to_back_are_joined_and_balanced():
    views = [fisheye(np.eye(3)), fisheye(rotation_about(UP, np.pi), gain=0.5)]
    probe = join_round_views(views, 64)
    assert probe.gains == pytest.approx([1, 2], rel=0.01) and probe.seen.min() == 1
    assert error(probe, np.ones((64, 128), bool)) < 0.02
    plain = join_round_views(views, 64, balance=False)
    assert plain.light.radiance[32, 0] == pytest.approx(0.5 * probe.light.radiance[32, 0], rel=0.02)


def test_what_one_view_clips_comes_from_another():
    first, second = fisheye(np.eye(3), degrees=220), fisheye(rotation_about(UP, np.pi), degrees=220)
    clipped = np.zeros((SIDE, SIDE), np.uint8)
    clipped[:, :60] = SATURATED
    radiance = first.picture.radiance.copy()
    radiance[:, :60] = 0
    marked = RoundView(RadianceMap(radiance, clipped=clipped), first.lens, first.centre, first.radius, first.rotation)
    assert error(join_round_views([second, marked], 64), np.ones((64, 128), bool)) > 0
    beside = pixel_directions(LatLong(), 64) @ np.array([-1.0, 0, 0]) > 0.97
    assert error(join_round_views([marked, second], 64), beside) < 0.02


def test_views_that_are_none_are_refused():
    with pytest.raises(ValueError, match="no views were given"):
        join_round_views([])
    with pytest.raises(ValueError, match="a field of 400°"):
        FisheyeLens(np.radians(400))
    with pytest.raises(ValueError, match="expected a 3×3 rotation"):
        RoundView(ball().picture, TelecentricBall(), (1, 1), 5, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="a rim of radius 0"):
        RoundView(ball().picture, TelecentricBall(), (1, 1), 0, np.eye(3))
