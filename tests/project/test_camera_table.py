"""The shot file's [camera]: each source gives its camera, and one clear line where it does not."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relume.errors import InvalidShot, UnreadableFile
from relume.image.files import read_photograph, write
from relume.image.photograph import Photograph
from relume.project.schema import checked, read_toml
from relume.project.shot_file.camera_table import CameraTable, camera_fit
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion

ROOM = Path(__file__).parents[2] / "examples" / "room"
SIZE = (1200, 800)
CAMERA = Camera.looking_at(
    np.array([1.0, 0.8, 1.4]), np.array([0.1, 0.1, 0.2]), width=1200, height=800, focal_length=1400
)


def table(folder: Path, text: str) -> CameraTable:
    path = folder / "shot.toml"
    path.write_text(text, encoding="utf-8")
    return checked(CameraTable, read_toml(path, "shot file", InvalidShot), path, "shot file", InvalidShot)


def drawn(axis: int) -> list[list[float]]:
    """Two lines along an axis as the file has them, to a hundredth of a pixel."""
    other = np.eye(3)[(axis + 1) % 3 if axis != 0 else 2] * 0.6
    starts = np.array([np.zeros(3), other])
    ends = starts + 0.6 * np.eye(3)[axis]
    return np.round(np.concatenate([CAMERA.project(starts), CAMERA.project(ends)], axis=-1), 2).tolist()


def pixel(*point: float) -> list[float]:
    return np.round(CAMERA.project(np.array(point, float)), 2).tolist()


LINES = f"x = {drawn(0)}, z = {drawn(2)}, origin = {pixel(0, 0, 0)}"


@pytest.mark.parametrize(
    "known",
    [
        f"length = {{ between = [{pixel(0, 0, 0)}, {pixel(0, 0, 0.3)}], metres = 0.3 }}",
        f"upright = {{ between = [{pixel(0.3, 0, 0)}, {pixel(0.3, 0.2, 0)}], metres = 0.2 }}",
        "camera_height = 0.8",
    ],
)
def test_lines_drawn_on_the_plate_give_the_camera_and_its_residual(tmp_path: Path, known: str) -> None:
    fit = camera_fit(table(tmp_path, f"lines = {{ {LINES}, {known} }}"), SIZE, tmp_path, None)
    # Ends rounded to a hundredth of a pixel, of lines of 300 pixels.
    assert np.linalg.norm(fit.camera.position - CAMERA.position) < 0.003
    assert fit.camera.focal_length == pytest.approx(1400, rel=0.003)
    assert fit.residual is not None and fit.residual < 0.01 and len(fit.points) == 8


def test_lines_that_say_no_focal_length_take_it_from_the_plate(tmp_path: Path) -> None:
    ahead = Camera(1200, 800, 1400.0, np.array([0.2, 0.5, 2.0]), np.eye(3))
    points = {name: ahead.project(np.array(p)) for name, p in (("o", (0, 0, 0)), ("x", (0.3, 0, 0)), ("z", (0, 0, 0.3)),
                                                               ("xz", (0.3, 0, 0.3)))}  # fmt: skip

    def line(first: str, second: str) -> list[float]:
        return [*points[first], *points[second]]

    text = f"x = {[line('o', 'x'), line('z', 'xz')]}, z = {[line('o', 'z'), line('x', 'xz')]}".replace("np.float64", "")
    lines = f"lines = {{ {text}, origin = {points['o'].tolist()}, camera_height = 0.5 }}".replace("(", "").replace(
        ")", ""
    )
    with pytest.warns(
        UserWarning, match=r"^camera\.lines do not determine the focal length; .*plate's EXIF .*: 1400 pixels"
    ):
        fit = camera_fit(table(tmp_path, lines), SIZE, tmp_path, 1400.0)
    assert np.linalg.norm(fit.camera.position - ahead.position) < 1e-6
    with pytest.raises(InvalidShot, match=r"^camera\.lines: .*give focal_length"):
        camera_fit(table(tmp_path, lines), SIZE, tmp_path, None)
    given = camera_fit(table(tmp_path, lines + "\nfocal_length = 1400.0"), SIZE, tmp_path, 900.0)
    assert given.camera.focal_length == 1400.0


def test_a_pose_and_a_lens_are_taken_as_given(tmp_path: Path) -> None:
    text = """
