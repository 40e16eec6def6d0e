"""Foveal samples: how many, what they average, and where they look."""

from itertools import pairwise

import numpy as np
import pytest

from relume.virtual_camera.tone.histogram.fovea import (
    adaptation_grid,
    between,
    directions,
    edges,
    foveal_samples,
    foveal_shape,
)
from relume.virtual_camera.view import View


def test_a_sample_is_a_degree_in_the_middle_of_the_picture():
    # Ward Larson et al. 1997, eq. 1: 2·tan(60°/2)/0.01745 = 66.2 samples.
    view = View(800 / 2 / np.tan(np.radians(30)))
    assert foveal_shape((400, 800), view) == (33, 66)


def test_there_are_no_more_samples_than_pixels_and_at_least_one():
    assert foveal_shape((20, 30), View(10.0)) == (20, 30)
    assert foveal_shape((20, 30), View(1e6)) == (1, 1)


def test_samples_are_the_means_of_their_pixels():
    picture = np.random.default_rng(1).random((37, 53, 3)).astype(np.float32)
    samples = foveal_samples(picture, View(300.0), (7, 9))
    tops, lefts = edges(37, 7), edges(53, 9)
    wanted = [[picture[a:b, c:d].mean((0, 1)) for c, d in pairwise(lefts)] for a, b in pairwise(tops)]
    np.testing.assert_allclose(samples, wanted, rtol=1e-5)


def test_a_pixel_belongs_to_the_sample_of_its_upper_left_corner():
    assert edges(10, 4).tolist() == [0, 3, 5, 8, 10]


def test_directions_are_those_of_a_flat_picture():
    rays = directions((1, 2), (100, 200), View(50.0))
    np.testing.assert_allclose(rays, [[[-np.sqrt(0.5), 0, np.sqrt(0.5)], [np.sqrt(0.5), 0, np.sqrt(0.5)]]], atol=1e-12)
    assert directions((2, 1), (100, 200), View(50.0))[0, 0, 1] < 0  # The first row is above.


def test_between_is_the_bilinear_place_of_every_pixel():
    first, share = between(8, 2)
    assert first.tolist() == [0] * 8
    np.testing.assert_allclose(share, [0, 0, 0.125, 0.375, 0.625, 0.875, 1, 1])
    first, share = between(3, 1)
    assert first.tolist() == [0] * 3 and share.tolist() == [0] * 3


@pytest.mark.parametrize("wrong", [-1.0, np.nan, np.ones(3), np.ones((0, 2))])
def test_an_adaptation_luminance_is_a_number_or_a_grid(wrong):
    with pytest.raises(ValueError, match="expected one number or a grid"):
        adaptation_grid(wrong)
