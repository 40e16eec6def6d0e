"""Mattes over new backdrops and environments, and the light that relighting leaves to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.lightstage.matting.composite import (
    Backdrop,
    composite_matte,
    environment_on,
    illumination_without_backdrop,
    over_environment,
)
from relume.lightstage.matting.environment_matte import EnvironmentMatte
from relume.scene.cameras.camera import Camera
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

CAMERA = Camera.looking_at(np.array([0.0, 0.0, 4.0]), np.zeros(3), width=40, height=30, focal_length=60)
BACKDROP = Backdrop.facing(np.array([0.0, 0.0, -1.6]), np.array([0.0, 0.0, 4.0]), 4.0, 4.0)


def matte(rows: int = 5, columns: int = 7, seed: int = 3) -> EnvironmentMatte:
    """A matte of random areas within the backdrop."""
    dice = np.random.default_rng(seed)

    def some(*shape: int) -> np.ndarray:
        return dice.uniform(0.05, 0.95, shape).astype(np.float32)

    areas = some(2, rows, columns, 4)
    areas[..., 1::2] = np.minimum(areas[..., 1::2], 2 * np.minimum(areas[..., ::2], 1 - areas[..., ::2]))
    straight = areas[1].copy()
    straight[..., 1::2] = 0.02
    return EnvironmentMatte(
        some(rows, columns, 3),
        some(rows, columns),
        straight,
        areas,
        some(2, rows, columns, 3),
        some(rows, columns),
        (8, 8),
    )


def nothing_in_the_way() -> EnvironmentMatte:
    """What the camera sees of the backdrop without a subject."""
    height, width = CAMERA.height, CAMERA.width
    rays = CAMERA.rays()
    points = CAMERA.position + rays * ((BACKDROP.centre[2] - CAMERA.position[2]) / rays[..., 2])[..., None]
    straight = np.zeros((height, width, 4), np.float32)
    straight[..., 0], straight[..., 2] = 0.5 + points[..., 0] / 4, 0.5 - points[..., 1] / 4
    straight[..., 1::2] = 5.6 / 60 / 4
    none = np.zeros((height, width), np.float32)
    return EnvironmentMatte(
        np.zeros((height, width, 3), np.float32),
        none,
        straight,
        np.zeros((2, height, width, 4), np.float32),
        np.zeros((2, height, width, 3), np.float32),
        none,
        (8, 8),
    )


def counted(backdrop: np.ndarray, area: np.ndarray, fine: int = 200) -> np.ndarray:
    """The mean of a backdrop over a box, from many points: the slow twin of the summed-area table."""
    places = (np.arange(fine) + 0.5) / fine - 0.5
    rows = ((area[2] + area[3] * places) * backdrop.shape[0]).astype(int)
    columns = ((area[0] + area[1] * places) * backdrop.shape[1]).astype(int)
    return backdrop[np.ix_(rows, columns)].mean(axis=(0, 1))


def smooth_light(rows: int = 64) -> EnvironmentMap:
    x, y, z = np.moveaxis(pixel_directions(LatLong(), rows), -1, 0)
    radiance = np.stack([1 + 0.9 * x, 1 + 0.8 * y, 1 + 0.5 * z + 0.4 * np.sin(6 * x)], axis=-1)
    return EnvironmentMap(radiance.astype(np.float32))


def test_an_even_backdrop_is_multiplied_by_all_that_lets_it_through():
    glass = matte()
    picture = composite_matte(glass, np.broadcast_to([2.0, 0.5, 1.0], (9, 11, 3)))
    through = (1 - glass.coverage)[..., None] + glass.colours.sum(axis=0)
    assert np.allclose(picture, glass.foreground + through * [2.0, 0.5, 1.0], rtol=1e-6)


def test_areas_are_means_over_boxes_of_the_backdrop():
    glass = matte()
    backdrop = np.random.default_rng(0).random((12, 17, 3))
    picture = composite_matte(glass, backdrop)
    for row, column in np.ndindex(5, 7):
        expected = glass.foreground[row, column] + (1 - glass.coverage[row, column]) * counted(
            backdrop, glass.straight[row, column]
        )
        for which in range(2):
            expected = expected + glass.colours[which, row, column] * counted(backdrop, glass.areas[which, row, column])
        assert np.allclose(picture[row, column], expected, atol=0.015)


def test_left_is_left_and_up_is_up():
    glass = replace(matte(1, 2), foreground=np.zeros((1, 2, 3), np.float32), coverage=np.zeros((1, 2), np.float32))
    glass = replace(glass, colours=np.zeros((2, 1, 2, 3), np.float32))
    glass = replace(glass, straight=np.array([[[0.1, 0.1, 0.1, 0.1], [0.9, 0.1, 0.8, 0.1]]], np.float32))
    backdrop = np.zeros((10, 10, 3))
    backdrop[:2, :2], backdrop[7:9, 8:] = [1, 0, 0], [0, 1, 0]
    assert np.allclose(composite_matte(glass, backdrop), [[[1, 0, 0], [0, 1, 0]]])


def test_a_wide_area_does_not_alias():
    glass = matte()
    areas = glass.areas.copy()
    areas[...] = [0.5, 0.5, 0.5, 0.5]
    lines = np.zeros((64, 1024, 3))
    lines[:, ::2] = 1
    dark = replace(
        glass, areas=areas, coverage=np.ones_like(glass.coverage), foreground=np.zeros_like(glass.foreground)
    )
    assert np.allclose(composite_matte(dark, lines), 0.5 * glass.colours.sum(axis=0), rtol=1e-6)


def test_compositing_is_linear_and_another_foreground_takes_the_place_of_the_first():
    glass = matte()
    dice = np.random.default_rng(5)
    one, other = dice.random((2, 6, 6, 3))
    none = np.zeros_like(glass.foreground)
    summed = composite_matte(glass, one, none) + 2 * composite_matte(glass, other, none)
    assert np.allclose(composite_matte(glass, one + 2 * other, none), summed, rtol=1e-5)
    assert np.allclose(composite_matte(glass, one) - composite_matte(glass, one, none), glass.foreground, atol=1e-6)


def test_backdrops_that_are_no_pictures_are_refused():
    glass = matte()
    with pytest.raises(ValueError, match=r"expected \(rows, columns, 3\)"):
        composite_matte(glass, np.ones((4, 4)))
    with pytest.raises(ValueError, match="NaN"):
        composite_matte(glass, np.full((4, 4, 3), np.nan))
    with pytest.raises(ValueError, match="foreground is"):
        composite_matte(glass, np.ones((4, 4, 3)), np.ones((2, 2, 3)))
    with pytest.raises(ValueError, match="right angle"):
        Backdrop(np.zeros(3), np.array([1.0, 0, 0]), np.array([1.0, 0, 0]), 1, 1)
    with pytest.raises(ValueError, match="lies on the backdrop"):
        environment_on(BACKDROP, smooth_light(), BACKDROP.centre)


def test_a_facing_backdrop_has_its_right_where_the_camera_has_it():
    assert np.allclose(BACKDROP.right, [1, 0, 0]) and np.allclose(BACKDROP.up, [0, 1, 0])
    corners = BACKDROP.points(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]))
    assert np.allclose(corners, [[-2, 2, -1.6], [2, 2, -1.6], [0, -2, -1.6]])


def test_without_a_subject_the_camera_sees_the_environment_itself():
    light = smooth_light()
    picture = over_environment(nothing_in_the_way(), BACKDROP, CAMERA, light)
    assert np.allclose(picture, light.lookup(CAMERA.rays()), atol=0.01)


def test_refracted_light_comes_from_where_it_left_the_subject_for():
    light, empty = smooth_light(), nothing_in_the_way()
    areas, colours = empty.areas.copy(), empty.colours.copy()
    areas[0], colours[0] = [0.75, 0.01, 0.25, 0.01], [0.9, 0.8, 0.7]
    glass = replace(empty, areas=areas, colours=colours, coverage=np.ones_like(empty.coverage))
    towards = np.array([1.0, 1.0, -1.6]) / np.sqrt(4.56)
    expected = light.lookup(towards) * [0.9, 0.8, 0.7]
    assert np.allclose(over_environment(glass, BACKDROP, CAMERA, light), expected, atol=0.01)


def test_the_light_beside_and_behind_the_backdrop_is_all_the_light():
    light = smooth_light(96)
    beside = illumination_without_backdrop(light, BACKDROP)
    steradians = 4 * np.arcsin(4 / (4 + 1.6**2))
    hidden = light.total() - beside.total()
    # Behind the backdrop x and y average out: 1 each, but for z.
    assert hidden[:2] == pytest.approx([steradians, steradians], rel=5e-3)
    assert np.all(beside.radiance <= light.radiance) and np.any(beside.radiance == 0)
    assert np.allclose(beside.lookup(np.array([0.0, 0.0, 1.0])), light.lookup(np.array([0.0, 0.0, 1.0])))
