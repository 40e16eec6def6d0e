"""A light's colour and intensity come from a matte target: literal Lambert, noise, shadows, lights it cannot see."""

from __future__ import annotations

import numpy as np
import pytest

from angles import degrees_between
from relume.lightstage.acquire.calibration import (
    Calibration,
    Target,
    calibrate,
    normal_of_flat_target,
    target_on_ball,
)
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

LIGHTS = StageLights.towards(even_directions(60))
CAMERA = Camera.looking_at(np.array([0, 0, 3.0]), np.zeros(3), width=40, height=32, focal_length=60.0)
TILTED = normalised([0.2, 0.3, 1.0])


def intensities(seed: int = 5) -> np.ndarray:
    """Irradiances (60, 3) of lamps that differ by half a stop and are warm or cool."""
    return np.random.default_rng(seed).uniform(0.7, 1.4, (60, 3))


def pictures(normals: np.ndarray, reflectance: float, irradiances: np.ndarray, noise: float = 0.0) -> np.ndarray:
    """(60, 32, 40, 3) of a matte surface; noise is a part of each value."""
    cosines = np.maximum(np.broadcast_to(normals, (32, 40, 3)) @ LIGHTS.directions.T, 0)
    values = reflectance / np.pi * np.moveaxis(cosines, -1, 0)[..., None] * irradiances[:, None, None]
    return (values * (1 + noise * np.random.default_rng(2).standard_normal(values.shape))).astype(np.float32)


def everywhere() -> np.ndarray:
    return np.ones((32, 40), bool)


def test_a_white_board_that_faces_a_light_and_reads_one_over_pi_is_irradiance_one() -> None:
    lights = StageLights.towards(np.array([[0, 0, 1.0]]))
    field = Pictures(np.full((1, 2, 2, 3), 1 / np.pi, np.float32), lights)
    found = calibrate(field, Target(np.ones((2, 2), bool), 1.0, np.array([0, 0, 1.0])))
    np.testing.assert_allclose(found.irradiances, 1.0, rtol=1e-6)


def test_a_grey_card_at_sixty_degrees_reads_half() -> None:
    lights = StageLights.towards(np.array([[np.sqrt(3), 0, 1]]))
    field = Pictures(np.full((1, 2, 2, 3), [0.18, 0.09, 0.36], np.float32), lights)
    found = calibrate(field, Target(np.ones((2, 2), bool), 0.18, np.array([0, 0, 1.0])))
    np.testing.assert_allclose(found.irradiances, [[2 * np.pi, np.pi, 4 * np.pi]], rtol=1e-6)
    np.testing.assert_allclose(found.gains * found.irradiances, 1.0)


def on_ball(noise: float) -> Calibration:
    target = target_on_ball(CAMERA, np.zeros(3), 0.7, 0.5)
    assert target.normals is not None
    with pytest.warns(UserWarning, match="lights do not reach the target"):
        return calibrate(Pictures(pictures(target.normals, 0.5, intensities(), noise), LIGHTS), target)


def test_a_matte_ball_says_irradiances_within_one_percent_at_one_percent_noise() -> None:
    found = on_ball(0.01)
    error = np.abs(found.irradiances / intensities() - 1)[found.measured]
    assert found.measured.sum() > 45
    assert error.max() < 0.01
    # One percent a channel, of the mean of three.
    assert np.median(found.deviations[found.measured]) == pytest.approx(0.01 / np.sqrt(3), rel=0.15)


def test_a_ball_in_the_dark_of_a_light_behind_it_takes_its_neighbours_irradiance() -> None:
    found = on_ball(0.0)
    behind = int(np.argmin(LIGHTS.directions[:, 2]))
    assert not found.measured[behind] and np.isnan(found.deviations[behind])
    assert (found.irradiances[behind] > 0.7).all() and (found.irradiances[behind] < 1.4).all()


