"""Motion blur by vectors: layers before and behind each other, against pictures drawn at every instant."""

from __future__ import annotations

import numpy as np
import pytest

from naive_motion import carried
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.lens.motion.vectors import MotionVectors
from relume.virtual_camera.view import View


def plane(height: int, width: int, vector: tuple[float, float]) -> np.ndarray:
    return np.full((height, width, 2), vector, np.float32)


def rough(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(7).random((height, width, 3), np.float32)


@pytest.mark.parametrize("vector", [(13.0, 0.0), (0.0, -9.5), (6.0, 4.0), (0.3, 0.1)])
def test_like_vectors_are_a_straight_motion(vector: tuple[float, float]):
    picture = rough(80, 90)
    for shutter in (Shutter(), Shutter(0.25)):
        view = View(90.0, motion=plane(80, 90, vector))
        seen = MotionVectors(shutter).apply(picture, view)
        expected = StraightMotion(*vector, shutter).apply(picture, view)
        inside = np.s_[8:-8, 8:-8]
        level = 0 in vector and shutter.opening == 0
        np.testing.assert_allclose(seen[inside], expected[inside], atol=2e-6 if level else 0.02)
        known = MotionVectors(shutter).coverage((80, 90), view)
        np.testing.assert_allclose(known, StraightMotion(*vector, shutter).coverage((80, 90), view), atol=0.12)


def test_light_is_kept_where_all_moves_alike():
    picture = np.zeros((90, 90, 3), np.float32)
    picture[45, 45] = 1e6
    for vector in ((20.0, 0.0), (17.0, 9.0)):
        seen = MotionVectors().apply(picture, View(90.0, motion=plane(90, 90, vector)))
        assert seen.sum(dtype=np.float64) == pytest.approx(3e6, rel=1e-5)
        assert seen.min() == 0


def test_a_still_thing_stays_and_sheds_nothing_over_what_moves_behind_it():
    picture = np.full((70, 140, 3), 0.2, np.float32) * np.array([0, 0, 1], np.float32)
    picture[:, 60:80] = [5, 0, 0]
    motion = plane(70, 140, (16.0, 0.0))
    motion[:, 60:80] = 0
    depth = np.full((70, 140), 30, np.float32)
    depth[:, 60:80] = 3
    seen = MotionVectors().apply(picture, View(90.0, depth=depth, motion=motion))
    np.testing.assert_array_equal(seen[:, 60:80], picture[:, 60:80])
    np.testing.assert_array_equal(seen[:, :60, 0], 0)
    np.testing.assert_array_equal(seen[:, 80:, 0], 0)
    np.testing.assert_allclose(seen[:, :60, 2], 0.2, rtol=1e-6)
    # With the depths exchanged what moves comes before the post.
    swapped = MotionVectors().apply(picture, View(90.0, depth=33 - depth, motion=motion))
    assert swapped[35, 62, 2] > 0.05 and swapped[35, 62, 0] < 4


def test_a_moving_thing_is_drawn_as_at_every_instant():
    # A square, 20 wide, that goes 12.4 pixels over a background whose every pixel is known.
    height, width, way = 64, 100, 12.4
    columns = np.arange(width)
    ground = (0.3 + 0.2 * np.sin(columns / 17))[None, :, None] * np.ones((height, 1, 3))
    picture, motion, depth = ground.copy(), plane(height, width, (0, 0)), np.full((height, width), 9, np.float32)
    picture[20:40, 40:60], motion[20:40, 40:60], depth[20:40, 40:60] = 4.0, (way, 0), 2.0
    truth = np.zeros(picture.shape)
    for time in (np.arange(500) + 0.5) / 500 - 0.5:
        cover = np.clip(
            np.minimum(columns + 0.5, 59.5 + way * time) - np.maximum(columns - 0.5, 39.5 + way * time), 0, 1
        )
        instant = ground.copy()
        instant[20:40] += cover[:, None] * (4 - instant[20:40])
        truth += instant / 500
    picture = picture.astype(np.float32)
    seen = MotionVectors().apply(picture, View(90.0, depth=depth, motion=motion))
    # The ground behind the square is guessed, from up to 6 pixels away.
    assert np.abs(seen - truth).max() < 0.12
    np.testing.assert_array_equal(seen[:19], picture[:19])
    guessed = MotionVectors().coverage((height, width), View(90.0, depth=depth, motion=motion))
    assert guessed[30, 41] == pytest.approx(0.62, abs=0.08)
    assert guessed[30, 50] == pytest.approx(1) and guessed[30, 37] == pytest.approx(1)
    # Without depth the faster thing is taken to be nearer: here they say the same.
    alike = MotionVectors().apply(picture, View(90.0, motion=motion))
    np.testing.assert_allclose(alike, seen, atol=1e-6)


def test_it_is_its_slow_twin():
    generator = np.random.default_rng(3)
    picture = generator.random((14, 17, 3)).astype(np.float32)
    motion = np.zeros((14, 17, 2), np.float32)
    motion[4:10, 5:11] = (3.0, -1.5)
    depth = np.full((14, 17), 8.0, np.float32)
    depth[4:10, 5:11] = 2.0
    seen = MotionVectors().apply(picture, View(20.0, depth=depth, motion=motion))
    expected = carried(picture, motion, np.log(depth), 0.05, samples=6)
    said = MotionVectors().coverage((14, 17), View(20.0, depth=depth, motion=motion)) > 0.999
    assert said.mean() > 0.9
    np.testing.assert_allclose(seen[said], expected[said], atol=1e-3)


def test_the_faster_of_two_is_nearer_where_no_depth_is_known():
    picture = np.zeros((64, 100, 3), np.float32)
    picture[:, 50:] = 1
    motion = plane(64, 100, (0, 0))
    motion[:, 50:] = (-12, 0)
    seen = MotionVectors().apply(picture, View(90.0, motion=motion))[30, :, 0]
    assert seen[46] > 0.1 and seen[40] == 0
    # At the side that it leaves, what lies behind it is taken from before its edge.
    assert seen[53] < 0.9 and seen[60] == pytest.approx(1)


def test_surfaces_that_grow_have_no_holes():
    y, x = np.mgrid[:128, :128].astype(np.float32)
    motion = 0.3 * np.stack([x - 64, y - 64], axis=-1)
    seen = MotionVectors().apply(np.full((128, 128, 3), 0.7, np.float32), View(90.0, motion=motion))
    np.testing.assert_allclose(seen, 0.7, rtol=1e-6)
    # A picture that grows and shrinks about itself, of smooth light, shows no seams of the tiles it is worked in.
    light = np.repeat((1 + np.cos(x / 9) * np.cos(y / 9))[..., None], 3, axis=2)
    seen = MotionVectors().apply(light, View(90.0, motion=motion))[16:-16, 16:-16, 0]
    across = np.abs(np.diff(seen, 2, axis=1))
    assert across[:, 46:50].max() < 1.2 * across.max(axis=1).mean() + 0.01


def test_threads_change_nothing_and_the_input_stays(monkeypatch):
    picture, motion = rough(150, 140), 20 * np.random.default_rng(1).random((150, 140, 2), np.float32) - 10
    view, before = View(90.0, motion=motion), picture.copy()
    several = MotionVectors().apply(picture, view)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    np.testing.assert_array_equal(MotionVectors().apply(picture, view), several)
    np.testing.assert_array_equal(picture, before)


def test_planes_that_are_missing_or_of_another_size_are_refused():
    picture = rough(20, 30)
    with pytest.raises(ValueError, match="no motion"):
        MotionVectors().apply(picture, View(20.0))
    with pytest.raises(ValueError, match="motion is"):
        MotionVectors().apply(picture, View(20.0, motion=plane(30, 20, (1, 1))))
    with pytest.raises(ValueError, match="depth is"):
        MotionVectors().apply(picture, View(20.0, motion=plane(20, 30, (1, 1)), depth=np.ones((3, 3), np.float32)))
