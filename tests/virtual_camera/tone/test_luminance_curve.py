"""Curves of luminance: the luminance asked for, colours in proportion, black as black, over all of float32."""

import numpy as np
import pytest

from relume.virtual_camera.tone.luminance_curve import WEIGHTS, curved, factor_table, photographic, scaled

DECADES = np.logspace(-12, 12, 4000)


def coloured(luminances: np.ndarray) -> np.ndarray:
    """Pixels (1, N, 3) float32 of those luminances, each of another colour."""
    colours = np.random.default_rng(1).uniform(0.05, 1, (len(luminances), 3))
    return (luminances[:, None] * colours / (colours @ WEIGHTS.astype(float))[:, None])[None].astype(np.float32)


def luminance_of(pixels: np.ndarray) -> np.ndarray:
    return (pixels.astype(np.float64) @ WEIGHTS.astype(np.float64))[0]


@pytest.mark.parametrize("power", [0.2, 0.7, 1.6])
def test_a_power_of_luminance_is_right_to_4e_6_over_24_decades(power: float):
    pixels = coloured(DECADES)
    shown = curved(pixels, lambda light: light**power)
    assert shown.dtype == np.float32
    np.testing.assert_allclose(luminance_of(shown), luminance_of(pixels) ** power, rtol=4e-6)


def test_every_pixel_keeps_its_proportions():
    pixels = coloured(DECADES)
    shown = curved(pixels, lambda light: light / (1 + light))
    np.testing.assert_allclose(shown[..., 0] * pixels[..., 2], shown[..., 2] * pixels[..., 0], rtol=1e-6)
    np.testing.assert_allclose(shown[..., 1] * pixels[..., 2], shown[..., 2] * pixels[..., 1], rtol=1e-6)


def test_black_and_negative_zero_stay_black():
    black = np.array([[[0, 0, 0], [-0.0, -0.0, -0.0]]], np.float32)
    for shown in (curved(black, lambda light: light**0.1), photographic(black, 1e30, 0.1), scaled(black, 1e30)):
        assert np.all(shown == 0)


def test_the_table_is_exact_at_its_nodes_and_finite_everywhere():
    table = factor_table(lambda light: 3 * light)
    assert table.shape == (65537,)
    nodes = (np.arange(65280, dtype=np.uint32) << 15).view(np.float32)
    assert np.all(table[:65280][nodes < 3e29] == 3)
    # Beyond display values of 1e30 no light is distinguished, so that any of its channels stays finite.
    assert table[65279] * float(nodes[-1]) == pytest.approx(1e30)
    assert np.all(np.isfinite(factor_table(lambda light: light**0.01)))


@pytest.mark.parametrize("scale", [1.0, 0.03, 1e5])
@pytest.mark.parametrize("white", [0.5, 40.0, np.inf])
def test_the_photographic_kernel_is_its_slow_twin(scale: float, white: float):
    pixels = coloured(DECADES)
    light = luminance_of(pixels) * scale
    expected = light * (1 + light / white**2) / (1 + light)
    np.testing.assert_allclose(luminance_of(photographic(pixels, scale, white)), expected, rtol=4e-7)


def test_a_gain_is_a_product_and_the_picture_stays_as_it_was():
    pixels = coloured(DECADES)
    before = pixels.copy()
    np.testing.assert_array_equal(scaled(pixels, 0.3), pixels * np.float32(0.3))
    curved(pixels, np.sqrt)
    np.testing.assert_array_equal(pixels, before)


def test_rows_that_are_not_contiguous_are_read_as_they_lie():
    pixels = np.random.default_rng(2).random((8, 9, 4)).astype(np.float32)[::2, ::-1, :3]
    np.testing.assert_array_equal(curved(pixels, np.sqrt), curved(pixels.copy(), np.sqrt))
    assert curved(pixels, np.sqrt)[1, 2, 0] == pytest.approx(
        pixels[1, 2, 0] / np.sqrt(float(pixels[1, 2] @ WEIGHTS)), rel=4e-6
    )


def test_a_curve_that_falls_below_0_is_followed_to_the_lowest():
    # A screen's black of a tenth, taken off: 0.02 is shown as −0.08, and 0.5 as 0.4.
    grey = np.repeat(np.array([[0.02, 0.5, 1e-44, 0.0]], np.float32)[..., None], 3, -1)
    seen = curved(grey, lambda light: light - 0.1, lowest=-0.1)[0]
    assert seen[:2, 1] == pytest.approx([-0.08, 0.4], rel=1e-5)
    assert np.all(np.isfinite(seen)) and seen.min() >= -0.1 and np.all(seen[3] == 0)
    blue = np.array([[[0, 0, 0.5]]], np.float32)
    assert curved(blue, lambda light: light - 0.1, lowest=-0.1)[0, 0] == pytest.approx([0, 0, -0.1])
    assert curved(blue, lambda light: light - 0.1)[0, 0].min() == 0
