"""A light meter's readings, each beside its slow twin in NumPy, and the same for any number of threads."""

import numpy as np
import pytest

from relume.virtual_camera.tone.luminance_curve import WEIGHTS
from relume.virtual_camera.tone.luminance_statistics import light_sum, log_average, luminances, percentiles


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    """(400, 500, 3) float32 over eight decades, with black rows and pixels that are no multiple of a kernel's block."""
    generator = np.random.default_rng(3)
    pixels = np.exp(generator.normal(0, 3, (400, 499, 3))).astype(np.float32)
    pixels[:30] = 0
    return pixels


def test_the_log_average_leaves_out_black_and_adds_delta(picture: np.ndarray):
    light = picture.astype(np.float64) @ WEIGHTS.astype(np.float64)
    lit = light[light > 0]
    assert log_average(picture) == pytest.approx(np.exp(np.log(lit).mean()), rel=1e-7)
    assert log_average(picture, 0.25) == pytest.approx(np.exp(np.log(lit + 0.25).mean()), rel=1e-7)


def test_the_log_average_holds_at_the_ends_of_float32():
    for light in (1e-44, 3.2e38):
        pixels = np.full((10, 70, 3), light, np.float32)
        assert log_average(pixels) == pytest.approx(float(pixels[0, 0, 0]), rel=0.2 if light < 1 else 1e-6)


def test_of_two_luminances_the_log_average_is_their_geometric_mean():
    pixels = np.ones((2, 600, 3), np.float32)
    pixels[1] = 10000
    assert log_average(pixels) == pytest.approx(100, rel=1e-6)


def test_a_black_picture_has_a_log_average_of_one_and_percentiles_of_zero():
    black = np.zeros((5, 6, 3), np.float32)
    assert log_average(black) == 1
    assert percentiles(black, 1, 99) == [0, 0]
    assert light_sum(black)[1] == 0


def test_the_sum_is_of_every_channel_and_the_highest_of_luminance(picture: np.ndarray):
    colour, highest = light_sum(picture)
    np.testing.assert_allclose(colour, picture.mean((0, 1), dtype=np.float64), rtol=1e-12)
    assert highest == pytest.approx(float((picture @ WEIGHTS).max()), rel=1e-6)


@pytest.mark.parametrize("percent", [0.0, 0.01, 1.0, 37.0, 50.0, 99.0, 99.99, 100.0])
def test_percentiles_are_exact_order_statistics_of_what_is_lit(picture: np.ndarray, percent: float):
    lit = np.sort(picture[picture > 0])
    rank = max(int(np.ceil(percent / 100 * lit.size)), 1)
    assert percentiles(picture, percent) == [float(lit[rank - 1])]


def test_negative_zeros_are_black():
    assert percentiles(np.array([-0.0, -0.0, 0.0, 5.0], np.float32), 1) == [5.0]


def test_luminances_are_those_of_the_pixels(picture: np.ndarray):
    assert luminances(picture).shape == (400, 499)
    np.testing.assert_allclose(luminances(picture), picture @ WEIGHTS, rtol=3e-7)


def test_readings_do_not_depend_on_the_number_of_threads(picture: np.ndarray, monkeypatch: pytest.MonkeyPatch):
    large = np.concatenate([picture] * 2)
    several = log_average(large, 1e-3), percentiles(large, 5, 95), light_sum(large)[0].tolist()
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    assert (log_average(large, 1e-3), percentiles(large, 5, 95), light_sum(large)[0].tolist()) == several
