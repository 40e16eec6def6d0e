"""What a reflectance field in memory is."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.field import Noise, Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera

LIGHTS = StageLights.towards(np.eye(3))


def test_codes_of_eight_bits_are_values_by_the_scale_of_their_picture():
    codes = np.full((3, 2, 4, 3), 200, np.uint8)
    field = Pictures(codes, LIGHTS, scale=np.array([0.01, 0.02, 0.5], np.float32))
    np.testing.assert_allclose(whole(field)[:, 1, 2, 0], [2.0, 4.0, 100.0], rtol=1e-6)
    assert whole(field).dtype == np.float32


def test_a_block_is_the_lights_and_rows_asked_for():
    values = np.arange(3 * 4 * 5 * 3, dtype=np.float32).reshape(3, 4, 5, 3)
    np.testing.assert_array_equal(Pictures(values, LIGHTS).block(slice(1, 3), slice(2, 4)), values[1:3, 2:4])


@pytest.mark.parametrize("shape", [(2, 4, 5, 3), (3, 4, 5), (3, 4, 5, 4), (3, 0, 5, 3)])
def test_values_that_are_not_a_picture_a_light_are_refused(shape):
    with pytest.raises(ValueError, match="expected \\(3 lights, rows, columns, 3\\)"):
        Pictures(np.zeros(shape, np.float32), LIGHTS)


def test_a_camera_of_another_size_is_refused():
    camera = Camera.looking_at(np.array([0, 0, 1.0]), np.zeros(3), width=9, height=4, focal_length=9.0)
    with pytest.raises(ValueError, match="the camera takes pictures of 9×4, but they are 5×4"):
        Pictures(np.zeros((3, 4, 5, 3), np.float32), LIGHTS, camera)


def test_noise_below_nothing_is_refused():
    with pytest.raises(ValueError, match="not below 0"):
        Noise(-1.0)
