"""Nuke's .chan cameras: columns, the order of rotations, what lies between lines, and lines that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.scene.cameras.files import motion_span, read_camera

LINES = """\
# a comment
10 0 1 2 0 0 0 90

12 2 1 2 0 90 0 90
"""


def written(folder: Path, text: str = LINES) -> Path:
    (folder / "a.chan").write_text(text)
    return folder / "a.chan"


def test_a_line_is_a_place_three_angles_and_the_vertical_field_of_view(tmp_path):
    path = written(tmp_path)
    camera = read_camera(path, 300, 200, frame=10)
    np.testing.assert_allclose(camera.position, [0, 1, 2])
    np.testing.assert_allclose(camera.rotation, np.eye(3), atol=1e-12)
    assert camera.focal_length == pytest.approx(100)  # half of 200 rows at 45°
    assert motion_span(path) == (10, 12)
    # A quarter turn about +Y, counter-clockwise from above: it looks along −X.
    np.testing.assert_allclose(-read_camera(path, 300, 200, frame=12).rotation[:, 2], [-1, 0, 0], atol=1e-12)


def test_between_lines_the_camera_goes_straight_and_turns_evenly_and_a_frame_beyond_the_ends(tmp_path):
    path = written(tmp_path)
    middle = read_camera(path, 300, 200, frame=11.5)
    np.testing.assert_allclose(middle.position, [1.5, 1, 2])
    angle = np.radians(67.5)
    np.testing.assert_allclose(-middle.rotation[:, 2], [-np.sin(angle), 0, -np.cos(angle)], atol=1e-12)
    after = read_camera(path, 300, 200, frame=12.5)
    np.testing.assert_allclose(after.position, [2.5, 1, 2])
    angle = np.radians(112.5)
    np.testing.assert_allclose(-after.rotation[:, 2], [-np.sin(angle), 0, -np.cos(angle)], atol=1e-12)


def test_the_camera_rolls_first_then_tilts_then_pans(tmp_path):
    camera = read_camera(written(tmp_path, "1 0 0 0 30 40 20 60\n"), 300, 200)
    x, y, z = np.radians([30, 40, 20])
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    np.testing.assert_allclose(camera.rotation, about_y @ about_x @ about_z, atol=1e-12)


def test_units_and_axes_are_told(tmp_path):
    path = written(tmp_path, "1 100 200 300 90 0 0 60\n")
    camera = read_camera(path, 30, 20, up="z", unit=0.01)
    np.testing.assert_allclose(camera.position, [1, 3, -2])
    np.testing.assert_allclose(-camera.rotation[:, 2], [0, 0, -1], atol=1e-12)  # level, along the file's +Y


def test_without_a_field_of_view_the_focal_length_is_given(tmp_path):
    path = written(tmp_path, "1 0 0 0 0 0 0\n")
    assert read_camera(path, 30, 20, focal_length=25.0).focal_length == 25
    with pytest.raises(UnreadableFile, match="has no field of view; give the focal length"):
        read_camera(path, 30, 20)
    with pytest.raises(UnreadableFile, match="in its last column; leave out the focal length"):
        read_camera(written(tmp_path), 30, 20, frame=10, focal_length=25.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 0 0 0 0 0\n", "line 1 has 6 columns; a line has 7 or 8"),
        ("1 0 0 0 0 0 0 60\n2 0 0 0 0 0 0\n", "line 2 has 7 columns"),
        ("1 0 0 0 0 0 0 0\n", "line 1 is no camera"),
        ("1 0 0 0 0 0 0 180\n", "line 1 is no camera"),
        ("1 nan 0 0 0 0 0 60\n", "line 1 is no camera"),
        ("frame x y z\n", "line 1 is no row of numbers"),
        ("2 0 0 0 0 0 0 60\n1 0 0 0 0 0 0 60\n", "line 2: frame 1 comes after 2; sort them"),
        ("# nothing\n", "holds no frames"),
    ],
)
def test_lines_that_are_no_cameras_are_named(tmp_path, text, words):
    with pytest.raises(UnreadableFile, match=words) as caught:
        read_camera(written(tmp_path, text), 30, 20, frame=1)
    assert "\n" not in str(caught.value)


def test_what_the_file_does_not_hold_is_refused(tmp_path):
    path = written(tmp_path)
    with pytest.raises(UnreadableFile, match="holds the frames 10 to 12; give the frame"):
        read_camera(path, 30, 20)
    with pytest.raises(UnreadableFile, match="holds the frames 10 to 12, and frame 14 was asked for"):
        read_camera(path, 30, 20, frame=14)
    with pytest.raises(UnreadableFile, match="go by frames; leave time out"):
        read_camera(path, 30, 20, time=1.0)
    with pytest.raises(UnreadableFile, match="not asked for a frame; leave it out"):
        read_camera(tmp_path / "a.glb", 30, 20, frame=1)
