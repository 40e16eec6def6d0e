"""Sharpness: the spread of a point is found on slanted edges, and given to what was rendered."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, gaussian_gradient_magnitude, uniform_filter
from scipy.special import ndtr

from relume.image import bands
from relume.image.radiance import RadianceMap
from relume.renderers.results import Change
from relume.virtual_camera.plate_matching.edges import RADIUS, _relative_slope, clean_edges
from relume.virtual_camera.plate_matching.sharpness import Sharpness, measured_sharpness


def board(
    sigma: float, noise: float = 0.0, *, height: int = 140, width: int = 180, side: int = 30, finer: int = 4
) -> np.ndarray:
    """A slanted chequered board seen through a lens of that spread by pixels as wide as they are, (H, W)."""
    y, x = (np.mgrid[: height * finer, : width * finer] + 0.5) / finer
    across, down = x * np.cos(0.14) + y * np.sin(0.14), y * np.cos(0.14) - x * np.sin(0.14)
    light = 0.1 + 0.6 * ((across // side + down // side) % 2)
    light = gaussian_filter(light, sigma * finer) if sigma else light
    light = light.reshape(height, finer, width, finer).mean((1, 3))
    return light + noise * np.sqrt(light) * np.random.default_rng(0).standard_normal(light.shape)


def plate(light: np.ndarray, clipped: np.ndarray | None = None) -> RadianceMap:
    return RadianceMap(np.repeat(light[..., None], 3, axis=2).astype(np.float32), clipped=clipped)


def change_of(objects: np.ndarray, matte: np.ndarray) -> Change:
    none = np.zeros_like(objects)
    return Change(objects, none, matte, none[..., 0], none, none, objects**2, none)


@pytest.mark.parametrize("sigma", [0.4, 0.8, 1.2])
def test_the_spread_of_a_point_is_found_beside_the_pixels_own_width(sigma):
    found = measured_sharpness(plate(board(sigma, noise=0.005)))
    assert found is not None
    assert found.sigma == pytest.approx(sigma, abs=0.015) and found.error < 0.02 and found.edges >= 20


def test_a_soft_plate_is_looked_at_by_larger_pixels():
    found = measured_sharpness(plate(board(2.4, noise=0.005, height=240, width=280, side=60)))
    assert found is not None and found.sigma == pytest.approx(2.4, abs=0.06)


def test_a_plate_as_sharp_as_its_pixels_is_hardly_softened():
    # The pixel is a box and not the Gaussian that is fitted; a variance of 0.02 is what that leaves.
    found = measured_sharpness(plate(board(0.0)))
    assert found is not None and found.sigma < 0.15


def test_the_sharpest_edges_say_of_the_lens_and_the_soft_ones_of_shadows():
    both = np.concatenate([board(0.5), board(1.2)], axis=1)
    found = measured_sharpness(plate(both))
    assert found is not None and found.sigma == pytest.approx(0.5, abs=0.02)


def test_a_plate_without_edges_gives_nothing():
    y, x = np.mgrid[:140, :180]
    assert measured_sharpness(plate(1 + 0.3 * np.sin(x / 30) * np.cos(y / 25))) is None
    assert measured_sharpness(plate(np.ones((8, 8)))) is None
    noise = np.random.default_rng(3).random((140, 180)) + 0.5
    assert measured_sharpness(plate(noise)) is None


def test_edges_at_clipped_pixels_do_not_count():
    light = board(1.0)
    found = clean_edges(light)
    assert len(found.spread) > 20
    clipped = np.zeros(light.shape, np.uint8)
    clipped[:, 90:] = 1
    light[:, 90:] = np.minimum(light, 0.3)[:, 90:]  # where lamps are cut off edges look sharper
    with_, without = measured_sharpness(plate(light, clipped)), measured_sharpness(plate(light))
    assert with_ is not None and without is not None
    assert with_.sigma == pytest.approx(1, abs=0.01) and without.sigma < 0.9
    half = light.copy()
    half[:, 90:] = np.nan
    assert clean_edges(half).points[:, 0].max() < 90


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.3])
def test_the_blur_makes_of_pixels_what_pixels_behind_the_gaussian_would_be(sigma):
    # An edge at sixteen places within a pixel, seen by pixels as they are and by pixels behind the lens.
    place = np.arange(-20, 21) + np.arange(16)[:, None] / 16
    fine = place[..., None] + (np.arange(64) + 0.5) / 64 - 0.5
    sharp, soft = (fine > 0).mean(-1), ndtr(fine / sigma).mean(-1)
    blurred = np.stack([Sharpness(sigma).blurred(row[None])[0] for row in sharp])
    misfit, before = (np.sqrt(np.mean((b - soft)[:, 10:30] ** 2)) for b in (blurred, sharp))
    # Between the pixels no weights are right for every place: up to 1 % of the edge remains.
    assert misfit < 0.01 and misfit < (0.9 if sigma < 0.3 else 0.3) * before


def test_the_blur_keeps_the_light_and_is_round():
    point = np.zeros((41, 41))
    point[20, 20] = 3
    spread = Sharpness(1.3).blurred(point)
    x = np.arange(-20, 21)
    assert spread.sum() == pytest.approx(3) and spread.min() >= 0
    np.testing.assert_allclose(spread, spread.T, atol=1e-15)
    np.testing.assert_allclose(spread, spread[::-1, ::-1], atol=1e-15)
    assert (spread * x**2).sum() / 3 == pytest.approx(1.3**2, rel=0.002)


def test_what_is_far_from_the_objects_stays_exactly_zero():
    objects, matte = np.zeros((30, 60, 3), np.float32), np.zeros((30, 60), np.float32)
    objects[10:20, 10:20], matte[10:20, 10:20] = 0.7, 1
    soft = Sharpness(0.6).apply(change_of(objects, matte))
    assert np.count_nonzero(soft.matte[:, 26:]) == 0 and np.count_nonzero(soft.objects[:, 26:]) == 0
    assert 0 < soft.matte[9, 15] < 0.5 and soft.matte.max() <= 1 and soft.matte.dtype == np.float32
    # Premultiplied light and its matte are softened alike: the colour stays.
    covered = soft.matte > 1e-4
    np.testing.assert_allclose(soft.objects[covered], 0.7 * soft.matte[covered][:, None] * np.ones(3), rtol=1e-4)


def test_objects_softened_to_the_plate_measure_as_sharp_as_it():
    for sigma in (0.5, 1.0):
        light = np.repeat(board(0.0)[..., None], 3, axis=2).astype(np.float32)
        soft = Sharpness(sigma).apply(change_of(light, np.ones(light.shape[:2], np.float32)))
        found = measured_sharpness(RadianceMap(soft.objects))
        assert found is not None and found.sigma == pytest.approx(sigma, abs=0.03)


def test_a_sharp_plate_changes_no_bit():
    change = change_of(np.ones((5, 5, 3), np.float32), np.ones((5, 5), np.float32))
    assert Sharpness(0.0).apply(change) is change
    with pytest.raises(ValueError, match=r"sigma is -1; expected pixels"):
        Sharpness(-1)


def test_slopes_in_bands_are_those_of_the_whole_plate(monkeypatch):
    light = np.random.default_rng(1).random((210, 90)) + 0.1
    light[50:54, 20:33] = np.nan
    light[120:, 40:] += 3
    filled = np.nan_to_num(light)
    expected = gaussian_gradient_magnitude(filled, 1.0) / uniform_filter(filled, 2 * RADIUS + 1)
    expected[uniform_filter(np.isnan(light).astype(np.float64), 2 * RADIUS + 3) > 1e-9] = 0
    monkeypatch.setattr(bands, "BAND", 90 * 25)
    np.testing.assert_array_equal(_relative_slope(light), expected)
