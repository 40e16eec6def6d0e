"""The veil of light scattered in the eye: its sum, its shape and its energy."""

import numpy as np

from relume.virtual_camera.tone.histogram import eye
from relume.virtual_camera.tone.histogram.eye import veil_luminance, veiled
from relume.virtual_camera.tone.histogram.fovea import directions
from relume.virtual_camera.view import View

VIEW = View(200.0)


def slow_veil(foveal, view, picture):
    rays = directions(foveal.shape, picture, view).reshape(-1, 3)
    cosines = rays @ rays.T
    with np.errstate(divide="ignore"):
        weights = np.where(cosines > 0, cosines / (2 - 2 * cosines), 0) * rays[:, 2] ** 3
    width = np.sqrt(np.prod(picture) / foveal.size) / view.focal_length
    ring = 2 * np.pi * np.log(width * rays[:, 2] ** 1.5 / np.radians(1)) / width**2
    np.fill_diagonal(weights, np.maximum(ring, 0))
    return (0.087 * (weights @ foveal.ravel()) / weights.sum(1)).reshape(foveal.shape)


def test_the_veil_is_the_weighted_mean_of_everything_else():
    foveal = np.random.default_rng(2).random((9, 14)) ** 4 * 100
    np.testing.assert_allclose(veil_luminance(foveal, VIEW, (120, 180)), slow_veil(foveal, VIEW, (120, 180)), rtol=1e-9)


def test_the_weights_are_those_of_moon_and_spencer():
    # A row of 41 samples of a degree, a lamp in the last: 0.087·L·(cos θ/θ²)/Σ(cos θ/θ²) with the angles themselves,
    # which θ² ≈ 2 − 2·cos θ replaces; over 40° it is out by 4 %.
    foveal = np.zeros((1, 41))
    foveal[0, 40] = 1000
    seen = veil_luminance(foveal, VIEW, (3, 143))
    place = np.arctan((np.arange(41) - 20) * 143 / 41 / VIEW.focal_length)
    for i in (0, 20, 38):
        angles = np.delete(place - place[i], i)
        weights = np.cos(angles) / angles**2 * np.delete(np.cos(place) ** 3, i)
        np.testing.assert_allclose(seen[0, i], 87 * weights[-1] / weights.sum(), rtol=0.045)
    assert seen[0, 40] == 0


def test_even_light_stays_as_it_is():
    np.testing.assert_allclose(veiled(np.full((30, 47, 3), 5.0, np.float32), VIEW), 5.0, rtol=1e-6)


def test_a_picture_of_one_sample_stays_as_it_is():
    np.testing.assert_allclose(veiled(np.full((4, 5, 3), 5.0, np.float32), View(1e5)), 5.0, rtol=1e-6)


def test_a_lamp_veils_what_is_near_it_in_its_own_colour():
    picture = np.zeros((100, 100, 3), np.float32)
    picture[46:54, 46:54] = (4000, 400, 0)
    before = picture.copy()
    seen = veiled(picture, VIEW)
    np.testing.assert_array_equal(picture, before)
    np.testing.assert_allclose(seen[50, 50, 0], 0.913 * 4000, rtol=0.02)
    assert seen[50, 60, 0] > 4 * seen[50, 90, 0] > 0
    np.testing.assert_allclose(seen[..., 1], seen[..., 0] / 10, rtol=1e-4)
    assert not seen[..., 2].any()


def test_the_veil_is_interpolated_without_steps():
    picture = np.zeros((100, 100, 3), np.float32)
    picture[46:54, 46:54] = 1000
    row = np.log(veiled(picture, VIEW)[20, :, 0])
    assert np.abs(np.diff(row)).max() < 0.06  # Over a sample of 3.5 pixels the veil itself changes by 0.17.


def test_a_very_wide_picture_takes_coarser_samples(monkeypatch):
    picture = np.zeros((100, 100, 3), np.float32)
    picture[:, :30] = 10
    fine = veiled(picture, VIEW)
    monkeypatch.setattr(eye, "_MOST", 200)
    coarse = veiled(picture, VIEW)
    assert not np.array_equal(coarse, fine)
    np.testing.assert_allclose(coarse[10:-10, 60:-10], fine[10:-10, 60:-10], rtol=0.06)
