"""The frame: right-handed, +Y up, a camera looks along −Z with +X to its right; rotations are active."""

import numpy as np
import pytest

from relume.sphere.directions import (
    UP,
    lengths,
    look_at,
    normalised,
    rotation_about,
    rotation_between,
    rotation_from_vector,
)

X, Y, Z = np.eye(3)
EXACT = 1e-15
"""Rounding of a few sines and products of them in doubles."""


def test_up_is_plus_y():
    assert UP.tolist() == [0.0, 1.0, 0.0]


def test_a_quarter_turn_is_active_and_right_handed():
    np.testing.assert_allclose(rotation_about(Z, np.pi / 2) @ X, Y, atol=EXACT)
    np.testing.assert_allclose(rotation_about(X, np.pi / 2) @ Y, Z, atol=EXACT)
    np.testing.assert_allclose(rotation_about(Y, np.pi / 2) @ Z, X, atol=EXACT)


def test_the_length_of_the_axis_does_not_matter():
    np.testing.assert_allclose(rotation_about([0, 7, 0], 0.3), rotation_about(Y, 0.3), atol=EXACT)


def test_a_rotation_vector_carries_axis_and_angle():
    np.testing.assert_allclose(rotation_from_vector(np.array([0, 0, np.pi / 2])) @ X, Y, atol=EXACT)
    assert np.array_equal(rotation_from_vector(np.zeros(3)), np.eye(3))


@pytest.mark.parametrize("seed", range(5))
def test_rotation_between_turns_the_first_direction_into_the_second_by_the_smallest_angle(seed):
    start, end = normalised(np.random.default_rng(seed).normal(size=(2, 3)))
    rotation = rotation_between(start, end)
    np.testing.assert_allclose(rotation @ start, end, atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    # trace = 1 + 2 cos(angle): no turn beyond the angle between the two.
    assert np.trace(rotation) == pytest.approx(1 + 2 * start @ end, abs=1e-12)


@pytest.mark.parametrize("direction", [X, Y, Z, normalised([1, -2, 3])])
def test_rotation_between_opposite_directions_is_a_half_turn(direction):
    rotation = rotation_between(direction, -direction)
    np.testing.assert_allclose(rotation @ direction, -direction, atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-12)


def test_a_camera_on_plus_z_looking_at_the_origin_has_the_worlds_axes():
    np.testing.assert_allclose(look_at([0, 0, 5], [0, 0, 0]), np.eye(3), atol=EXACT)


def test_a_camera_on_plus_x_has_minus_z_to_its_right():
    right, up, backward = look_at([5, 0, 0], [0, 0, 0]).T
    np.testing.assert_allclose((right, up, backward), (-Z, Y, X), atol=EXACT)


def test_a_camera_looking_down_a_slope_keeps_its_horizon_level():
    rotation = look_at([3, 4, 1], [0.5, 0, -2])
    assert rotation[1, 0] == pytest.approx(0, abs=1e-15)  # its right axis has no height
    assert rotation[1, 1] > 0
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(-rotation[:, 2], normalised(np.array([0.5, 0, -2]) - [3, 4, 1]), atol=1e-12)


def test_a_camera_looking_straight_down_is_refused_by_name():
    with pytest.raises(ValueError, match=r"\[0, 5, 0\] looking at \[0, 0, 0\] has no level horizon"):
        look_at([0, 5, 0], [0, 0, 0])


@pytest.mark.parametrize("shape", [(3,), (50, 3), (7, 50, 3)])
def test_lengths_are_those_of_numpy_to_the_bit(shape):
    random = np.random.default_rng(4)
    vectors = random.normal(size=shape) * np.exp(5 * random.normal(size=shape))
    assert np.array_equal(lengths(vectors), np.linalg.norm(vectors, axis=-1))


@pytest.mark.parametrize("components", [2, 4])
def test_only_vectors_of_three_have_lengths(components):
    with pytest.raises(ValueError):
        lengths(np.ones((5, components)))
