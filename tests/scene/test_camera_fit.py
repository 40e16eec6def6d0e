"""Residuals of a fitted camera, and the deviations of what was fitted, against closed forms."""

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit, least_squares

CAMERA = Camera(8, 6, 10.0, np.zeros(3), np.eye(3))


def test_residuals_are_the_root_mean_square_and_the_longest_offset():
    fit = CameraFit(CAMERA, np.zeros((3, 2)), np.array([[3.0, 4.0], [0.0, 1.0], [0.0, 0.0]]))
    assert fit.residual == pytest.approx(np.sqrt(26 / 3), rel=1e-15) and fit.worst == 5
    assert fit.agreement == "3 points, off by 2.94 pixels (RMS), 5.00 at worst"
    assert CameraFit(CAMERA).residual is None and CameraFit(CAMERA).worst is None


def test_a_straight_line_has_the_deviations_of_the_textbook():
    x = np.array([-2.0, -1, 0, 1, 2])
    y = 3 + 0.5 * x + np.array([0.1, -0.2, 0.2, -0.2, 0.1])
    found = least_squares(lambda v: v[0] + v[1] * x - y, np.zeros(2), 0.0)
    np.testing.assert_allclose(found.values, [3, 0.5], atol=1e-9)
    # s² = Σe²/(n − 2) = 0.14/3; over n for the offset, over Σx² = 10 for the slope.
    np.testing.assert_allclose(found.deviations, np.sqrt([0.14 / 3 / 5, 0.14 / 3 / 10]), rtol=1e-6)
    noisy = least_squares(lambda v: v[0] + v[1] * x - y, np.zeros(2), 1.0)
    np.testing.assert_allclose(noisy.deviations, [np.sqrt(1 / 5), np.sqrt(1 / 10)], rtol=1e-6)


def test_what_the_measurements_do_not_tell_has_no_deviation_but_the_rest_has():
    found = least_squares(lambda v: np.array([v[0] - 1, 2 * v[0] - 2, v[0] - 1]), np.zeros(2), 1.0)
    assert found.deviations[0] == pytest.approx(1 / np.sqrt(6), rel=1e-6) and found.deviations[1] == np.inf
