"""Measured point spreads: to the right side, without losing light, and from a picture of a lamp."""

import warnings

import numpy as np
import pytest

from relume.image.radiance import RadianceMap
from relume.virtual_camera.lens.glare.measured import MeasuredGlare
from relume.virtual_camera.view import View

VIEW = View(50.0)


def test_light_goes_where_the_kernel_says():
    kernel = np.zeros((7, 61, 3), np.float32)
    # 20 pixels right and 2 down, 3 left, 1 up and 25 left: within and beyond what is convolved by tiles.
    kernel[3, 30], kernel[5, 50], kernel[3, 27], kernel[2, 5] = 0.5, 0.25, (0.25, 0.15, 0.05), (0.0, 0.1, 0.2)
    lamp = np.zeros((40, 90, 3), np.float32)
    lamp[10, 45] = 8.0
    seen = MeasuredGlare(kernel).apply(lamp, VIEW)
    expected = np.zeros_like(lamp)
    expected[10, 45], expected[12, 65], expected[10, 42], expected[9, 20] = 4, 2, (2, 1.2, 0.4), (0, 0.8, 1.6)
    assert np.abs(seen - expected).max() < 1e-6


def test_what_leaves_the_frame_does_not_come_back():
    kernel = np.zeros((1, 81))
    kernel[0, 80] = 1.0
    lamp = np.ones((3, 60, 3), np.float32)
    seen = MeasuredGlare(kernel).apply(lamp, VIEW)
    assert np.abs(seen[:, :40]).max() < 1e-6 and np.abs(seen[:, 40:] - 1).max() < 1e-6
    mirrored = MeasuredGlare(kernel, mirrored=True).apply(lamp, VIEW)
    assert np.abs(mirrored - 1).max() < 1e-6


@pytest.mark.parametrize("size", [(9, 9), (91, 41), (1, 1)])
def test_no_light_is_lost_inside(size):
    kernel = np.random.default_rng(1).random((*size, 3))
    kernel /= kernel.sum((0, 1))
    lamp = np.zeros((120, 80, 3), np.float32)
    lamp[60, 40] = 5, 6, 7
    assert MeasuredGlare(kernel).apply(lamp, VIEW).sum((0, 1)) == pytest.approx([5, 6, 7], rel=1e-5)


def test_another_sum_is_made_one_and_said():
    with pytest.warns(UserWarning, match=r"sums to \[?0\.9"):
        glare = MeasuredGlare(np.full((3, 3), 0.1))
    lamp = np.zeros((9, 9, 3), np.float32)
    lamp[4, 4] = 9.0
    seen = glare.apply(lamp, VIEW)
    assert np.abs(seen[3:6, 3:6] - 1).max() < 1e-6
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MeasuredGlare(np.full((3, 3), 1 / 9 + 1e-5))


def test_a_picture_of_a_lamp_is_a_point_spread():
    picture = np.zeros((30, 40, 3), np.float32)
    picture[10, 15], picture[10, 18] = (30, 60, 90), (10, 20, 30)
    glare = MeasuredGlare.of_lamp(RadianceMap(picture))
    assert glare.kernel.shape == (21, 31, 3)
    assert glare.kernel[10, 15] == pytest.approx([0.75] * 3) and glare.kernel[10, 18] == pytest.approx([0.25] * 3)
    for wrong, words in ((np.zeros_like(picture), "x 0, y 0, is black"), (picture[10:], "or at the border")):
        with pytest.raises(ValueError, match=words):
            MeasuredGlare.of_lamp(RadianceMap(wrong))
    with pytest.raises(ValueError, match="channel without light"):
        MeasuredGlare.of_lamp(RadianceMap(picture * np.array([1, 1, 0], np.float32)))
