"""Halation: light goes where reflection at the back of the film sends it, and none is lost."""

from dataclasses import replace

import numpy as np
import pytest

from relume.virtual_camera.film.darkroom import Darkroom
from relume.virtual_camera.film.halation import Halation
from relume.virtual_camera.film.printing_kernel import add_halo
from relume.virtual_camera.film.stocks import colour_negative

STRONG = Halation((0.3, 0.1, 0.0))


def exposed(light: np.ndarray, pixel: float, halation: Halation = STRONG) -> np.ndarray:
    """Exposures (3, H, W) with their halo, of light (H, W, 3)."""
    darkroom = Darkroom(replace(colour_negative(), halation=halation))
    shares, halo, step = darkroom._halo(light, np.eye(3, dtype=np.float32), pixel)
    out = np.ascontiguousarray(np.moveaxis(light, 2, 0))
    for layer in range(3):
        for row in range(light.shape[0]):
            add_halo(out[layer, row], shares[layer], halo[layer], step, row)
    return out


def lamp(height: int, width: int, *at: int) -> np.ndarray:
    light = np.zeros((height, width, 3), np.float32)
    light[at[0] : at[0] + 3, at[1] : at[1] + 3] = 1000
    return light


@pytest.mark.parametrize("pixel, step", [(60.0, 1), (9.0, 2), (6.0, 3)])
def test_energy_is_kept_at_any_size_of_pixels_even_at_the_border(pixel, step):
    assert Halation().step(pixel) == step
    for light in (lamp(120, 180, 60, 81), lamp(120, 180, 0, 0), lamp(120, 180, 117, 90)):
        sums = exposed(light, pixel).sum((1, 2), dtype=np.float64)
        np.testing.assert_allclose(sums, 9000, rtol=1e-5)


def test_even_light_stays_even():
    light = np.full((50, 71, 3), 2.0, np.float32)
    for pixel in (60.0, 6.0):
        np.testing.assert_allclose(exposed(light, pixel), 2.0, rtol=1e-5)


def test_the_ring_lies_where_reflection_becomes_total():
    # 2 · 125 µm / √(1.48² − 1) = 229 µm
    radius = np.linspace(0, 900, 9001)
    profile = Halation().profile(radius)
    assert radius[profile.argmax()] == pytest.approx(229.2, abs=0.2)
    # Below the critical angle 3.7 % of the light comes back, ((n − 1) / (n + 1))²; on it all.
    assert profile[0] * 4 * np.pi * 125**2 == pytest.approx((0.48 / 2.48) ** 2, rel=1e-6)
    inside, outside = profile[radius < 200].max(), profile[(radius > 230) & (radius < 300)].min()
    assert outside > 2 * inside


def test_the_halo_about_a_lamp_is_red_and_a_ring():
    light = lamp(201, 201, 99, 99)
    red, green, blue = exposed(light, 20.0)
    # 229 µm are 11.5 pixels.
    along = red[100, 100:]
    assert along[4:40].argmax() + 4 in (11, 12, 13)
    np.testing.assert_array_equal(blue, light[..., 2])
    away = np.hypot(*(np.mgrid[:201, :201] - 100)) > 5
    np.testing.assert_allclose(red[away], 3 * green[away], rtol=1e-4)


def test_blocks_of_pixels_give_the_halo_that_single_pixels_give():
    light = lamp(180, 240, 80, 120)
    coarse = exposed(light, 8.0)[0]
    kernel = STRONG.kernel(8.0)
    reach = kernel.shape[0] // 2
    exact = np.zeros((180, 240))
    for y in range(80, 83):
        for x in range(120, 123):
            exact += 300 * kernel[reach - y : reach - y + 180, reach - x : reach - x + 240]
    away = np.hypot(*(np.mgrid[:180, :240] - np.array([81, 121])[:, None, None])) > 4
    # The ring's sharp inner edge is drawn over a block; beside it both agree to a few per cent of the brightest.
    difference = np.abs(coarse - exact)[away]
    assert difference.max() < 0.25 * exact[away].max() and difference.mean() < 0.02 * exact[away].max()


def test_the_kernel_has_the_sum_one_and_no_direction():
    kernel = Halation().kernel(30.0)
    assert kernel.sum() == pytest.approx(1) and kernel.min() >= 0
    np.testing.assert_allclose(kernel, kernel.T)
    np.testing.assert_allclose(kernel, kernel[::-1])
    # Neither a square nor a circle is cut out, which 8 stops more would show: next to nothing is at the rim.
    y, x = np.mgrid[: len(kernel), : len(kernel)] - len(kernel) // 2
    rim = np.hypot(x, y) > 0.99 * (len(kernel) // 2)
    assert kernel[rim].max() < 1e-5 * kernel.max()
    along = kernel[len(kernel) // 2, len(kernel) // 2 + 12 :]
    assert np.all(np.diff(along) <= 0) and np.abs(np.diff(np.log(along[along > 1e-4 * kernel.max()]))).max() < 0.4
