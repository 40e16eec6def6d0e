"""Soft focus: a share of the light glows, the rest stays sharp, none is lost."""

import numpy as np
import pytest

from relume.image.blurring import soft_blurred
from relume.image.radiance import RadianceMap
from relume.virtual_camera.lens.soft_focus import SoftFocus
from relume.virtual_camera.view import View

VIEW = View(100.0)


def lit():
    radiance = np.random.default_rng(4).random((50, 80, 3)).astype(np.float32)
    radiance[20, 30], radiance[3, 77] = (1e6, 1e5, 1e4), 500.0
    return radiance


@pytest.mark.parametrize("width", [80, 150])
def test_it_is_the_gaussian_of_soft_blurred_a_channel_at_a_time(width):
    radiance = np.tile(lit(), (2, 2, 1))[:70, :width]
    expected = soft_blurred(RadianceMap(radiance), 0.02 * width, share=0.3).radiance
    np.testing.assert_allclose(SoftFocus(0.3, 0.02).apply(radiance, VIEW), expected, rtol=2e-6)


def test_no_light_is_lost():
    radiance = lit()
    for soft in (SoftFocus(), SoftFocus(1.0, 0.1), SoftFocus(0.5, 1.0)):
        glowing = soft.apply(radiance, VIEW)
        np.testing.assert_allclose(glowing.sum((0, 1), dtype=float), radiance.sum((0, 1), dtype=float), rtol=1e-6)
        assert glowing.min() >= 0 and np.isfinite(glowing).all()


def test_round_a_sun_in_the_dark_no_light_is_below_zero():
    # The cosine series rounds to 1e-16 of the sun, on both sides of 0, beyond the glow's reach.
    radiance = np.zeros((60, 201, 3), np.float32)
    radiance[30, 20] = 1e8
    assert SoftFocus(1.0, 0.01).apply(radiance, VIEW).min() == 0


def test_a_point_keeps_its_sharp_share_and_glows_by_the_gaussian():
    radiance = np.zeros((101, 201, 3), np.float32)
    radiance[50, 100] = 1000
    glowing = SoftFocus(0.4, 5 / 201).apply(radiance, VIEW)[..., 0]
    # 600 sharp and 400 / (2π 5²) = 2.546 at the middle, e^−½ of it five pixels away.
    assert glowing[50, 100] == pytest.approx(602.546, abs=0.02)
    assert glowing[50, 105] == pytest.approx(2.546 * np.exp(-0.5), rel=0.01)
    assert glowing[50, 105] == pytest.approx(glowing[55, 100], rel=1e-9)


def test_even_and_black_light_stay_and_nothing_is_changed_in_place():
    even = np.full((20, 30, 3), 0.7, np.float32)
    np.testing.assert_allclose(SoftFocus().apply(even, VIEW), even, rtol=1e-6)
    assert SoftFocus().apply(np.zeros((5, 6, 3), np.float32), VIEW).max() == 0
    radiance = lit()
    before = radiance.copy()
    for soft in (SoftFocus(0.0, 0.1), SoftFocus(0.5, 0.0)):
        sharp = soft.apply(radiance, VIEW)
        assert np.array_equal(sharp, radiance) and sharp is not radiance
    SoftFocus().apply(radiance, VIEW)
    assert np.array_equal(radiance, before)
