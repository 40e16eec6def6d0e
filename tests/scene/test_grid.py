"""The camera's pose from a photographed board: photographs computed through a known camera give it back."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from angles import degrees_turned
from relume.errors import GridNotFound
from relume.image.files import read_photograph
from relume.image.photograph import Photograph
from relume.scene.cameras import grid
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.grid import camera_from_grid, fit_corners, fit_grid

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
    fine = camera.resized(camera.width * cells, camera.height * cells)
    grey = np.full((camera.height, camera.width), 0.85)
    # The board, edge by edge of its squares, lies within these pixels: rays elsewhere would meet the even table.
    edges = np.meshgrid(*(SQUARE * (np.arange(n + 1) - n / 2) for n in SQUARES))
    seen = camera.project(np.stack([edges[0], np.zeros_like(edges[0]), edges[1]], -1).reshape(-1, 3))
    low, high = np.maximum(seen.min(0) - 3, 0).astype(int), (seen.max(0) + 4).astype(int)
    part = np.s_[low[1] : high[1], low[0] : high[0]]
    rows, columns = grey[part].shape
    x, y = low[0] * cells + np.arange(columns * cells) + 0.5, low[1] * cells + np.arange(rows * cells) + 0.5
    rays = fine.rays_through(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)).reshape(rows * cells, columns * cells, 3)
    points = fine.position - (fine.position[1] / rays[..., 1])[..., None] * rays
    x, z = points[..., 0] / SQUARE, points[..., 2] / SQUARE
    board = (np.abs(x) < SQUARES[0] / 2) & (np.abs(z) < SQUARES[1] / 2) & (rays[..., 1] < 0)
    dark = board & ((np.floor(x + SQUARES[0] / 2) + np.floor(z)) % 2 == 0)
    grey[part] = np.where(dark, 0.05, 0.85).reshape(rows, cells, columns, cells).mean((1, 3))
    return Photograph(np.repeat(np.round(255 * grey).astype(np.uint8)[..., None], 3, axis=2), **details)


def found_in(photograph):
    return camera_from_grid(photograph, squares=SQUARES, square=SQUARE, focal_length=720)


def reprojection_error(found, true, turn=(1.0, 1.0, 1.0)):
    return np.linalg.norm(found.project(CORNERS * turn) - true.project(CORNERS), axis=-1).max()


@pytest.mark.parametrize(
    ("azimuth", "elevation"),
    [(0, 35), (-30, 25), (30, 40), (85, 25), (-89, 60)],
)
def test_a_photographed_board_gives_back_the_camera(azimuth, elevation):
    true = camera_at(azimuth, elevation)
    found = found_in(photograph_of_the_board(true))
    # Corners are found to a few hundredths of a pixel where squares are 10 pixels and more.
    assert reprojection_error(found, true) < 0.1
    assert np.linalg.norm(found.position - true.position) < 0.002  # metres: 0.1 px of 720 at 80 cm, ten times over
    assert (found.width, found.height, found.focal_length) == (true.width, true.height, true.focal_length)


@pytest.mark.parametrize(("azimuth", "elevation"), [(180, 40), (150, 30), (-120, 60), (100, 30)])
def test_plus_x_runs_to_the_right_as_the_photograph_shows_it(azimuth, elevation):
    # Seen from behind, the frame is turned by half a turn about up.
    true = camera_at(azimuth, elevation)
    found = found_in(photograph_of_the_board(true))
    assert reprojection_error(found, true, HALF_TURN) < 0.1
    right, origin = found.project(np.array([[0.1, 0, 0], [0, 0, 0]]))
    assert right[0] > origin[0]


@pytest.mark.parametrize("azimuth", [90, 270, 89.9, -90.1])
@pytest.mark.parametrize("elevation", [25, 60])
def test_a_camera_beside_the_board_is_above_the_table(azimuth, elevation):
    # Where the long side runs straight away from the camera either reading is right, but no mirrored one.
    true = camera_at(azimuth, elevation, target=(0, 0, 0))
    found = found_in(photograph_of_the_board(true))
    assert found.position[1] > 0
    assert min(reprojection_error(found, true), reprojection_error(found, true, HALF_TURN)) < 0.1


def test_16_bit_photographs_are_read_as_well():
    true = camera_at(20, 40)
    eight = photograph_of_the_board(true)
    sixteen = Photograph(eight.pixels.astype(np.uint16) * 257)
    found = found_in(sixteen)
    assert reprojection_error(found, true) < 0.1


def test_the_focal_length_comes_from_the_photograph_unless_given():
    true = camera_at(0, 40)
    photograph = photograph_of_the_board(true, focal_length=true.focal_length)
    assert camera_from_grid(photograph, squares=SQUARES, square=SQUARE).focal_length == true.focal_length


def test_a_photograph_that_says_no_focal_length_asks_for_it():
    photograph = photograph_of_the_board(camera_at(0, 40), name="grid.jpg")
    with pytest.raises(GridNotFound, match=r"grid\.jpg: no focal length in its EXIF; give camera\.focal_length"):
        camera_from_grid(photograph, squares=SQUARES, square=SQUARE)


def test_a_photograph_without_a_board_says_what_was_sought():
    noise = np.random.default_rng(0).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    with pytest.raises(GridNotFound, match=r"table\.jpg: no grid of 9×6 squares found") as caught:
        camera_from_grid(Photograph(noise, name="table.jpg", focal_length=100.0), squares=SQUARES, square=SQUARE)
    assert "\n" not in str(caught.value)


def test_a_board_of_other_squares_is_not_taken_for_the_one_described():
    photograph = photograph_of_the_board(camera_at(0, 40).resized(160, 120), focal_length=240.0)
    assert camera_from_grid(photograph, squares=SQUARES, square=SQUARE).width == 160
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
    assert degrees_turned(found.rotation, ours_from_theirs @ pose) < 0.15  # 3 mm at 1.2 m


def board_seen_by(camera, noise=0.0, seed=0, columns=8, rows=5, square=SQUARE):
    """The board's inner corners (rows, columns, 2) as the camera has them, with noise of a standard deviation."""
    x, z = (np.arange(columns) - (columns - 1) / 2) * square, (np.arange(rows) - (rows - 1) / 2) * square
    corners = camera.project(np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), -1))
    return corners + np.random.default_rng(seed).normal(0, noise, corners.shape)


