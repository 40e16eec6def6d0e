"""The camera's pose from a photographed board: photographs computed through a known camera give it back."""

import json
from pathlib import Path

import numpy as np
import pytest

from relume.errors import GridNotFound
from relume.image.files import read_photograph
from relume.image.photograph import Photograph
from relume.scene.camera import Camera
from relume.scene.grid import camera_from_grid

ROOM = Path(__file__).resolve().parents[3] / "shared" / "shoots" / "room"
SQUARE, SQUARES = 0.03, (9, 6)
HALF_TURN = np.array([-1.0, 1.0, -1.0])
CORNERS = np.stack(
    np.meshgrid((np.arange(8) - 3.5) * SQUARE, [0.0], (np.arange(5) - 2.0) * SQUARE, indexing="ij"), -1
).reshape(-1, 3)


def camera_at(azimuth, elevation, target=(0.01, 0, -0.02)):
    """A camera 80 cm from the origin; azimuth 0 stands on +Z, 90° on +X."""
    around, up = np.radians(azimuth), np.radians(elevation)
    position = 0.8 * np.array([np.sin(around) * np.cos(up), np.sin(up), np.cos(around) * np.cos(up)])
    return Camera.looking_at(position, np.array(target), width=480, height=360, focal_length=720)


def photograph_of_the_board(camera, cells=4, **details):
    """Every pixel is the mean of cells × cells rays: black and white squares on a light table."""
    fine = Camera(
        camera.width * cells, camera.height * cells, camera.focal_length * cells, camera.position, camera.rotation
    )
    rays = fine.rays()
    points = fine.position - (fine.position[1] / rays[..., 1])[..., None] * rays
    x, z = points[..., 0] / SQUARE, points[..., 2] / SQUARE
    board = (np.abs(x) < SQUARES[0] / 2) & (np.abs(z) < SQUARES[1] / 2) & (rays[..., 1] < 0)
    dark = board & ((np.floor(x + SQUARES[0] / 2) + np.floor(z)) % 2 == 0)
    grey = np.where(dark, 0.05, 0.85).reshape(camera.height, cells, camera.width, cells).mean((1, 3))
    return Photograph(np.repeat(np.round(255 * grey).astype(np.uint8)[..., None], 3, axis=2), **details)


def reprojection_error(found, true, turn=(1.0, 1.0, 1.0)):
    return np.linalg.norm(found.project(CORNERS * turn) - true.project(CORNERS), axis=-1).max()


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [(0, 35), (12, 26), (-30, 25), (30, 40), (60, 25), (-75, 60), (85, 25), (-89, 60)],
)
def test_a_photographed_board_gives_back_the_camera(azimuth, elevation):
    true = camera_at(azimuth, elevation)
    found = camera_from_grid(
        photograph_of_the_board(true), squares=SQUARES, square=SQUARE, focal_length=true.focal_length
    )
    # Corners are found to a few hundredths of a pixel where squares are 10 pixels and more.
    assert reprojection_error(found, true) < 0.1
    assert np.linalg.norm(found.position - true.position) < 0.002  # metres: 0.1 px of 720 at 80 cm, ten times over
    assert (found.width, found.height, found.focal_length) == (true.width, true.height, true.focal_length)


@pytest.mark.parametrize(("azimuth", "elevation"), [(180, 40), (150, 30), (-120, 60), (100, 30)])
def test_plus_x_runs_to_the_right_as_the_photograph_shows_it(azimuth, elevation):
    # Seen from behind, the frame is turned by half a turn about up.
    true = camera_at(azimuth, elevation)
    found = camera_from_grid(
        photograph_of_the_board(true), squares=SQUARES, square=SQUARE, focal_length=true.focal_length
    )
    assert reprojection_error(found, true, HALF_TURN) < 0.1
    right, origin = found.project(np.array([[0.1, 0, 0], [0, 0, 0]]))
    assert right[0] > origin[0]


@pytest.mark.parametrize("azimuth", [90, 270, 89.9, -90.1])
@pytest.mark.parametrize("elevation", [25, 60])
def test_a_camera_beside_the_board_is_above_the_table(azimuth, elevation):
    # Where the long side runs straight away from the camera either reading is right, but no mirrored one.
    true = camera_at(azimuth, elevation, target=(0, 0, 0))
    found = camera_from_grid(
        photograph_of_the_board(true), squares=SQUARES, square=SQUARE, focal_length=true.focal_length
    )
    assert found.position[1] > 0
    assert min(reprojection_error(found, true), reprojection_error(found, true, HALF_TURN)) < 0.1


def test_16_bit_photographs_are_read_as_well():
    true = camera_at(20, 40)
    eight = photograph_of_the_board(true)
    sixteen = Photograph(eight.pixels.astype(np.uint16) * 257)
    found = camera_from_grid(sixteen, squares=SQUARES, square=SQUARE, focal_length=true.focal_length)
    assert reprojection_error(found, true) < 0.1


def test_the_focal_length_comes_from_the_photograph_unless_given():
    true = camera_at(0, 40)
    photograph = photograph_of_the_board(true, focal_length=true.focal_length)
    assert camera_from_grid(photograph, squares=SQUARES, square=SQUARE).focal_length == true.focal_length


def test_a_photograph_that_tells_no_focal_length_asks_for_it():
    photograph = photograph_of_the_board(camera_at(0, 40), name="grid.jpg")
    with pytest.raises(GridNotFound, match=r"grid\.jpg: no focal length in its EXIF; give camera\.focal_length"):
        camera_from_grid(photograph, squares=SQUARES, square=SQUARE)


def test_a_photograph_without_a_board_says_what_was_sought():
    noise = np.random.default_rng(0).integers(0, 256, (60, 80, 3)).astype(np.uint8)
    with pytest.raises(GridNotFound, match=r"table\.jpg: no grid of 9×6 squares found") as caught:
        camera_from_grid(Photograph(noise, name="table.jpg", focal_length=100.0), squares=SQUARES, square=SQUARE)
    assert "\n" not in str(caught.value)


def test_a_board_of_other_squares_is_not_taken_for_the_one_described():
    photograph = photograph_of_the_board(camera_at(0, 40), focal_length=720.0)
    with pytest.raises(GridNotFound, match="no grid of 12×6 squares"):
        camera_from_grid(photograph, squares=(12, 6), square=SQUARE)


@pytest.mark.skipif(not ROOM.is_dir(), reason=f"the room shoot is not in {ROOM}")
def test_the_camera_of_the_room_shoot_is_found_within_three_millimetres():
    truth = json.loads((ROOM / "truth" / "shoot.json").read_text())["plate_camera"]
    x, y, z = truth["position"]  # its frame has +Z up
    found = camera_from_grid(read_photograph(ROOM / "plate_grid.jpg"), squares=SQUARES, square=SQUARE)
    # The printed board lies about 1 mm above the table, whose frame the truth is in; the rest is JPEG and noise.
    assert np.linalg.norm(found.position - [x, z, -y]) < 0.003
    pose = np.array(truth["matrix_world"])[:3, :3]
    ours_from_theirs = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    turned = found.rotation.T @ (ours_from_theirs @ pose)
    assert np.degrees(np.arccos((np.trace(turned) - 1) / 2)) < 0.15  # 3 mm at 1.2 m
