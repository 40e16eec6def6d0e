"""Cameras that move in the files of other programs, at a time: glTF, USD, and Blender by way of the script."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gltf_files import moving_gltf
from relume.scene.cameras.blender import FORMAT
from relume.scene.cameras.files import read_camera

LEVEL = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # looking along Blender's +Y, which is −Z here


def test_a_gltf_camera_is_where_its_animation_has_it(tmp_path):
    path = moving_gltf(tmp_path / "moving.gltf")
    np.testing.assert_allclose(read_camera(path, 300, 200).position, [0, 1, 0])
    half = read_camera(path, 300, 200, time=1.0)
    np.testing.assert_allclose(half.position, [1, 1, 0], atol=1e-12)
    # A quarter turn about +Y: it looks along −X.
    np.testing.assert_allclose(-half.rotation[:, 2], [-1, 0, 0], atol=1e-7)
    np.testing.assert_allclose(read_camera(path, 300, 200, time=9.0).position, [2, 1, 0])


def test_a_usd_camera_is_where_its_samples_have_it(tmp_path):
    pytest.importorskip("pxr")
    path = tmp_path / "moving.usda"
    path.write_text(
        """#usda 1.0
(
    metersPerUnit = 1
    startTimeCode = 10
    timeCodesPerSecond = 25
)
def Camera "A"
{
    float focalLength.timeSamples = { 10: 20, 60: 40 }
    float horizontalAperture = 36
    float verticalAperture = 24
    double3 xformOp:translate.timeSamples = { 10: (0, 0, 0), 60: (4, 0, 2) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    )
    half = read_camera(path, 360, 240, time=1.0)  # time code 35, half of the way
    np.testing.assert_allclose(half.position, [2, 0, 1], atol=1e-6)
    assert half.focal_length == pytest.approx(300)  # 30 mm of 36 over 360 pixels


def test_a_blender_camera_is_where_its_frames_have_it(tmp_path):
    def frame(x: float, lens: float, turn: float) -> dict:
        matrix = np.eye(4)
        cosine, sine = np.cos(turn), np.sin(turn)
        about_up = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        # A camera at rest in Blender looks down; ours shall look level.
        matrix[:3, :3], matrix[:3, 3] = about_up @ LEVEL.T, [x, 0, 1]
        return {"matrix_world": matrix.tolist(), "lens": lens, "shift": [0, 0], "f_number": None, "focus": None}

    first, last = frame(0, 30, 0), frame(2, 40, np.pi / 2)
    facts = first | {
        "format": FORMAT, "unit": 1.0, "sensor_width": 36.0, "sensor_height": 24.0, "sensor_fit": "AUTO",
        "resolution": [360, 240], "pixel_aspect": [1.0, 1.0], "frames": [first, last], "rate": 24.0,
    }  # fmt: skip
    (tmp_path / "camera.json").write_text(json.dumps(facts))
    rest, half = (read_camera(tmp_path / "camera.json", 360, 240, time=time) for time in (None, 0.5 / 24))
    np.testing.assert_allclose(rest.position, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(half.position, [1, 1, 0], atol=1e-12)
    assert half.focal_length == pytest.approx(350)
    # An eighth of a turn to the left about what points up.
    np.testing.assert_allclose(-half.rotation[:, 2], [-np.sqrt(0.5), 0, -np.sqrt(0.5)], atol=1e-12)
    np.testing.assert_allclose(read_camera(tmp_path / "camera.json", 360, 240, time=5).position, [2, 1, 0], atol=1e-12)
