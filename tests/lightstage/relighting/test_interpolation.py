"""What share each light has in light from between the lights."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import (
    Barycentric,
    Interpolation,
    NearestLight,
    Smooth,
    reached,
    unreached_share,
)
from relume.lightstage.relighting.voronoi_cells import even_directions
from small_stages import chosen, grid_directions

LIGHTS = StageLights.towards(even_directions(60))
BETWEEN = even_directions(501)
HALF = StageLights.towards(even_directions(120)[even_directions(120)[:, 2] > 0])
AXES = StageLights.towards(np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]))


@pytest.mark.parametrize("by", [NearestLight(), Barycentric(), Smooth(), Smooth(0.2)])
def test_shares_sum_to_one_in_every_direction(by: Interpolation) -> None:
    np.testing.assert_allclose(by.weights(LIGHTS, BETWEEN).sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize("by", [NearestLight(), Barycentric(), Smooth()])
def test_a_light_speaks_alone_in_its_own_direction(by: Interpolation) -> None:
    np.testing.assert_allclose(by.weights(LIGHTS, LIGHTS.directions), np.eye(60), atol=1e-6)


@pytest.mark.parametrize("by", [NearestLight(), Barycentric(), Smooth()])
def test_gathering_light_is_the_sum_over_its_shares(by: Interpolation) -> None:
    power = np.random.default_rng(0).random((501, 3))
    np.testing.assert_allclose(by.gathered(LIGHTS, BETWEEN, power), by.weights(LIGHTS, BETWEEN).T @ power, atol=1e-9)


def test_midway_between_two_of_six_lights_both_have_the_same_share() -> None:
    midway = np.array([[1.0, 0, 1.0]]) / np.sqrt(2)
    shares = Smooth(0.5).weights(AXES, midway)[0]
    # Two lights at 45°, two at 90° and two at 135°, with k = (1 + a) exp(−a), a = √3 · chord / 0.5.
    np.testing.assert_allclose(shares[0], shares[4], atol=1e-12)
    np.testing.assert_allclose(shares, [0.32327, 0.07601, 0.10072, 0.10072, 0.32327, 0.07601], atol=2e-5)


def test_the_nearest_light_takes_all_of_a_direction() -> None:
    near_x = np.array([[0.9, 0.3, np.sqrt(1 - 0.9)]])
    assert NearestLight().weights(AXES, near_x).tolist() == [[1, 0, 0, 0, 0, 0]]


def test_three_lights_around_a_direction_share_it_by_where_it_crosses_their_triangle() -> None:
    towards = np.array([[0.5, 0.3, 0.2]]) / np.linalg.norm([0.5, 0.3, 0.2])
    np.testing.assert_allclose(Barycentric().weights(AXES, towards), [[0.5, 0, 0.3, 0, 0.2, 0]], atol=1e-12)


@pytest.mark.parametrize("lights", [LIGHTS, HALF, AXES, chosen(LIGHTS, np.array([3, 8]))])
def test_no_barycentric_share_is_below_zero(lights: StageLights) -> None:
    shares = Barycentric().weights(lights, BETWEEN)
    assert shares.min() >= 0
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-12)


def test_barycentric_shares_are_found_on_a_grid_and_change_without_a_jump() -> None:
    path = np.linspace(0.0, np.pi, 4001)
    towards = np.stack([np.sin(path) * 0.8, np.cos(path), np.sin(path) * 0.6], axis=1)
    shares = Barycentric().weights(StageLights.towards(grid_directions(6, 12)), towards)
    # Lights of the first ring are 0.13 radians apart, over which a share falls from 1 to 0; a step is 8e-4.
    assert np.abs(np.diff(shares, axis=0)).max() < 0.01


@pytest.mark.parametrize("by", [Barycentric(), Smooth()])
def test_light_from_where_the_stage_has_none_goes_to_the_nearest(by: Interpolation) -> None:
    behind = BETWEEN[BETWEEN[:, 2] < -0.7]
    np.testing.assert_allclose(by.weights(HALF, behind), NearestLight().weights(HALF, behind), atol=1e-12)
    power = np.random.default_rng(1).random((501, 3))
    np.testing.assert_allclose(by.gathered(HALF, BETWEEN, power), by.weights(HALF, BETWEEN).T @ power, atol=1e-9)


def test_within_half_a_stage_only_lights_near_a_direction_share_it() -> None:
    within = BETWEEN[BETWEEN[:, 2] > 0]
    sharing = Barycentric().weights(HALF, within) > 1e-9
    away = np.arccos(np.clip(within @ HALF.directions.T, -1, 1))
    # Neighbours are 0.3 radians apart; the floor of the dome's hull joins lights across all of it.
    assert away[sharing].max() < 0.7


def test_between_the_lights_and_beyond_them_shares_change_without_a_jump() -> None:
    path = np.linspace(0.0, np.pi, 4001)
    towards = np.stack([np.sin(path), np.zeros(4001), np.cos(path)], axis=1)
    shares = Smooth().weights(HALF, towards)
    ends = 700, 3000  # beyond these the nearest light alone speaks, and may change at once
    assert np.abs(np.diff(shares[: ends[0]], axis=0)).max() < 0.02
    said = reached(HALF, towards)
    assert said[: ends[0]].min() == 1 and said[ends[1] :].max() == 0
    assert np.abs(np.diff(said)).max() < 4e-3


def test_a_full_stage_reaches_all_directions() -> None:
    assert reached(LIGHTS, even_directions(20000)).min() == 1


def test_the_share_of_light_from_beyond_the_lights_is_reported() -> None:
    two = np.array([[0.0, 0, 1], [0, 0, -1]])
    np.testing.assert_allclose(unreached_share(HALF, two, np.array([[3.0, 3, 3], [1, 1, 1]])), 0.25, atol=1e-12)
    assert unreached_share(LIGHTS, two, np.ones((2, 3))) == 0
    assert unreached_share(HALF, two, np.zeros((2, 3))) == 0


def test_smooth_is_nearer_to_a_cosine_than_the_nearest_cell() -> None:
    at_lights, between = np.maximum(LIGHTS.directions[:, 1], 0), np.maximum(BETWEEN[:, 1], 0)
    smooth, nearest = (
        np.abs(by.weights(LIGHTS, BETWEEN) @ at_lights - between).mean() for by in (Smooth(), NearestLight())
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
        NearestLight().weights(LIGHTS, BETWEEN[0])
    with pytest.raises(ValueError, match="expected 501 rows"):
        Smooth().gathered(LIGHTS, BETWEEN, np.ones((500, 3)))
