"""What share each light has in light from between the lights."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.cells import even_directions
from relume.lightstage.interpolation import Interpolation, NearestCell, Smooth
from relume.lightstage.lights import StageLights

LIGHTS = StageLights.towards(even_directions(60))
BETWEEN = even_directions(501)
AXES = StageLights.towards(np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]))


@pytest.mark.parametrize("by", [NearestCell(), Smooth(), Smooth(0.2)])
def test_shares_sum_to_one_in_every_direction(by: Interpolation) -> None:
    np.testing.assert_allclose(by.weights(LIGHTS, BETWEEN).sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("by", [NearestCell(), Smooth()])
def test_a_light_speaks_alone_in_its_own_direction(by: Interpolation) -> None:
    np.testing.assert_allclose(by.weights(LIGHTS, LIGHTS.directions), np.eye(60), atol=1e-6)


@pytest.mark.parametrize("by", [NearestCell(), Smooth()])
def test_gathering_light_is_the_sum_over_its_shares(by: Interpolation) -> None:
    power = np.random.default_rng(0).random((501, 3))
    np.testing.assert_allclose(by.gathered(LIGHTS, BETWEEN, power), by.weights(LIGHTS, BETWEEN).T @ power, atol=1e-9)


def test_midway_between_two_of_six_lights_both_have_the_same_share() -> None:
    midway = np.array([[1.0, 0, 1.0]]) / np.sqrt(2)
    shares = Smooth(0.5).weights(AXES, midway)[0]
    # Two lights at 45°, two at 90° and two at 135°, with k = (1 + a) exp(−a), a = √3 · angle / 0.5.
    np.testing.assert_allclose(shares[0], shares[4], atol=1e-12)
    np.testing.assert_allclose(shares, [0.32169, 0.07932, 0.099, 0.099, 0.32169, 0.07932], atol=2e-5)


def test_the_nearest_light_takes_all_of_a_direction() -> None:
    near_x = np.array([[0.9, 0.3, np.sqrt(1 - 0.9)]])
    assert NearestCell().weights(AXES, near_x).tolist() == [[1, 0, 0, 0, 0, 0]]


def test_smooth_is_nearer_to_a_cosine_than_the_nearest_cell() -> None:
    at_lights, between = np.maximum(LIGHTS.directions[:, 1], 0), np.maximum(BETWEEN[:, 1], 0)
    smooth, nearest = (
        np.abs(by.weights(LIGHTS, BETWEEN) @ at_lights - between).mean() for by in (Smooth(), NearestCell())
    )
    assert smooth < nearest / 3


def test_noise_lets_neighbours_speak_for_a_light() -> None:
    own = np.diag(Smooth(noise=0.1).weights(LIGHTS, LIGHTS.directions))
    assert own.max() < 0.6 and own.min() > 0.4


def test_below_a_dome_of_few_lights_shares_stay_bounded() -> None:
    directions = even_directions(40)
    dome = StageLights.towards(directions[directions[:, 1] > 0])
    assert np.abs(Smooth().weights(dome, BETWEEN)).max() < 2


@pytest.mark.parametrize("count", [1, 2, 3])
def test_very_few_lights_can_be_interpolated(count: int) -> None:
    shares = Smooth().weights(StageLights.towards(AXES.directions[::2][:count]), BETWEEN)
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-9)


def test_wrong_calls_are_refused() -> None:
    with pytest.raises(ValueError, match="length is 0; expected radians"):
        Smooth(0)
    with pytest.raises(ValueError, match="not a unit vector"):
        Smooth().weights(LIGHTS, 2 * BETWEEN)
    with pytest.raises(ValueError, match=r"directions are \(3,\)"):
        NearestCell().weights(LIGHTS, BETWEEN[0])
    with pytest.raises(ValueError, match="expected 501 rows"):
        Smooth().gathered(LIGHTS, BETWEEN, np.ones((500, 3)))
