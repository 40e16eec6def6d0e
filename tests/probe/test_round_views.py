"""Round pictures: mirrors by their own reflection, fisheyes by their radii, joined into the light they show."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import DoubtWarning
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
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
SUN = np.array([1.0, 0, 0])


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


def sunny(turn: np.ndarray) -> RoundView:
    """A fisheye of 220° that shows a small sun at the side, clipped at 1000."""
    whole = fisheye(turn, degrees=220)
    x, y, _ = disc()
    angle, ring = np.hypot(x, y) * np.radians(110), np.hypot(x, y)
    ways = np.stack([x / ring * np.sin(angle), y / ring * np.sin(angle), -np.cos(angle)], axis=-1)
    sun = ways @ turn.T @ SUN > np.cos(0.08)
    radiance = np.where(sun[..., None], np.float32(1000), whole.picture.radiance)
    picture = RadianceMap(radiance, clipped=np.where(sun, SATURATED, 0).astype(np.uint8))
    return RoundView(picture, whole.lens, whole.centre, whole.radius, turn)


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
    beside = pixel_directions(LatLong(), 64) @ np.array([-1.0, 0, 0]) > 0.97
    unmarked = RoundView(RadianceMap(radiance), first.lens, first.centre, first.radius, first.rotation)
    assert error(join_round_views([second, unmarked], 64), beside) > 0.3
    for views in ([second, marked], [marked, second]):
        probe = join_round_views(views, 64)
        assert error(probe, beside) < 0.02 and probe.light.clipped is None


def test_what_every_view_clips_is_kept_marked_and_warned_of():
    views = [sunny(np.eye(3)), sunny(rotation_about(UP, np.pi))]
    with pytest.warns(DoubtWarning, match=r"0\.1\d% of the map's pixels are clipped in every view that shows them"):
        probe = join_round_views(views, 64)
    sun = pixel_directions(LatLong(), 64) @ SUN > np.cos(0.05)
    assert probe.light.radiance[sun].min() == pytest.approx(1000, rel=0.01) and probe.light.clipped is not None
    assert np.all(probe.light.clipped[sun] == SATURATED)
    away = pixel_directions(LatLong(), 64) @ SUN < np.cos(0.15)
    assert not probe.light.clipped[away].any() and error(probe, away) < 0.02
    assert probe.gains == pytest.approx([1, 1], rel=0.01)


def test_what_lies_outside_the_pictures_is_marked_as_that():
    turn, codes = np.eye(3), np.zeros((SIDE, SIDE), np.uint8)
    codes[: SIDE // 2] = OUTSIDE
    whole = fisheye(turn, degrees=360)
    half = RoundView(RadianceMap(whole.picture.radiance, clipped=codes), whole.lens, whole.centre, whole.radius, turn)
    with pytest.warns(DoubtWarning, match="are shown by no view"):
        probe = join_round_views([half], 64)
    up = pixel_directions(LatLong(), 64)[..., 1]
    assert probe.light.clipped is not None and np.all(probe.light.clipped[up > 0.2] == OUTSIDE)
    assert not probe.light.radiance[up > 0.2].any() and not probe.light.clipped[up < -0.2].any()


def test_black_in_both_views_says_nothing_of_their_brightness():
    def dark(view: RoundView, least: float) -> RoundView:
        """All of a view black but what lies higher than this: the overlap is a ring, most of it dark."""
        rows = (SIDE / 2 - np.arange(SIDE) - 0.5) / RIM
        picture = view.picture.radiance * (rows > least)[:, None, None]
        return RoundView(RadianceMap(picture.astype(np.float32)), view.lens, view.centre, view.radius, view.rotation)

    first, second = fisheye(np.eye(3)), fisheye(rotation_about(UP, np.pi), gain=2)
    assert join_round_views([dark(first, 0.5), dark(second, 0.5)], 64).gains == pytest.approx([1, 0.5], rel=0.01)
    with pytest.warns(DoubtWarning, match="view 2 has nothing in common with those before it that is not black"):
        assert np.array_equal(join_round_views([dark(first, 2), dark(second, 2)], 64).gains, [1, 1])


def test_views_that_are_none_are_refused():
    with pytest.raises(ValueError, match="no views were given"):
        join_round_views([])
    with pytest.raises(ValueError, match=r"^a field of 400°; expected more than 0° and up to 360°$"):
        FisheyeLens(np.radians(400))
    with pytest.raises(ValueError, match="expected a 3×3 rotation"):
        RoundView(ball().picture, TelecentricBall(), (1, 1), 5, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="a rim of radius 0"):
        RoundView(ball().picture, TelecentricBall(), (1, 1), 0, np.eye(3))
