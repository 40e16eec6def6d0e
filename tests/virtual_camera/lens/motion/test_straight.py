"""Straight motion blur: exact weights, light kept, running sums without a sun's rounding."""

from __future__ import annotations

import numpy as np
import pytest

from naive_motion import averaged
from relume.image.blurring import line_weights
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.view import View

VIEW = View(100.0)


def rough(height: int = 30, width: int = 43) -> np.ndarray:
    """Suns among dark pixels (H, W, 3)."""
    return (np.random.default_rng(5).random((height, width, 3)) ** 6 * 100).astype(np.float32)


def sun(height: int, width: int, power: float) -> np.ndarray:
    picture = np.zeros((height, width, 3), np.float32)
    picture[40, 40] = power
    return picture


def test_the_light_of_a_shutter_sums_to_one():
    times = (np.arange(20000) + 0.5) / 20000 - 0.5
    for opening in (0.0, 0.1, 0.5):
        assert Shutter(opening).light(times).mean() == pytest.approx(1, abs=1e-7)
    np.testing.assert_allclose(Shutter(0.25).light(np.array([-0.5, -0.375, 0, 0.4375])), [0, 2 / 3, 4 / 3, 1 / 3])


@pytest.mark.parametrize("motion", [(3.3, -7.7), (0.0, 21.5), (33.4, 0.0), (0.4, 0.3)])
@pytest.mark.parametrize("opening", [0.0, 0.3])
def test_it_is_the_mean_of_many_shifted_pictures(motion: tuple[float, float], opening: float):
    picture, shutter = rough(), Shutter(opening)
    blur = StraightMotion(*motion, shutter)
    expected, known = averaged(
        picture, lambda x, y, t: (x - t * motion[0], y - t * motion[1]), shutter.light, samples=240
    )
    np.testing.assert_allclose(blur.apply(picture, VIEW), expected, rtol=2e-3, atol=2e-4 * expected.max())
    np.testing.assert_allclose(blur.coverage(picture.shape[:2], VIEW), known, atol=2e-3)


def test_running_sums_are_the_taps_sums():
    picture = rough()
    for motion in ((17.3, 0.0), (0.0, 17.3), (90.0, 0.0), (0.0, 90.0)):
        rows, columns, weights = line_weights(*motion)
        total, known = np.zeros(picture.shape), np.zeros((30, 43))
        height, width = picture.shape[:2]
        for row, column, weight in zip(rows, columns, weights, strict=True):
            y, x = np.arange(height) + row, np.arange(width) + column
            there = ((y >= 0) & (y < height))[:, None] & ((x >= 0) & (x < width))
            total += weight * (there[..., None] * picture[np.clip(y, 0, height - 1)][:, np.clip(x, 0, width - 1)])
            known += weight * there
        seen = StraightMotion(*motion).apply(picture, VIEW)
        np.testing.assert_allclose(seen, total / known[..., None], rtol=2e-6)


@pytest.mark.parametrize("motion", [(37.0, 0.0), (0.0, 33.0), (20.0, -13.0), (7.5, 7.5)])
def test_light_is_kept(motion: tuple[float, float]):
    for shutter in (Shutter(), Shutter(0.2)):
        seen = StraightMotion(*motion, shutter).apply(sun(81, 83, 1e6), VIEW)
        assert seen.sum(dtype=np.float64) == pytest.approx(3e6, rel=1e-6)
        assert seen.min() == 0
        row, column = (np.tensordot(seen[..., 0], axis, 2) / 1e6 for axis in np.mgrid[:81, :83])
        assert (row, column) == pytest.approx((40, 40), abs=1e-4)


def test_nothing_of_a_sun_is_left_behind_it():
    # 10¹² beside 10⁻³: a running sum that takes the sun away again would keep its rounding.
    for axis in (0, 1):
        picture = np.full((90, 90, 3), 1e-3, np.float32)
        picture[45, 45] = 1e12
        seen = StraightMotion(*((20.0, 0.0) if axis else (0.0, 20.0))).apply(picture, VIEW)
        line = seen[45] if axis else seen[:, 45]
        np.testing.assert_allclose(line[:34], 1e-3, rtol=1e-6)
        np.testing.assert_allclose(line[57:], 1e-3, rtol=1e-6)
        assert line[45, 0] == pytest.approx(5e10)


def test_even_light_stays_even_and_small_pictures_are_right():
    for shape in ((1, 1, 3), (3, 40, 3), (40, 2, 3)):
        for motion in ((50.0, 0.0), (0.0, 50.0), (11.0, 12.0)):
            np.testing.assert_allclose(
                StraightMotion(*motion).apply(np.full(shape, 0.25, np.float32), VIEW), 0.25, rtol=1e-6
            )