pose = { position = [1.0, 0.8, 1.4], look_at = [0.1, 0.1, 0.2] }
centre = [610.0, 390.0]
distortion = { k1 = -0.1, p2 = 0.001 }
"""
    fit = camera_fit(table(tmp_path, text), SIZE, tmp_path, 1400.0)
    camera = fit.camera
    assert np.array_equal(camera.rotation, CAMERA.rotation) and camera.focal_length == 1400.0
    assert (camera.centre, camera.distortion) == ((610.0, 390.0), Distortion(k1=-0.1, p2=0.001))
    assert fit.residual is None and fit.worst is None and fit.agreement == "given, not measured"


def test_a_file_may_be_its_name_or_a_table(tmp_path: Path) -> None:
    node = {"camera": 0, "name": "shot", "translation": [0, 0, 2.0]}
    header = {
        "nodes": [node, {"camera": 0, "name": "other"}], "scenes": [{"nodes": [0, 1]}],
        "cameras": [{"perspective": {"yfov": 2 * np.arctan(400 / 1400)}}],
    }  # fmt: skip
    (tmp_path / "cam.gltf").write_text(json.dumps(header))
    fit = camera_fit(
        table(tmp_path, 'file = { path = "cam.gltf", name = "shot", unit = 0.5 }\ndistortion = { k1 = 0.1 }'),
        SIZE, tmp_path, 900.0,
    )  # fmt: skip
    assert fit.camera.position.tolist() == [0, 0, 1] and fit.camera.focal_length == pytest.approx(1400)
    assert fit.camera.distortion == Distortion(k1=0.1) and fit.residual is None
    with pytest.raises(UnreadableFile, match="holds 'shot', 'other'"):
        camera_fit(table(tmp_path, 'file = "cam.gltf"'), SIZE, tmp_path, 900.0)


def test_the_grid_of_the_example_has_a_residual(tmp_path: Path) -> None:
    text = 'grid = { photograph = "plate_grid.jpg", squares = [9, 6], square = 0.03 }'
    fit = camera_fit(table(tmp_path, text), (768, 512), ROOM, None)
    assert fit.camera.position == pytest.approx([0.25, 0.55, 1.15], abs=0.003)
    assert fit.residual is not None and fit.residual < 0.15
    assert re.fullmatch(r"40 points, off by 0\.1\d pixels \(RMS\), 0\.\d\d at worst", fit.agreement)
    with pytest.raises(InvalidShot, match=r"plate_grid\.jpg is 768×512, the plate 1200×900"):
        camera_fit(table(tmp_path, text), (1200, 900), ROOM, None)


def test_the_thickness_of_the_board_is_a_key(tmp_path: Path) -> None:
    grid = 'grid = { photograph = "plate_grid.jpg", squares = [9, 6], square = 0.03, thickness = %s }'
    thin, thick = (camera_fit(table(tmp_path, grid % each), (768, 512), ROOM, None).camera for each in (0, 0.001))
    assert thick.position - thin.position == pytest.approx([0, 0.001, 0], abs=1e-6)
    # By tape measure, and 1 mm of card: nearer than without it.
    assert abs(thick.position[1] - 0.55) < 0.7e-3 < abs(thin.position[1] - 0.55)


def test_a_grid_saved_at_another_size_gives_the_same_camera(tmp_path: Path) -> None:
    own = read_photograph(ROOM / "plate_grid.jpg")
    twice = np.repeat(np.repeat(own.pixels, 2, axis=0), 2, axis=1)
    write(tmp_path / "grid.png", Photograph(twice))
    text = 'grid = { photograph = "grid.png", squares = [9, 6], square = 0.03 }'
    found = camera_fit(table(tmp_path, text), (768, 512), tmp_path, own.focal_length)
    straight = camera_fit(table(tmp_path, text.replace("grid.png", "plate_grid.jpg")), (768, 512), ROOM, None)
    assert (found.camera.width, found.camera.height) == (768, 512)
    assert found.camera.focal_length == pytest.approx(straight.camera.focal_length)
    # Corners of doubled pixels are found a little otherwise.
    assert np.linalg.norm(found.camera.position - straight.camera.position) < 0.003
    assert np.abs(found.points - straight.points).max() < 0.3


def test_a_grid_at_another_zoom_than_the_plate_is_reported(tmp_path: Path) -> None:
    text = 'grid = { photograph = "plate_grid.jpg", squares = [9, 6], square = 0.03 }'
    with pytest.warns(UserWarning, match=r"plate_grid\.jpg: its EXIF has a focal length of 1000 pixels .* own 1500"):
        camera_fit(table(tmp_path, text), (768, 512), ROOM, 1500.0)


def test_lines_that_fit_badly_warn(tmp_path: Path) -> None:
    x = np.array(drawn(0))
    bent = np.concatenate([x, [[*(x[0, :2] + [0, 40]), *(x[0, 2:] + [0, 90])]]])
    lines = f"x = {bent.tolist()}, z = {drawn(2)}, origin = {pixel(0, 0, 0)}, camera_height = 0.8"
    with pytest.warns(
        UserWarning, match=r"camera\.lines fits badly: 10 points, off by .*check which axis each is along"
    ):
        camera_fit(table(tmp_path, f"lines = {{ {lines} }}\nfocal_length = 1400.0"), SIZE, tmp_path, None)


POSE = "pose = { position = [1.0, 0.8, 1.4], look_at = [0.1, 0.1, 0.2] }\n"
GRID = 'grid = { photograph = "g.jpg", squares = [9, 6], square = 0.03, %s }\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (POSE + 'file = "a.glb"', "give one of grid, pose, lines, ball and file"),
        (POSE + "ball = {}", "give one of grid, pose, lines, ball and file"),
        ("ball = { pitch = 20, camera_height = 0.4 }", "both pitch and camera_height"),
        ("ball = { raised = 0.1, foot = [3, 4] }", "both raised and foot"),
        ("ball = { pitch = 90 }", "degrees that the camera looks down"),
        ('file = "a.glb"\nfocal_length = 3.0', "file holds the focal length and the centre; leave focal_length and"),
        ("gird = 3", "gird: unknown key; did you mean grid?"),
        (f"lines = {{ {LINES} }}", "lines: give one of length, upright and camera_height"),
        ("lines = { x = [[1, 2, 3]], origin = [1, 2], camera_height = 1.0 }", "lines.x.0"),
        (f"lines = {{ {LINES}, camera_heigth = 1 }}", "lines.camera_heigth: unknown key; did you mean camera_height?"),
        (f"lines = {{ {LINES}, camera_height = 1, estimate_centre = true }}\ncentre = [1, 2]", "both centre and lines"),
        (POSE + "distortion = { k4 = 0.1 }", "distortion.k4: unknown key"),
        (GRID % "estimate_k1 = true" + "distortion = { k1 = 0.1 }", "both distortion and grid.estimate_k1"),
        (
            GRID % "estimate_focal_length = true" + "focal_length = 9.0",
            "both focal_length and grid.estimate_focal_length",
        ),
        ('file = { path = "a.glb", up = "x" }', "file.up"),
        (GRID.replace("[9, 6]", "[6, 9]") % "estimate_k1 = true", "the long side comes first"),
        (GRID.replace("0.03", "3") % "thickness = 0", "grid: square is 3 m, so the board 27 m; lengths are metres"),
        (
            GRID % "thickness = 1",
            "grid: thickness is 1 m, and the board 0.27 m long; lengths are metres: 1 mm is 0.001",
        ),
        (GRID % "thickness = -0.001", "grid.thickness"),
    ],
)
def test_a_table_that_contradicts_itself_is_reported_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InvalidShot) as caught:
        table(tmp_path, text)
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "focal_length", "message"),
    [
        (POSE, None, r"^camera\.focal_length: missing, and the plate's EXIF has none"),
        ("pose = { position = [0, 1, 0], look_at = [0, 0, 0] }", 900.0, r"^camera\.pose: .* no level horizon"),
        (POSE + "distortion = { k1 = -3.0 }", 900.0, r"^camera\.distortion: .* folds over within a picture"),
        (f"lines = {{ x = {drawn(0)}, origin = [1, 2], camera_height = 1 }}", None, r"^camera\.lines: lines along one"),
        (
            f"lines = {{ x = {drawn(0)}, origin = [1, 2], camera_height = 1 }}",
            900.0,
            r"^camera\.lines: .*along x alone",
        ),
    ],
)
def test_a_camera_that_cannot_be_had_names_its_key(
    tmp_path: Path, text: str, focal_length: float | None, message: str
) -> None:
    with pytest.raises(InvalidShot, match=message) as caught:
        camera_fit(table(tmp_path, text), SIZE, tmp_path, focal_length)
    assert "\n" not in str(caught.value)


def test_every_key_of_a_distortion_is_the_lens_own(tmp_path: Path) -> None:
    values: dict[str, Any] = {"k1": -0.05, "k2": 0.01, "p1": 0.001, "p2": -0.002, "k3": 0.003}
    text = ", ".join(f"{key} = {value}" for key, value in values.items())
    found = camera_fit(table(tmp_path, POSE + f"distortion = {{ {text} }}"), SIZE, tmp_path, 1400.0).camera.distortion
    assert found == Distortion(**values)