def test_half_a_stop_of_shadow_and_highlight_on_a_part_of_the_target_counts_for_nothing() -> None:
    values = pictures(TILTED, 0.9, intensities())
    values[:, :6] *= 0.2
    values[:, -4:] += 5
    with pytest.warns(UserWarning, match="do not reach"):
        found = calibrate(Pictures(values, LIGHTS), Target(everywhere(), 0.9, TILTED))
    np.testing.assert_allclose(found.irradiances[found.measured], intensities()[found.measured], rtol=1e-4)


def test_a_light_that_something_shades_the_target_from_takes_its_neighbours_irradiance() -> None:
    values = pictures(TILTED, 0.9, np.ones((60, 3)))
    facing = int(np.argmax(LIGHTS.directions @ TILTED))
    values[facing] = np.random.default_rng(3).uniform(0, 0.01, (32, 40, 1))
    values[facing, :, :18] = 0.25
    with pytest.warns(UserWarning, match="or it is shaded"):
        found = calibrate(Pictures(values, LIGHTS), Target(everywhere(), 0.9, TILTED))
    assert not found.measured[facing]
    np.testing.assert_allclose(found.irradiances, 1, rtol=1e-5)


def test_grazing_lights_are_named_and_not_measured() -> None:
    grazing = LIGHTS.directions @ TILTED < np.cos(np.radians(80))
    first = LIGHTS.names[int(np.argmax(grazing))]
    with pytest.warns(UserWarning, match=f'{grazing.sum()} of 60 lights .* the first is "{first}"'):
        found = calibrate(Pictures(pictures(TILTED, 0.9, intensities()), LIGHTS), Target(everywhere(), 0.9, TILTED))
    assert np.array_equal(found.measured, ~grazing)


def test_the_normal_of_a_flat_target_is_found_where_some_lamps_are_dim() -> None:
    levels = np.ones((60, 3))
    levels[::5] = 0.6
    found = normal_of_flat_target(LIGHTS, pictures(TILTED, 0.9, levels, 0.01).mean(axis=(1, 2, 3)))
    assert degrees_between(found, TILTED) < 0.5


def test_a_target_without_a_normal_shows_the_dim_lamps() -> None:
    levels = np.ones((60, 3))
    levels[::5] = [0.5, 0.6, 0.7]
    with pytest.warns(UserWarning, match="do not reach"):
        found = calibrate(Pictures(pictures(TILTED, 0.9, levels, 0.01), LIGHTS), Target(everywhere(), 0.9))
    assert np.abs(found.irradiances / levels - 1)[found.measured].max() < 0.02


def test_a_ball_shows_its_pole_to_the_camera_in_its_middle() -> None:
    target = target_on_ball(CAMERA, np.array([0.0, 0.0, 0.0]), 0.7, 0.5)
    assert target.normals is not None
    middle = target.normals[15:17, 19:21].reshape(4, 3).mean(axis=0)
    np.testing.assert_allclose(middle / np.linalg.norm(middle), [0, 0, 1], atol=1e-6)
    assert target.normals[16, 25, 0] > 0.05 and target.normals[10, 20, 1] > 0.05


def test_a_ball_behind_the_camera_is_refused() -> None:
    with pytest.raises(ValueError, match="does not see a ball"):
        target_on_ball(CAMERA, np.array([0, 0, 9.0]), 0.7, 0.5)
    with pytest.raises(ValueError, match="the camera is within it"):
        target_on_ball(CAMERA, np.array([0, 0, 3.0]), 0.7, 0.5)


@pytest.mark.parametrize("reflectance", [0.0, -0.1, 1.2, (0.1, 0.2)])
def test_a_reflectance_that_cannot_be_is_refused(reflectance: float) -> None:
    with pytest.raises(ValueError, match="a reflectance of"):
        Target(everywhere(), reflectance)


@pytest.mark.parametrize(
    ("values", "seen", "said"),
    [
        (np.zeros((60, 32, 40, 3), np.float32), everywhere(), "no light reaches the target"),
        (np.ones((60, 32, 40, 3), np.float32), np.ones((9, 9), bool), r"expected the pictures' \(32, 40\)"),
    ],
)
def test_a_dark_target_and_one_of_another_size_are_refused(values: np.ndarray, seen: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        calibrate(Pictures(values, LIGHTS), Target(seen, 0.9, TILTED))
