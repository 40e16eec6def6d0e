"""Endless noise: every pixel's own number, convolved exactly, the same in any picture and on any cores."""

import numpy as np
import pytest
from scipy.signal import convolve2d
from scipy.special import ndtr, ndtri

from relume.virtual_camera.film.grain import SIDE, noise_of
from relume.virtual_camera.film.grain_kernels import QUANTILES, add_to_values, fill_white

EVEN = 2**64
PINNED = [[-1.01284, -0.307828], [-2.054548, -0.796688], [-0.642381, -0.002655]]


def splitmix(state: int) -> int:
    z = (state ^ (state >> 30)) * 0xBF58476D1CE4E5B9 % EVEN
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB % EVEN
    return z ^ (z >> 31)


def normal(bits: int) -> float:
    chance = ((bits >> 1 & 0x7FFFFFFF) + 0.5) / 2**32
    return float(ndtri(chance)) * (-1 if bits & 1 else 1)


def slow_white(seed: int, top: int, left: int, height: int, width: int) -> np.ndarray:
    golden = 0x9E3779B97F4A7C15
    white = np.empty((3, height, width))
    for y in range(height):
        key = splitmix((splitmix((seed + golden) % EVEN) + (top + y) * golden) % EVEN)
        for x in range(width):
            first, second = (splitmix((key + (2 * (left + x) + more) * golden) % EVEN) for more in (0, 1))
            white[:, y, x] = normal(first), normal(first >> 32), normal(second)
    return white


def white(seed: int, top: int, left: int, height: int, width: int) -> np.ndarray:
    out = np.empty((3, height, width), np.float32)
    fill_white(np.uint64(seed), top, left, QUANTILES, out)
    return out


def kernels(seed: int = 0, side: int = 5) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(3, 3, side, side))


def test_white_noise_is_normal_numbers_of_the_pixels_own_hash():
    # Above and left of the corner too, where the margins of the first squares are.
    np.testing.assert_allclose(white(7, -2, -3, 9, 11), slow_white(7, -2, -3, 9, 11), atol=2e-5)


def test_white_noise_stays_what_it_was():
    np.testing.assert_allclose(white(1, 0, 0, 1, 2)[:, 0], PINNED, atol=1e-5)


def test_white_noise_is_normal_and_independent():
    numbers = white(2, 0, 0, 600, 500).astype(np.float64)
    # 300,000 of each channel: four deviations of what is reported.
    assert np.abs(numbers.mean((1, 2))).max() < 4 / np.sqrt(3e5)
    np.testing.assert_allclose(numbers.var((1, 2)), 1, atol=4 * np.sqrt(2 / 3e5))
    np.testing.assert_allclose((numbers**4).mean((1, 2)), 3, atol=4 * np.sqrt(96 / 3e5))
    limits = np.array([-4, -3, -2, -1, 0, 1, 2, 3, 4.0])
    share = (numbers.ravel()[:, None] < limits).mean(0)
    assert np.abs(share - ndtr(limits)).max() < 4 * 0.5 / np.sqrt(9e5)
    for shift in ((0, 1), (1, 0), (1, 1)):
        moved = np.roll(numbers, shift, axis=(1, 2))
        assert np.abs(np.einsum("ayx,byx->ab", numbers, moved)).max() / 3e5 < 5 / np.sqrt(3e5)


def test_a_square_is_the_convolution_of_white_noise():
    own = kernels()
    top, left, cut = 100, 37, 30
    drawn = noise_of(own, 5).square(top, left)
    assert drawn.shape == (3, SIDE - 4, SIDE - 4) and drawn.dtype == np.float32
    given = white(5, top - 2, left - 2, cut + 4, cut + 4)
    for a in range(3):
        wanted = sum(convolve2d(given[b], own[a, b], mode="valid") for b in range(3))
        np.testing.assert_allclose(drawn[a, :cut, :cut], wanted, atol=2e-4)


def test_squares_meet_without_a_seam():
    noise, side = noise_of(kernels(1), 3), SIDE - 4
    whole = noise.square(side - 20, side - 30)
    np.testing.assert_allclose(noise.square(side, side)[:, :50, :50], whole[:, 20:70, 30:80], atol=2e-4)


@pytest.mark.parametrize("cores", [1, 3])
def test_squares_cover_a_picture_once_whatever_the_cores(cores, monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    drawn = np.zeros((3, 600, 400), np.float32)

    def put(top: int, left: int, noise: np.ndarray) -> None:
        drawn[:, top : top + noise.shape[1], left : left + noise.shape[2]] += noise

    noise = noise_of(kernels(2), 3)
    noise.each_square(600, 400, put)
    np.testing.assert_array_equal(drawn[:, :252, :252], noise.square(0, 0))
    np.testing.assert_array_equal(drawn[:, 504:, 252:], noise.square(504, 252)[:, :96, :148])
    assert np.all(drawn != 0)


def test_noise_is_added_to_pixel_values_and_what_saturates_stays():
    from relume.image.colour import decode_srgb, encode_srgb
    from relume.virtual_camera.film.float_table import tabulated

    generator = np.random.default_rng(0)
    shown = generator.random((20, 30, 3)).astype(np.float32)
    shown[0], shown[1] = 0, 1
    before, noise = shown.copy(), generator.normal(size=(3, 20, 30)).astype(np.float32)
    spread = np.stack([tabulated(lambda light, c=c: c + 1 + light) for c in range(3)])
    add_to_values(
        shown,
        noise,
        tabulated(lambda light: 255 * encode_srgb(light)),
        spread,
        tabulated(lambda v: decode_srgb(v / 255)),
    )
    np.testing.assert_array_equal(shown[:2], before[:2])
    deviation = np.array([1, 2, 3]) + before
    values = np.clip(255 * encode_srgb(before.astype(np.float64)) + np.moveaxis(noise, 0, -1) * deviation, 0, 255)
    np.testing.assert_allclose(shown[2:], decode_srgb(values / 255)[2:], atol=2e-6, rtol=1e-5)