def angle_between(first, second):
    return np.radians(degrees_turned(first.rotation, second.rotation))


BARREL = Distortion(-0.25, 0.08, 0.002, -0.001, 0.01)


@pytest.mark.parametrize(("centre", "distortion"), [(None, None), ((230.0, 190.0), None), ((230.0, 190.0), BARREL)])
def test_exact_corners_give_back_the_camera_through_any_known_lens(centre, distortion):
    true = replace(camera_at(20, 35), centre=centre, distortion=distortion)
    fit = fit_corners(
        board_seen_by(true), (480, 360), square=SQUARE, focal_length=720.0, centre=centre, distortion=distortion
    )
    assert np.linalg.norm(fit.camera.position - true.position) < 1e-8 and angle_between(fit.camera, true) < 1e-7
    assert fit.residual is not None and fit.residual < 1e-6 and len(fit.points) == 40
    assert (fit.camera.centre, fit.camera.distortion) == (centre, distortion)


def test_a_board_that_lies_above_the_table_raises_the_camera_by_its_thickness():
    true = camera_at(20, 35)
    corners = board_seen_by(true)
    thin = fit_corners(corners, (480, 360), square=SQUARE, focal_length=720.0)
    thick = fit_corners(corners, (480, 360), square=SQUARE, thickness=0.004, focal_length=720.0)
    assert thick.camera.position - thin.camera.position == pytest.approx([0, 0.004, 0], abs=1e-8)
    assert angle_between(thick.camera, thin.camera) < 1e-7
    # What stands on the table under the board's middle is seen lower than the middle of the print.
    on_print, on_table = thin.camera.project(np.zeros(3)), thick.camera.project(np.zeros(3))
    assert on_table[1] - on_print[1] == pytest.approx(0.004 * np.cos(np.radians(35)) * 720 / 0.8, rel=0.05)


def test_the_residual_is_that_of_the_noise():
    true = camera_at(20, 35)
    noise, fits = 0.3, []
    for seed in range(20):
        fits.append(fit_corners(board_seen_by(true, noise, seed), (480, 360), square=SQUARE, focal_length=720.0))
    # 80 coordinates less 6 unknowns; the mean of 20 such roots deviates by 0.3·√(74/80)·√2/√(2·74·20) ≈ 2 %.
    expected = noise * np.sqrt(2 * 74 / 80)
    assert np.mean([fit.residual for fit in fits]) == pytest.approx(expected, rel=0.08)
    assert all(fit.worst > fit.residual for fit in fits)
    np.testing.assert_allclose(fits[0].camera.project(CORNERS.reshape(8, 5, 3).transpose(1, 0, 2).reshape(-1, 3)),
                               fits[0].points + fits[0].offsets, atol=1e-9)  # fmt: skip


def test_a_photographed_board_behind_a_distorting_lens_gives_back_the_camera():
    true = replace(camera_at(20, 40), distortion=Distortion(k1=-0.4))
    photograph = photograph_of_the_board(true)
    fit = fit_grid(photograph, squares=SQUARES, square=SQUARE, focal_length=720.0, distortion=true.distortion)
    corners = fit.points.reshape(5, 8, 2)
    assert np.linalg.norm(fit.camera.position - true.position) < 0.002
    assert fit.residual is not None and fit.worst is not None and fit.residual < 0.05 and fit.worst < 0.15
    blind = fit_corners(corners, (480, 360), square=SQUARE, focal_length=720.0)
    assert blind.residual is not None and blind.residual > 2 * fit.residual


