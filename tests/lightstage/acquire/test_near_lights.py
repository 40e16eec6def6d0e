"""Where near lights stand, from balls whose rays were made by hand."""

import numpy as np
import pytest

from relume.lightstage.acquire.ball_highlights import BallReadings
from relume.lightstage.acquire.near_lights import light_places
from relume.sphere.directions import normalised

LIGHTS = np.array([[0.5, 1.0, 0.8], [-0.7, 0.3, 0.9]])
BALLS = [np.array([-0.2, 0.0, 0.0]), np.array([0.25, 0.05, 0.0]), np.array([0.0, -0.2, 0.1])]


def readings(places: np.ndarray, lights: np.ndarray) -> BallReadings:
    on_ball = np.repeat(places[None], len(lights), axis=0)
    return BallReadings(on_ball, normalised(lights - on_ball))


def test_rays_that_meet_tell_the_place() -> None:
    positions, distances = light_places([readings(ball, LIGHTS) for ball in BALLS], ["a", "b"])
    np.testing.assert_allclose(positions, LIGHTS, atol=1e-12)
    np.testing.assert_allclose(distances, 0, atol=1e-12)


def test_the_residual_is_the_distance_to_rays_that_pass_each_other() -> None:
    first = BallReadings(np.array([[0.0, -1, 0.01]]), np.array([[0.0, 1, 0]]))
    second = BallReadings(np.array([[-1.0, 0, -0.01]]), np.array([[1.0, 0, 0]]))
    positions, distances = light_places([first, second], ["a"])
    np.testing.assert_allclose(positions, [[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(distances, [0.01])


def test_parallel_rays_are_told_by_name() -> None:
    far = np.array([[0.0, 0.0, 1000.0], [0.5, 1.0, 0.8]])
    with pytest.warns(UserWarning, match="b.png: the balls' rays are parallel within half a degree"):
        light_places([readings(ball, far) for ball in BALLS], ["b.png", "c.png"])


def test_rays_that_run_apart_are_refused() -> None:
    swapped = [BallReadings(ball[None], normalised(-(LIGHTS[:1] - ball[None]))) for ball in BALLS]
    with pytest.raises(ValueError, match="a: the balls' rays run apart"):
        light_places(swapped, ["a"])
    with pytest.raises(ValueError, match="two balls or more"):
        light_places(swapped[:1], ["a"])
