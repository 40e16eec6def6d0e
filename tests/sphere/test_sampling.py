"""Directions drawn by chance against their moments, solid angles, and the maps that they were drawn from."""

from __future__ import annotations

import numpy as np
import pytest

from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.sampling import (
    BrightDirections,
    by_cosine,
    in_frames,
    into_ball,
    sequences,
    shuffled,
    within_triangles,
)

MANY = 40_000


def test_frames_are_right_handed_wherever_their_axis_points():
    axis = normalised(np.random.default_rng(1).normal(size=(50, 3)))
    axis = np.concatenate([axis, [[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0.0], [1.0, 0, -0.0]]])
    x, y, z = (in_frames(axis, np.tile(row, (len(axis), 1))) for row in np.eye(3))
    np.testing.assert_allclose(z, axis, atol=1e-12)
    np.testing.assert_allclose(np.cross(x, y), axis, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(x, axis=1), 1, atol=1e-12)


def test_directions_by_the_cosine_have_its_moments():
    normal = np.tile(normalised([1.0, -2.0, 0.5]), (MANY, 1))
    drawn = by_cosine(shuffled(np.random.default_rng(2), MANY, 2), normal)
    cosine = np.einsum("ij,ij->i", drawn, normal)
    assert cosine.min() >= 0
    # ∫ cos · cos/π dω = 2/3, and ∫ cos² · cos/π dω = 1/2.
    assert cosine.mean() == pytest.approx(2 / 3, abs=4 * cosine.std() / MANY**0.5)
    assert (cosine**2).mean() == pytest.approx(0.5, abs=4 * (cosine**2).std() / MANY**0.5)
    np.testing.assert_allclose((drawn - cosine[:, None] * normal).mean(0), 0, atol=4 * 0.5 / MANY**0.5)


def test_sequences_fill_the_square_evenly():
    points = sequences(np.random.default_rng(2), 4096, 2, sets=3)
    counts = [np.histogram2d(*each.T, bins=8, range=[[0, 1]] * 2)[0] for each in points]
    # 64 to a cell; those of chance alone would scatter by 8.
    assert np.abs(np.array(counts) - 64).max() <= 8
    assert np.std(counts) < 3


def test_directions_have_the_cosines_density_and_points_the_areas():
    u = sequences(np.random.default_rng(3), 1 << 14, 2)[0]
    normal = np.array([0.36, -0.48, 0.8])
    directions = by_cosine(u, np.tile(normal, (len(u), 1)))
    np.testing.assert_allclose(directions.mean(axis=0), 2 / 3 * normal, atol=2e-3)
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 0, 6.0]])
    points, weights = within_triangles(u, np.tile(corners, (len(u), 1, 1)))
    np.testing.assert_allclose(points.mean(axis=0), [1, 0, 2], atol=5e-3)
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_shuffled_numbers_lie_one_in_each_equal_part():
    u = shuffled(np.random.default_rng(6), 50, 3)
    np.testing.assert_allclose(np.sort(np.floor(u * 50), axis=0), np.tile(np.arange(50.0)[:, None], (1, 3)))
    assert u.max() < 1 and abs(np.corrcoef(u.T)[0, 1]) < 0.5
    assert shuffled(np.random.default_rng(6), 50, 0).shape == (50, 0)


def test_a_ball_fills_the_cone_that_it_is_seen_in():
    origins = np.tile([0.3, 0.0, 3.0], (MANY, 1))
    directions, angle = into_ball(shuffled(np.random.default_rng(3), MANY, 2), origins, np.array([0.3, 0.0, 1.0]), 1.0)
    # A ball of radius 1 at distance 2: half-angle 30°.
    np.testing.assert_allclose(angle, 2 * np.pi * (1 - np.sqrt(3) / 2), rtol=1e-12)
    cosine = -directions[:, 2]
    assert cosine.min() >= np.sqrt(3) / 2 - 1e-12
    assert cosine.mean() == pytest.approx((1 + np.sqrt(3) / 2) / 2, abs=1e-3)


def test_from_inside_a_ball_all_directions_are_in_it():
    directions, angle = into_ball(shuffled(np.random.default_rng(4), MANY, 2), np.zeros((MANY, 3)), np.zeros(3), 2.0)
    np.testing.assert_allclose(angle, 4 * np.pi)
    np.testing.assert_allclose(directions.mean(0), 0, atol=4 * 3**-0.5 / MANY**0.5)


def test_bright_directions_carry_the_light_of_their_map():
    pixels = np.full((16, 32, 3), 0.1, np.float32)
    pixels[3, 5] = (400.0, 300.0, 200.0)
    light = EnvironmentMap(pixels)
    towards, weight = BrightDirections.of(light).drawn(shuffled(np.random.default_rng(5), MANY, 2))
    # What is drawn is looked up between pixels, so truth is as well.
    directions, angles = pixel_directions(LatLong(), 256), LatLong().solid_angles(256)
    looked_up = light.lookup(directions)
    truth = np.einsum("hwc,hw->c", looked_up, angles)
    np.testing.assert_allclose(weight.mean(0), truth, rtol=0.02)
    upward = np.einsum("hwc,hw->c", looked_up * np.maximum(directions[..., 1:2], 0), angles)
    np.testing.assert_allclose((weight * np.maximum(towards[:, 1:2], 0)).mean(0), upward, rtol=0.02)


def test_a_black_map_and_another_mapping_have_no_bright_directions():
    with pytest.raises(ValueError, match="lat-long map that shines"):
        BrightDirections.of(EnvironmentMap(np.zeros((4, 8, 3), np.float32)))
    with pytest.raises(ValueError, match="lat-long map that shines"):
        BrightDirections.of(EnvironmentMap(np.ones((8, 8, 3), np.float32), Angular()))