def test_a_slanted_board_gives_the_focal_length_with_its_uncertainty():
    true = replace(camera_at(35, 30, target=(0, 0, 0)), position=camera_at(35, 30, target=(0, 0, 0)).position * 0.6)
    found = []
    for seed in range(10):
        with pytest.warns(UserWarning, match=r"from one flat board is \d+\.\d ± \d+\.\d pixels") as caught:
            fit = fit_corners(board_seen_by(true, 0.1, seed), (480, 360), square=SQUARE, focal_length=None)
        said = float(str(caught[0].message).split("± ")[1].split(" pixels")[0])
        found.append((fit.camera.focal_length - 720) / said)
        assert np.linalg.norm(fit.camera.position - true.position) < 0.03
    # Ten draws of a unit normal: their root mean square leaves [0.4, 1.8] once in a thousand.
    assert 0.4 < np.sqrt(np.mean(np.square(found))) < 1.8


def test_exact_corners_give_back_focal_length_and_k1():
    true = replace(camera_at(35, 30, target=(0, 0, 0)), distortion=Distortion(k1=-0.3))
    with pytest.warns(UserWarning) as caught:
        fit = fit_corners(
            board_seen_by(true, square=0.045), (480, 360), square=0.045, focal_length=None, estimate_k1=True
        )
    assert fit.camera.focal_length == pytest.approx(720, rel=1e-6)
    assert fit.camera.distortion is not None and fit.camera.distortion.k1 == pytest.approx(-0.3, abs=1e-6)
    assert [("k1" in str(w.message), "focal length" in str(w.message)) for w in caught] == [
        (True, False),
        (False, True),
    ]


def test_a_k1_that_noise_could_have_made_is_left_out():
    true = camera_at(20, 35)
    with pytest.warns(UserWarning, match="k1 .* it is left out"):
        fit = fit_corners(board_seen_by(true, 0.1), (480, 360), square=SQUARE, focal_length=720.0, estimate_k1=True)
    plain = fit_corners(board_seen_by(true, 0.1), (480, 360), square=SQUARE, focal_length=720.0)
    assert fit.camera.distortion is None and np.array_equal(fit.camera.position, plain.camera.position)


def test_a_board_seen_from_straight_above_does_not_give_the_focal_length():
    above = Camera(480, 360, 720.0, np.array([0, 0.8, 0]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
    with pytest.raises(GridNotFound, match=r"top\.jpg: .*does not determine the focal length .*give camera"):
        fit_corners(board_seen_by(above, 0.1), (480, 360), square=SQUARE, focal_length=None, name="top.jpg")


def test_what_contradicts_itself_is_refused():
    with pytest.raises(ValueError, match="both a focal_length and estimate_focal_length"):
        fit_grid(
            photograph_of_the_board(camera_at(0, 40), 1),
            squares=SQUARES, square=SQUARE, focal_length=720.0, estimate_focal_length=True,
        )  # fmt: skip
    corners, lens = board_seen_by(camera_at(0, 40)), Distortion(k1=-0.1)
    with pytest.raises(ValueError, match="both a distortion and estimate_k1"):
        fit_corners(corners, (480, 360), square=SQUARE, focal_length=720.0, distortion=lens, estimate_k1=True)
    with pytest.raises(ValueError, match="a distortion without focal_length"):
        fit_corners(corners, (480, 360), square=SQUARE, focal_length=None, distortion=lens)


@pytest.mark.skipif(not ROOM.is_dir(), reason=f"the room shoot is not in {ROOM}")
def test_the_room_shoot_says_its_focal_length_and_its_residual():
    truth = json.loads((ROOM / "truth" / "shoot.json").read_text())["plate_camera"]
    photograph = read_photograph(ROOM / "plate_grid.jpg")
    with pytest.warns(UserWarning, match="focal length from one flat board"):
        fit = fit_grid(photograph, squares=SQUARES, square=SQUARE, estimate_focal_length=True)
    focal_length = truth["width"] / 2 / np.tan(np.radians(truth["hfov_deg"]) / 2)
    assert fit.camera.focal_length == pytest.approx(focal_length, rel=0.02)  # three of its deviations, 0.7 % each
    assert fit.residual is not None and fit.residual < 0.15  # corners of 28 pixels in a noisy JPEG


def test_a_large_photograph_is_searched_in_a_small_one_and_measured_in_itself(monkeypatch):
    photograph = photograph_of_the_board(camera_at(15, 40))
    at_once = found_in(photograph)
    sought: list[int] = []
    resize = cv2.resize
    monkeypatch.setattr(grid, "ENOUGH", 200)
    monkeypatch.setattr(cv2, "resize", lambda *given, **settings: sought.append(1) or resize(*given, **settings))
    found = found_in(photograph)
    assert len(sought) == 1
    assert reprojection_error(found, at_once) < 0.01
