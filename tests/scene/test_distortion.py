"""Lens distortion: OpenCV's model, an exact inverse, and no point invented beyond the fold."""

import cv2
import numpy as np
import pytest

from relume.scene.cameras.camera import Camera, reprojected, undistorted
from relume.scene.cameras.distortion import Distortion
from relume.sphere.directions import rotation_about

LENSES = [
    Distortion(k1=-0.1),
    Distortion(k1=0.2, k2=0.05),
    Distortion(-0.3, 0.1, 0.001, -0.002, 0.02),
    Distortion(-0.25, 0.08, 0.01, 0.005),
    Distortion(0.0, 0.0, 0.004, -0.003),
]
TURN = rotation_about([1, -2, 0.5], 2.1)


def seen_through(lens: Distortion) -> Camera:
    return Camera(76, 52, 80.0, np.array([1.0, 2.0, 3.0]), TURN, centre=(40.3, 24.2), distortion=lens)


def test_the_terms_have_the_signs_and_order_of_the_published_model():
    # By hand at (0.5, 0.25), y down: r² = 0.3125.
    point = np.array([0.5, 0.25])
    assert Distortion(k1=0.1).distorted(point) == pytest.approx(point * 1.03125, rel=1e-14)
    assert Distortion(k2=0.1).distorted(point) == pytest.approx(point * (1 + 0.1 * 0.3125**2), rel=1e-14)
    assert Distortion(k3=0.1).distorted(point) == pytest.approx(point * (1 + 0.1 * 0.3125**3), rel=1e-14)
    assert Distortion(p1=0.1).distorted(point) == pytest.approx([0.5 + 0.025, 0.25 + 0.1 * 0.4375], rel=1e-14)
    assert Distortion(p2=0.1).distorted(point) == pytest.approx([0.5 + 0.1 * 0.8125, 0.25 + 0.025], rel=1e-14)


@pytest.mark.parametrize("lens", LENSES)
def test_points_project_as_opencv_projects_them(lens):
    camera = seen_through(lens)
    local = np.random.default_rng(0).uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 1.2], (50, 3))  # x right, y down, z ahead
    matrix = np.array([[80, 0, 40.3], [0, 80, 24.2], [0, 0, 1.0]])
    terms = np.array([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3])
    expected, _ = cv2.projectPoints(local, np.zeros(3), np.zeros(3), matrix, terms)
    found = camera.project(camera.position + (local * [1, -1, -1]) @ TURN.T)
    np.testing.assert_allclose(found, expected[:, 0], atol=1e-11)


@pytest.mark.parametrize("lens", LENSES)
def test_a_ray_through_every_pixel_projects_back_to_it(lens):
    camera = seen_through(lens)
    y, x = np.indices((camera.height, camera.width)) + 0.5
    rays = camera.rays()
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, rtol=1e-14)
    np.testing.assert_allclose(camera.project(camera.position + 3 * rays), np.stack([x, y], -1), atol=1e-9)


def test_beyond_the_fold_there_is_nothing():
    lens = Distortion(k1=-0.1)
    fold = np.sqrt(1 / 0.3)  # 1 + 3·k1·r² = 0
    assert lens.reach == pytest.approx(fold, rel=1e-14)
    assert Distortion(k1=0.1, k2=0.2).reach == np.inf
    points = np.array([[fold - 1e-6, 0], [fold + 1e-6, 0], [0, 3.0]])
    assert np.isnan(lens.distorted(points)).all(-1).tolist() == [False, True, True]
    top = fold * 2 / 3  # where the model is farthest out: fold · (1 + k1·fold²)
    seen = lens.undistorted(np.array([[top - 1e-3, 0], [top + 1e-3, 0], [9.0, 9.0], [0, 0], [np.nan, 0]]))
    assert np.isnan(seen).all(-1).tolist() == [False, True, True, False, True]
    # By hand on the y axis: ∂y'/∂y = 1 + 6·p1·y is below 0 from y = −1/1.2 on, whatever the radius.
    tilted = Distortion(p1=0.2).distorted(np.array([[0, -0.8], [0, -0.9]]))
    assert np.isnan(tilted).all(-1).tolist() == [False, True] and tilted[0] == pytest.approx([0, -0.416])
    # Far out the model would bring this point back into the picture, mirrored.
    camera = Camera(20, 20, 20.0, np.zeros(3), np.eye(3), distortion=lens)
    assert np.isnan(camera.project(np.array([3.5, 0, -1.0]))).all()


def test_a_tangential_lens_has_no_inverse_beyond_its_fold_either():
    lens = Distortion(k1=-0.2, p1=0.02, p2=-0.03)
    grid = np.stack(np.meshgrid(np.linspace(-2, 2, 81), np.linspace(-2, 2, 81)), axis=-1)
    back = lens.undistorted(grid)
    found = np.asarray(np.isfinite(back).all(-1))
    assert 0.1 < found.mean() < 0.6 and not found[0, 0] and found[40, 40]
    np.testing.assert_allclose(lens.distorted(back[found]), grid[found], atol=1e-11)


def test_a_lens_that_folds_over_within_the_picture_is_refused():
    with pytest.raises(ValueError, match=r"k1=-0\.5.*folds over within a picture of 100×80 pixels and focal length 60"):
        Camera(100, 80, 60.0, np.zeros(3), np.eye(3), distortion=Distortion(k1=-0.5))
    with pytest.raises(ValueError, match="k2 is nan"):
        Distortion(k2=float("nan"))


@pytest.mark.parametrize("lens", LENSES[:4])
def test_a_straightened_picture_sees_all_and_comes_back(lens):
    camera = Camera(120, 80, 110.0, np.array([1.0, 2.0, 3.0]), TURN, (61.0, 38.5), lens)
    wide = undistorted(camera)
    seen = wide.project(camera.position + camera.rays())
    assert wide.distortion is None and wide.focal_length == camera.focal_length
    assert (seen > 0).all() and (seen < [wide.width, wide.height]).all()

    def smooth(directions):
        return np.stack([1 + np.sin(4 * directions[..., 0]), np.cos(3 * directions[..., 1])], -1).astype(np.float32)

    undone = reprojected(smooth(camera.rays()), camera, wide)
    reached = np.isfinite(undone).all(-1)
    # Bilinear interpolation of waves of 4 radians over pixels of 1/110: 4²/8 · 110⁻² ≈ 1.7e-4; half a pixel at the edge
    # where the outermost pixels are repeated: 4 · ½ · 110⁻¹.
    assert np.abs(undone - smooth(wide.rays()))[reached].max() < 0.02
    again = reprojected(np.nan_to_num(undone), wide, camera)[2:-2, 2:-2]
    assert np.abs(again - smooth(camera.rays())[2:-2, 2:-2]).max() < 1e-3


def test_what_the_picture_does_not_reach_is_nan_and_wrong_calls_are_reported():
    camera = Camera(8, 6, 10.0, np.zeros(3), np.eye(3))
    picture = np.ones((6, 8), np.float32)
    right = Camera(8, 6, 10.0, np.zeros(3), np.eye(3), centre=(0.0, 3.0))
    moved = reprojected(picture, camera, right)
    assert np.isfinite(moved[:, :4]).all() and np.isnan(moved[:, 4:]).all()
    with pytest.raises(ValueError, match="different places"):
        reprojected(picture, camera, Camera(8, 6, 10.0, np.ones(3), np.eye(3)))
    with pytest.raises(ValueError, match=r"\(6, 8\) from a camera of 9×6"):
        reprojected(picture, Camera(9, 6, 10.0, np.zeros(3), np.eye(3)), camera)
    assert undistorted(camera) is camera
