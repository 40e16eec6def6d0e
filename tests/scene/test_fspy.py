"""fSpy's projects and parameters: files written here from the format's description give their camera back."""

import json
import struct

import numpy as np
import pytest

from relume.errors import FormatError, UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.files import read_camera
from relume.scene.cameras.fspy import read_fspy

CAMERA = Camera.looking_at(
    np.array([1.0, 0.8, 1.4]), np.array([0.1, 0.2, 0.1]), width=1200, height=800, focal_length=900
)
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Blender's frame from ours."""


def parameters(camera=CAMERA, world=Z_UP, principal=(0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = world @ camera.rotation, world @ camera.position
    return {
        "principalPoint": {"x": principal[0], "y": principal[1]},
        "cameraTransform": {"rows": matrix.tolist()},
        "horizontalFieldOfView": 2 * np.arctan(camera.width / 2 / camera.focal_length),
        "imageWidth": camera.width,
        "imageHeight": camera.height,
    }


def project(state, image=b"\x89PNG", version=1, magic=b"fspy"):
    text = json.dumps(state).encode()
    return magic + struct.pack("<III", version, len(text), len(image)) + text + image


def saved(said=None, unit="Meters", axis="xPositive"):
    settings = {"referenceDistanceUnit": unit, "referenceDistance": 1, "referenceDistanceAxis": axis}
    return project({"cameraParameters": said or parameters(), "calibrationSettingsBase": settings})


def written(folder, data, name="shot.fspy"):
    path = folder / name
    path.write_bytes(data)
    return path


def test_a_project_gives_back_its_camera(tmp_path):
    camera = read_camera(written(tmp_path, saved()), 1200, 800)
    np.testing.assert_allclose(camera.position, CAMERA.position, rtol=1e-14)
    np.testing.assert_allclose(camera.rotation, CAMERA.rotation, atol=1e-14)
    assert camera.focal_length == pytest.approx(900, rel=1e-14) and camera.centre is None


@pytest.mark.parametrize(("unit", "metres"), [("Centimeters", 0.01), ("Feet", 0.3048), ("Inches", 0.0254)])
def test_the_reference_distance_gives_the_unit(tmp_path, unit, metres):
    camera = read_fspy(written(tmp_path, saved(unit=unit)), 1200, 800)
    np.testing.assert_allclose(camera.position, CAMERA.position * metres, rtol=1e-14)


@pytest.mark.parametrize("settings", [{"unit": "No unit"}, {"axis": None}])
def test_a_project_without_a_reference_distance_warns(tmp_path, settings):
    path = written(tmp_path, saved(**settings))
    with pytest.warns(UserWarning, match="its units are taken as metres"):
        read_fspy(path, 1200, 800)
    assert read_fspy(path, 1200, 800, unit=0.5).position[0] == pytest.approx(0.5)


def test_exported_parameters_are_read_and_scaled_to_the_picture(tmp_path):
    path = written(tmp_path, json.dumps(parameters()).encode(), "camera.json")
    camera = read_camera(path, 600, 400, unit=1.0)
    assert camera.focal_length == pytest.approx(450, rel=1e-14)
    np.testing.assert_allclose(camera.position, CAMERA.position, rtol=1e-14)


@pytest.mark.parametrize(
    ("size", "centre"),
    # The image plane reaches from −1 to 1 along the longer side, y up: 0.1 and 0.2 of half of it right and up.
    [((1200, 800), (660.0, 280.0)), ((800, 1200), (460.0, 480.0))],
)
def test_the_principal_point_is_in_the_units_of_the_longer_side(tmp_path, size, centre):
    camera = Camera(size[0], size[1], 900, CAMERA.position, CAMERA.rotation)
    path = written(tmp_path, saved(parameters(camera, principal=(0.1, 0.2))))
    read = read_fspy(path, *size)
    assert read.centre == pytest.approx(centre, rel=1e-14) and read.focal_length == pytest.approx(900, rel=1e-14)


def test_the_vanishing_points_fspy_reports_are_those_of_the_camera_it_reports(tmp_path):
    # Numbers as fSpy 1 exported them for a photograph of 1439×956, Y up: −X and +Z vanish at these places.
    turn = [
        [-0.8432786760114587, -0.000536391102293568, 0.5374763128445262, 2.4963346727504696],
        [0.0008594611278942138, 0.9999968777735309, 0.0023464376744316688, 0.9409039973967737],
        [-0.5374758933300462, 0.002440640853491923, -0.8432755820971537, -3.292501097791757],
        [0.0, 0.0, 0.0, 1.0],
    ]
    said = parameters() | {
        "cameraTransform": {"rows": turn}, "horizontalFieldOfView": 1.5479845321227295,
        "imageWidth": 1439, "imageHeight": 956,
    }  # fmt: skip
    camera = read_fspy(written(tmp_path, saved(said)), 1439, 956, up="y")
    seen = np.array([[1.6051650133994935, 0.001021010320067342], [-0.652074716204382, 0.0029610261811691915]])
    rays = camera.rays_through([719.5, 478] + seen * [719.5, -719.5])
    np.testing.assert_allclose(rays, [[-1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert camera.position.tolist() == [turn[0][3], turn[1][3], turn[2][3]]
    with pytest.warns(UserWarning, match='its Y axis is more upright .* give up = "y"'):
        read_fspy(written(tmp_path, saved(said)), 1439, 956)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not an fSpy project"),
        (b"PK\x03\x04" * 8, "not an fSpy project"),
        (project({}, version=2), "version 2; only 1 is read"),
        (saved()[:200], r"expected \d+ bytes, found 184"),
        (b"fspy" + struct.pack("<III", 1, 4, 0) + b"{{{{", "not valid JSON"),
        (project([1]), "no camera of fSpy's"),
        (project({"cameraParameters": None}), "has not solved this project"),
        (saved(parameters() | {"imageHeight": 1200}), "made for a picture of 1200×1200, not 1200×800"),
        (saved(parameters() | {"horizontalFieldOfView": 4.0}), "a field of view of 4.0 radians"),
        (saved(parameters() | {"horizontalFieldOfView": "wide"}), "no camera of fSpy's"),
        (saved(parameters() | {"cameraTransform": {"rows": [[1, 0], [0, 1]]}}), "not 4 × 4 finite numbers"),
        (saved(parameters() | {"cameraTransform": {"rows": np.diag([1, 1, -1, 1]).tolist()}}), "mirrored, sheared"),
        (saved(parameters() | {"principalPoint": {}}), "no camera of fSpy's"),
    ],
)
def test_a_project_that_cannot_be_used_says_so_in_one_line(tmp_path, data, message):
    path = written(tmp_path, data)
    with pytest.raises(UnreadableFile, match=message) as caught:
        read_fspy(path, 1200, 800)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_a_truncated_project_is_a_broken_format(tmp_path):
    with pytest.raises(FormatError):
        read_fspy(written(tmp_path, saved()[:300]), 1200, 800)
    with pytest.raises(UnreadableFile, match="cannot be read"):
        read_fspy(tmp_path / "none.fspy", 1200, 800)
