"""Colours lost in the dark: cones alone, rods alone, and both."""

import numpy as np
import pytest

from relume.image.primaries import REC709
from relume.virtual_camera.tone.histogram.eye import colours_in_the_dark
from relume.virtual_camera.tone.vision import scotopic_luminance
from relume.virtual_camera.view import View

VIEW = View(500.0)


def pixels(seed=0, shape=(6, 9)):
    return np.random.default_rng(seed).random((*shape, 3)).astype(np.float32) * 3


def test_daylight_colours_are_kept_to_the_bit():
    picture = pixels()
    np.testing.assert_array_equal(colours_in_the_dark(picture, VIEW, 5.63), picture)


def test_in_starlight_all_is_grey_by_the_rods():
    picture = pixels()
    seen = colours_in_the_dark(picture, VIEW, 5e-3)
    xyz = picture.astype(float) @ REC709.to_xyz().T
    grey = scotopic_luminance(xyz) / scotopic_luminance(REC709.to_xyz().sum(1))
    np.testing.assert_allclose(seen, np.repeat(grey[..., None], 3, -1), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(
    ("colour", "grey"), [((1, 0, 0), 0.0329), ((0, 1, 0), 0.7652), ((0, 0, 1), 0.2016), ((2, 2, 2), 2.0)]
)
def test_reds_darken_and_greys_stay(colour, grey):
    # Eq. 13 by hand: red 0.2126·(1.33·(1 + 0.2319/0.4124) − 1.68) = 0.0846, and so on; white is 2.5733.
    picture = np.full((2, 2, 3), colour, np.float32)
    np.testing.assert_allclose(colours_in_the_dark(picture, VIEW, 0.0), grey, atol=2e-4)


def test_between_the_two_colours_fade_with_the_adaptation():
    picture, dark, light = pixels(), 5.6e-3, 5.62
    seen = colours_in_the_dark(picture, VIEW, dark + 0.25 * (light - dark))
    night = colours_in_the_dark(picture, VIEW, 0.0)
    np.testing.assert_allclose(seen, 0.25 * picture + 0.75 * night, rtol=1e-5)


def test_each_place_has_its_own_adaptation():
    picture = pixels(shape=(40, 60))
    grid = np.array([[1e-4, 100.0], [1e-4, 100.0]])
    seen = colours_in_the_dark(picture, VIEW, grid)
    assert np.ptp(seen[:, :15], axis=-1).max() < 1e-6
    np.testing.assert_array_equal(seen[:, 45:], picture[:, 45:])


def test_it_may_work_in_place_and_otherwise_leaves_the_picture():
    picture = pixels()
    before = picture.copy()
    seen = colours_in_the_dark(picture, VIEW, 0.1)
    np.testing.assert_array_equal(picture, before)
    assert colours_in_the_dark(picture, VIEW, 0.1, out=picture) is picture
    np.testing.assert_array_equal(picture, seen)


def test_black_stays_black():
    assert not colours_in_the_dark(np.zeros((3, 4, 3), np.float32), VIEW, 0.0).any()
