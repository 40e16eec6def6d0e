"""Mosaics of reflectance functions: where a light stands in them, and which pixel each is of."""

import numpy as np
import pytest

from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.mosaic import function_lights, mosaic, reflectance_function, sampled_points
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from small_stages import grid_directions


def grid(rows: int = 6, columns: int = 12) -> StageLights:
    return StageLights.towards(grid_directions(rows, columns, 0.5), grid=(rows, columns))


def camera_at(*position: float) -> Camera:
    return Camera.looking_at(np.array(position), np.zeros(3), width=8, height=6, focal_length=8.0)


def answering(lights: StageLights) -> Pictures:
    """A field whose red, green and blue are a half plus half the light's x, y and z."""
    values = (0.5 + 0.5 * lights.directions)[:, None, None, :].repeat(6, 1).repeat(8, 2)
    return Pictures(values.astype(np.float32), lights)


@pytest.mark.parametrize("lights", [grid(), StageLights.towards(even_directions(800))])
@pytest.mark.parametrize(
    ("camera", "front", "right"),
    [
        (None, [0, 0, 1], [1, 0, 0]),
        (camera_at(0, 0, 3), [0, 0, 1], [1, 0, 0]),
        (camera_at(4, 0, 0), [1, 0, 0], [0, 0, -1]),
        (camera_at(0, 0, -2), [0, 0, -1], [-1, 0, 0]),
    ],
)
def test_the_middle_is_the_cameras_direction_right_is_right_and_up_is_up(lights, camera, front, right):
    towards = lights.directions[function_lights(lights, camera)]
    rows, columns = towards.shape[:2]
    middle = towards[rows // 2 - 1 : rows // 2 + 1, columns // 2 - 1 : columns // 2 + 1].mean((0, 1))
    assert middle / np.linalg.norm(middle) @ front > 0.98
    quarter = towards[rows // 2 - 1 : rows // 2 + 1, 3 * columns // 4 - 1 : 3 * columns // 4 + 1].mean((0, 1))
    assert quarter / np.linalg.norm(quarter) @ right > 0.98
    assert towards[0, :, 1].min() > 0.8 and towards[-1, :, 1].max() < -0.8
    edges = towards[rows // 2, [0, -1]].mean(0)
    assert edges / np.linalg.norm(edges) @ front < -0.9


def test_a_grids_lights_stand_each_once_where_they_are():
    order = function_lights(grid(), camera_at(0, 0, 3))
    assert np.unique(order).tolist() == list(range(72))
    # Azimuth 15° to the right of the camera is the grid's first column; it lies right of the middle.
    assert order[:, 6].tolist() == [0, 12, 24, 36, 48, 60] and order[0, 5] == 11 and order[0, 0] == 6


def test_a_grid_seen_from_straight_above_is_drawn_in_the_cameras_frame():
    down = Camera(8, 6, 8.0, np.array([0.0, 3, 0]), np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]))
    towards = grid().directions[function_lights(grid(), down)]
    assert towards[towards.shape[0] // 2, towards.shape[1] // 2, 1] > 0.9


def test_scattered_lights_are_drawn_as_their_cells():
    lights = StageLights.towards(even_directions(50))
    order = function_lights(lights, None, 64)
    assert order.shape == (64, 128)
    # The share of the sphere that a light takes is its solid angle.
    areas = np.sin(np.pi * (np.arange(64) + 0.5) / 64)[:, None].repeat(128, 1)
    shares = np.bincount(order.ravel(), areas.ravel(), minlength=50) / areas.sum() * 4 * np.pi
    np.testing.assert_allclose(shares, lights.solid_angles, rtol=0.08)


def test_each_function_is_that_of_its_pixel():
    random = np.random.default_rng(8)
    lights = grid()
    field = Pictures(random.uniform(0, 1, (72, 6, 8, 3)).astype(np.float32), lights)
    made = mosaic(field, 2, 3, gap=2)
    assert made.radiance.shape == (2 * 6 + 2, 3 * 12 + 2 * 2, 3) and made.function_shape == (6, 12)
    assert made.points.tolist() == [[[1, 1], [4, 1], [6, 1]], [[1, 4], [4, 4], [6, 4]]]
    for i in range(2):
        for j in range(3):
            column, row = made.points[i, j]
            expected = field.values[function_lights(lights), row, column]
            np.testing.assert_array_equal(made.function(i, j), expected)
            np.testing.assert_array_equal(reflectance_function(field, column, row), expected)
    assert made.corner(1, 2) == (8, 28)
    assert made.radiance[6:8].max() == 0 and made.radiance[:, 12:14].max() == 0


def test_a_field_that_answers_with_the_lights_direction_shows_the_directions():
    function = mosaic(answering(grid()), 1, 1).function(0, 0)
    assert function[3, 9, 0] > 0.9 and function[3, 2, 0] < 0.1  # red from the right
    assert function[0, 0, 1] > 0.95 and function[5, 0, 1] < 0.05  # green from above
    assert function[3, 6, 2] > 0.9 and function[3, 0, 2] < 0.1  # blue from the camera


def test_the_sampling_fills_the_masks_box():
    mask = np.zeros((60, 80), bool)
    mask[10:30, 40:80] = True
    points = sampled_points((60, 80), 2, 4, mask)
    assert points[0].tolist() == [[45, 15], [55, 15], [65, 15], [75, 15]] and points[1, 0].tolist() == [45, 25]


def test_wrong_calls_are_refused():
    field = answering(grid())
    with pytest.raises(ValueError, match="7×1 functions of 6×8 pixels"):
        mosaic(field, 7, 1)
    with pytest.raises(ValueError, match="with pixels of the subject"):
        mosaic(field, 1, 1, mask=np.zeros((6, 8), bool))
    with pytest.raises(ValueError, match="lies outside the pictures of 8×6"):
        reflectance_function(field, 8, 0)
