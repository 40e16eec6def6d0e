"""Glare is spread over whole pictures: as a sum over all points would, without wrapping, losing or inventing light."""

from functools import lru_cache

import numpy as np
import pytest

from relume.image import bands
from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare import convolution
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.convolution import Canvas, general_transfer, spread_out, symmetric_transfer
from relume.virtual_camera.lens.glare.eye import EyeGlare
from relume.virtual_camera.lens.glare.point_spread import PolarSpread
from relume.virtual_camera.view import View


def summed(radiance: np.ndarray, kernel: np.ndarray, *, mirrored: bool = False) -> np.ndarray:
    """The slow twin: every pixel is the sum over all others; `kernel` reaches over the picture to each side."""
    height, width = radiance.shape[:2]
    down, right = kernel.shape[0] // 2, kernel.shape[1] // 2
    around = ((down, down), (right, right), (0, 0))
    padded = np.pad(radiance.astype(np.float64), around, mode="symmetric" if mirrored else "constant")
    turned = kernel[::-1, ::-1].astype(np.float64)
    result = np.empty(radiance.shape)
    for y in range(height):
        for x in range(width):
            result[y, x] = (padded[y : y + 2 * down + 1, x : x + 2 * right + 1] * turned).sum((0, 1))
    return result


@lru_cache
def eye_spread() -> PolarSpread:
    """For pictures of up to 210 pixels' diagonal."""
    return EyeGlare().point_spread(0.1, View(60.0, seed=3), 210.0)


def room(height: int, width: int) -> np.ndarray:
    return np.random.default_rng(5).random((height, width, 3), dtype=np.float32) ** 4 * np.array([1, 2, 3], np.float32)


@pytest.mark.parametrize(("height", "width"), [(40, 53), (5, 3), (1, 1), (2, 40)])
def test_every_pixel_is_the_sum_over_all_others(height, width):
    radiance, spread = room(height, width), eye_spread()
    given = radiance.copy()
    expected = summed(radiance, spread.draw(height - 1, width - 1))
    found = spread_out(radiance, spread)
    assert found.dtype == np.float32 and found.shape == radiance.shape
    assert np.abs(found / expected - 1).max() < 2e-6
    assert np.array_equal(radiance, given)


def test_a_mirrored_world_sends_its_light_too_and_an_even_one_stays_even():
    radiance, spread = room(40, 53), eye_spread()
    # Offsets of the full width meet at the seam of the two images and are left out.
    expected = summed(radiance, spread.draw(39, 52), mirrored=True)
    assert np.abs(spread_out(radiance, spread, mirrored=True) / expected - 1).max() < 2e-6
    even = spread_out(np.ones((40, 53, 3), np.float32), spread, mirrored=True)
    assert np.ptp(even, axis=(0, 1)).max() < 1e-6
    assert np.ptp(spread_out(np.ones((40, 53, 3), np.float32), spread)) > 0.01


def test_a_lamp_at_one_border_does_not_glow_at_the_other():
    radiance = np.zeros((48, 200, 3), np.float32)
    radiance[24, 0] = 1000.0
    spread = eye_spread()
    row = spread_out(radiance, spread)[24, :, 1]
    expected = 1000 * spread.draw(0, 199)[0, 199:, 1]
    assert np.abs(row / expected - 1).max() < 1e-4
    assert row[199] < 0.2 * row[100]


def test_stars_draw_no_lines_over_the_night():
    # 1e6 on 1e-3: a transform's rounding alone is as large as the night, along the rows and columns of the stars.
    height, width = 270, 480
    random = np.random.default_rng(1)
    radiance = np.full((height, width, 3), 1e-3, np.float32)
    radiance[random.integers(0, height, 12), random.integers(0, width, 12)] = 1e6
    spread = CameraGlare(Blades(6), veil=0).point_spread(height, width)
    expected = np.empty(radiance.shape)
    shape = 3 * height, 3 * width
    for channel in range(3):
        kernel = np.fft.rfft2(spread.draw(height - 1, width - 1)[..., channel].astype(np.float64), shape)
        light = np.fft.rfft2(radiance[..., channel].astype(np.float64), shape)
        expected[..., channel] = np.fft.irfft2(kernel * light, shape)[height - 1 : 2 * height - 1, width - 1 : -1][
            :, :width
        ]
    wrong = np.abs(spread_out(radiance, spread) - expected) / expected
    # At +8 stops the night is a grey of 0.26, and a step of an 8-bit display there 0.6 %.
    assert wrong.max() < 0.003 and np.sqrt((wrong**2).mean()) < 1e-4


def test_no_light_is_negative_and_none_comes_of_darkness():
    spread = eye_spread()
    assert not spread_out(np.zeros((48, 64, 3), np.float32), spread).any()
    one = np.zeros((48, 64, 3), np.float32)
    one[20, 30, 0] = 1e30
    seen = spread_out(one, spread)
    assert seen.min() >= 0 and np.isfinite(seen).all()
    assert seen[..., 0].min() > 0 and not seen[..., 1:].any()


def test_faint_and_bright_pictures_are_the_same_but_for_their_scale():
    radiance, spread = room(40, 53), eye_spread()
    assert np.array_equal(
        spread_out(radiance, spread) * np.float32(2.0**-60), spread_out(radiance * np.float32(2.0**-60), spread)
    )


def test_threads_do_not_change_a_bit(monkeypatch):
    radiance, spread = room(150, 90), eye_spread()
    shared, alone = bands.in_threads, []
    for threads in (1, 3):
        monkeypatch.setattr(convolution, "in_threads", lambda *a, t=threads, **k: shared(*a, threads=t, **k))
        alone.append(spread_out(radiance, spread))
    assert np.array_equal(*alone)


def test_both_ways_to_a_transfer_agree_where_both_are_right():
    canvas = Canvas(20, 31)
    spread = eye_spread()
    kernel = spread.draw(19, 30)[..., 2].copy()
    kernel[19, 30] = 0
    columns = canvas.columns // 2 + 1
    real = symmetric_transfer(lambda begin, end: spread.rows(2, begin, end, canvas), canvas)(0, columns)(0, columns)
    assert real.dtype == np.float32 and real.shape == (canvas.rows, columns)
    assert np.abs(general_transfer(kernel, canvas)(0, columns)(0, columns) - real).max() < 1e-6
