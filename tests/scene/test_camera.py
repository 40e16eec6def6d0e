"""The pinhole camera: rays and projection are inverses; residuals and deviations of a fitted one are closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.fit import CameraFit, least_squares
from relume.sphere.directions import rotation_about

STRAIGHT = Camera(8, 6, 10.0, np.zeros(3), np.eye(3))
ASKEW = Camera(7, 5, 9.0, np.array([1.0, 2.0, 3.0]), rotation_about([1, -2, 0.5], 2.1))


def pixel_centres(camera):
    y, x = np.indices((camera.height, camera.width)) + 0.5
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("distance", [0.01, 1.0, 1e4])
def test_a_point_on_a_pixels_ray_projects_to_that_pixels_centre(distance):
    points = ASKEW.position + distance * ASKEW.rays()
    # Rounding of the position against the distance.
    np.testing.assert_allclose(ASKEW.project(points), pixel_centres(ASKEW), atol=1e-11)


def test_rays_are_unit_vectors():
    np.testing.assert_allclose(np.linalg.norm(ASKEW.rays(), axis=-1), 1, rtol=1e-14)


def test_a_camera_looks_along_minus_z_with_plus_x_right_and_plus_y_up():
    assert STRAIGHT.project(np.array([0, 0, -5.0])).tolist() == [4, 3]  # the middle
    assert STRAIGHT.project(np.array([1.0, 0, -5.0])).tolist() == [6, 3]  # f X/Z = 10 / 5 to the right
    assert STRAIGHT.project(np.array([0, 1.0, -5.0])).tolist() == [4, 1]  # rows run down


def test_the_corner_ray_of_a_pinned_camera():
    camera = Camera(4, 2, 2.0, np.zeros(3), np.eye(3))
    # Upper left pixel centre: (−1.5, +0.5, −2) scaled to length 1; |·| = √6.5.
    np.testing.assert_allclose(camera.rays()[0, 0], np.array([-1.5, 0.5, -2]) / np.sqrt(6.5), rtol=1e-15)
    assert camera.rays().shape == (2, 4, 3)


def test_what_is_behind_the_camera_projects_nowhere():
    assert np.isnan(STRAIGHT.project(np.array([[0, 0, 5.0], [1, 1, 0.0]]))).all()


def test_looking_at_puts_the_target_in_the_middle_with_a_level_horizon():
    target = np.array([0.5, 0, 1])
    camera = Camera.looking_at(np.array([2, 3, 4]), target, width=30, height=20, focal_length=40)
    np.testing.assert_allclose(camera.project(target), [15, 10], atol=1e-12)
    higher = camera.project(np.array([0.5, 0.1, 1]))
    assert higher[0] == pytest.approx(15, abs=1e-12)
    assert higher[1] < 10


def test_the_principal_point_is_where_the_axis_meets_the_picture():
    camera = Camera(8, 6, 10.0, np.zeros(3), np.eye(3), centre=(3.0, 4.5))
    assert camera.project(np.array([0, 0, -5.0])).tolist() == [3, 4.5]
    assert camera.project(np.array([1.0, 1.0, -5.0])).tolist() == [5, 2.5]  # f X/Z = 2 to the right and up
    np.testing.assert_allclose(camera.rays_through(np.array([3.0, 4.5])), [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(camera.project(camera.rays()), pixel_centres(camera), atol=1e-12)
    assert camera.principal_point == (3.0, 4.5) and ASKEW.principal_point == (3.5, 2.5)


def test_a_resized_camera_sees_the_same_through_other_pixels():
    camera = Camera(8, 6, 10.0, np.zeros(3), np.eye(3), centre=(3.0, 4.5), distortion=Distortion(k1=-0.1), focus=2.0)
    points = np.array([[0.1, 0.2, -1.0], [-0.2, 0.1, -1.0]])
    np.testing.assert_allclose(camera.resized(24, 18).project(points), 3 * camera.project(points), rtol=1e-14)
    # Two rows more above and below.
    np.testing.assert_allclose(
        camera.resized(8, 10).project(points), camera.project(points) + np.array([0, 2]), rtol=1e-14
    )
    assert ASKEW.resized(14, 10).focal_length == 18 and ASKEW.resized(14, 10).centre is None
    assert camera.resized(24, 18).focus == 2.0


def test_a_pinhole_is_the_same_camera_without_distortion():
    camera = Camera(8, 6, 10.0, np.zeros(3), np.eye(3), (3.0, 4.5), Distortion(k1=-0.1), aperture=0.01, focus=2.0)
    assert camera.pinhole().distortion is None
    assert (camera.pinhole().centre, camera.pinhole().aperture, camera.pinhole().focus) == ((3.0, 4.5), 0.01, 2.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "0×6 pixels and focal length 10.0"),
        ({"height": -1}, "8×-1 pixels and focal length 10.0"),
        ({"focal_length": 0.0}, "8×6 pixels and focal length 0.0"),
        ({"focal_length": float("nan")}, "8×6 pixels and focal length nan"),
        ({"centre": (1.0, float("nan"))}, "principal point is"),
        ({"aperture": -0.1}, "aperture -0.1 and focus inf"),
        ({"focus": 0.0}, "aperture 0.0 and focus 0.0"),
    ],
)
def test_an_impossible_camera_is_refused_with_its_numbers(change, message):
    with pytest.raises(ValueError, match=message):
        replace(STRAIGHT, **change)


def test_residuals_are_the_root_mean_square_and_the_longest_offset():
    fit = CameraFit(STRAIGHT, np.zeros((3, 2)), np.array([[3.0, 4.0], [0.0, 1.0], [0.0, 0.0]]))
    assert fit.residual == pytest.approx(np.sqrt(26 / 3), rel=1e-15) and fit.worst == 5
    assert fit.agreement == "3 points, off by 2.94 pixels (RMS), 5.00 at worst"
    assert CameraFit(STRAIGHT).residual is None and CameraFit(STRAIGHT).worst is None


def test_a_straight_line_has_the_deviations_of_the_textbook():
    x = np.array([-2.0, -1, 0, 1, 2])
    y = 3 + 0.5 * x + np.array([0.1, -0.2, 0.2, -0.2, 0.1])
    found = least_squares(lambda v: v[0] + v[1] * x - y, np.zeros(2), 0.0)
    np.testing.assert_allclose(found.values, [3, 0.5], atol=1e-9)
    # s² = Σe²/(n − 2) = 0.14/3; over n for the offset, over Σx² = 10 for the slope.
    np.testing.assert_allclose(found.deviations, np.sqrt([0.14 / 3 / 5, 0.14 / 3 / 10]), rtol=1e-6)
    noisy = least_squares(lambda v: v[0] + v[1] * x - y, np.zeros(2), 1.0)
    np.testing.assert_allclose(noisy.deviations, [np.sqrt(1 / 5), np.sqrt(1 / 10)], rtol=1e-6)


def test_what_the_measurements_do_not_say_has_no_deviation_but_the_rest_has():
    found = least_squares(lambda v: np.array([v[0] - 1, 2 * v[0] - 2, v[0] - 1]), np.zeros(2), 1.0)
    assert found.deviations[0] == pytest.approx(1 / np.sqrt(6), rel=1e-6) and found.deviations[1] == np.inf
