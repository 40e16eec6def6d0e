"""How a camera was held, from the straight edges of what it saw: right in a furnished room, silent in noise."""

from __future__ import annotations

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.cameras.horizon import find_horizon, horizon_of
from relume.sphere.directions import rotation_about

SIZE = (480, 320)


def held(pitch: float, roll: float, heading: float) -> Camera:
    """A camera in a room, degrees."""
    p, r, h = np.radians((pitch, roll, heading))
    turn = rotation_about((0, 1, 0), h) @ rotation_about((1, 0, 0), -p) @ rotation_about((0, 0, 1), r)
    return Camera(*SIZE, 430.0, np.array([0.3, 1.4, 1.1]), turn)


def room(camera: Camera) -> np.ndarray:
    """A room whose walls, floor and ceiling are tiled, each with other tiles."""
    low, high = np.array([-2.0, 0.0, -2.5]), np.array([2.2, 2.6, 2.4])
    rays = camera.rays()
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, (high - camera.position) / rays, (low - camera.position) / rays)
    axis = reach.argmin(-1)
    points = camera.position + reach.min(-1)[..., None] * rays
    tiles = np.floor(points / [0.7, 0.45, 0.9]).astype(int)
    others = tiles.sum(-1) - np.take_along_axis(tiles, axis[..., None], -1)[..., 0]
    shade = np.array([0.5, 0.8, 0.3])[axis] * np.where(others % 2, 1.0, 0.55)
    return np.repeat(shade[..., None], 3, axis=-1).astype(np.float32)


@pytest.mark.parametrize(("pitch", "roll", "heading"), [(24.0, 1.5, 20.0), (4.0, -2.0, 70.0), (38.0, 0.0, 45.0)])
def test_a_room_shows_how_the_camera_was_held(pitch: float, roll: float, heading: float) -> None:
    camera = held(pitch, roll, heading)
    found = find_horizon(room(camera), camera)
    assert found is not None and found.share > 0.6
    assert np.degrees([found.pitch, found.roll]) == pytest.approx([pitch, roll], abs=0.4)
    assert np.allclose(found.up, camera.rotation.T @ [0, 1, 0], atol=0.01)
    assert np.degrees(found.deviation) < 2


def test_a_picture_without_straight_edges_says_nothing() -> None:
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    soft = 0.5 + 0.2 * np.sin(x / 40) * np.cos(y / 33)
    assert find_horizon(np.repeat(soft[..., None], 3, -1).astype(np.float32), held(20, 0, 0)) is None


def test_edges_in_every_direction_say_nothing() -> None:
    generator = np.random.default_rng(3)
    middles, turns = generator.uniform(0, 1, (300, 2)) * SIZE, generator.uniform(0, np.pi, 300)
    half = 20 * np.stack([np.cos(turns), np.sin(turns)], -1)
    assert horizon_of(np.stack([middles - half, middles + half], 1), held(20, 0, 0)) is None
