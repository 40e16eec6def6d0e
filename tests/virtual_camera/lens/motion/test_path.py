"""Motion blur of a camera that turns or shakes: the mean of the pictures it sees on its way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from naive_motion import averaged, through
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong
from relume.sphere.mappings.perspective import perspective_view
from relume.virtual_camera.lens.motion.path import HomographyPath, TurningCamera
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.view import View


def blobs(height: int = 120, width: int = 143) -> np.ndarray:
    """Soft lights on black (H, W, 3), none within 55 pixels of the border."""
    y, x = np.mgrid[:height, :width]
    shapes = [np.exp(-((x - a) ** 2 + (y - b) ** 2) / 20) for a, b in ((60, 58), (78, 63), (70, 60))]
    return np.stack(shapes, axis=-1).astype(np.float32)


def shift(dx: float, dy: float) -> np.ndarray:
    return np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1.0]])


def rough(height: int = 50, width: int = 70) -> np.ndarray:
    return np.random.default_rng(2).random((height, width, 3), np.float32)


@pytest.mark.parametrize(
    "turn", [(0.1, 0.0, 0.0), (0.0, -0.12, 0.0), (0.0, 0.0, 0.5), (0.15, 0.1, -0.2), (0.9, 0.0, 0.1)]
)
@pytest.mark.parametrize("opening", [0.0, 0.25])
def test_a_turn_is_the_mean_of_what_the_camera_sees(turn: tuple[float, float, float], opening: float):
    picture, focal_length, shutter = rough(), 60.0, Shutter(opening)
    yaw, pitch, roll = turn
    height, width = picture.shape[:2]

    def place_at(x, y, time):
        # The ray of a pixel, turned with the camera, and where the picture has it.
        ray = np.stack([x - width / 2, height / 2 - y, np.full_like(x, -focal_length)], axis=-1)
        rotation = Rotation.from_rotvec(time * np.array([pitch, yaw, roll])).as_matrix()
        u, v, w = np.moveaxis(ray @ rotation.T, -1, 0)
        return width / 2 + focal_length * u / -w, height / 2 - focal_length * v / -w

    expected, known = averaged(picture, place_at, shutter.light, samples=200)
    camera = TurningCamera(*turn, shutter)
    seen, share = camera.apply(picture, View(focal_length)), camera.coverage((height, width), View(focal_length))
    np.testing.assert_allclose(share, known, atol=0.015)
    sure = known > 0.1
    assert np.abs(seen - expected)[sure].max() < 0.02
    assert np.abs(seen - expected)[sure].mean() < 0.002


def test_a_path_of_shifts_is_a_straight_motion():
    picture, view = rough(), View(60.0)
    for motion in ((9.0, 4.0), (24.0, 0.0), (1.5, -2.5)):
        path = HomographyPath.along(lambda t, m=motion: shift(m[0] * t, m[1] * t), 2)
        straight = StraightMotion(*motion)
        assert np.abs(path.apply(picture, view) - straight.apply(picture, view)).max() < 0.012
        np.testing.assert_allclose(path.coverage((50, 70), view), straight.coverage((50, 70), view), atol=0.003)


def test_key_times_share_the_exposure_and_the_matrices_lead_to_the_picture():
    # A quarter of the time here, then at once 10 pixels on: the sensor at x then sees x + 10.
    picture = np.zeros((3, 60, 3), np.float32)
    picture[:, 30] = 1
    times = np.array([-0.5, -0.25, -0.25 + 1e-9, 0.5])
    path = HomographyPath(np.stack([shift(0, 0), shift(0, 0), shift(10, 0), shift(10, 0)]), times)
    seen = path.apply(picture, View(50.0))
    assert seen[1, 30, 0] == pytest.approx(0.25, abs=1e-5)
    assert seen[1, 20, 0] == pytest.approx(0.75, abs=1e-5)
    # A homography is one at any scale, and of either sign.
    again = HomographyPath(-3 * path.matrices, times).apply(picture, View(50.0))
    np.testing.assert_allclose(again, seen, atol=1e-6)


def test_a_shaking_hand_follows_its_keys():
    picture = rough()
    generator = np.random.default_rng(8)
    size = np.array([[0.02, 0.02, 3], [0.02, 0.02, 3], [1e-4, 1e-4, 0]])
    matrices = np.stack([np.eye(3) + generator.normal(0, 1, (3, 3)) * size for _ in range(6)])
    keys = np.linspace(-0.5, 0.5, 6)

    def place_at(x, y, time):
        k = min(int((time + 0.5) * 5), 4)
        share = (time - keys[k]) * 5
        places = zip(through(matrices[k], x, y), through(matrices[k + 1], x, y), strict=True)
        return tuple((1 - share) * before + share * after for before, after in places)

    expected, known = averaged(picture, place_at, samples=400)
    seen = HomographyPath(matrices).apply(picture, View(60.0))
    assert np.abs(seen - expected)[known > 0.1].max() < 0.03


def test_light_is_kept_by_solid_angle():
    # Radiance × solid angle is what a turning camera keeps: a pixel's is the cube of the cosine off the axis.
    picture, focal_length = blobs(), 300.0
    y, x = np.mgrid[:120, :143] + 0.5
    cosine = focal_length / np.sqrt(focal_length**2 + (x - 71.5) ** 2 + (y - 60) ** 2)
    for turn in ((0.06, 0.0, 0.0), (0.03, 0.03, 0.6)):
        camera = TurningCamera(*turn)
        seen = camera.apply(picture, View(focal_length))
        before, after = (np.tensordot(cosine**3, light.astype(np.float64), 2) for light in (picture, seen))
        np.testing.assert_allclose(after, before, rtol=1e-4)
    # Where the scale stays that of the picture, pixel values are kept too.
    path = HomographyPath.along(lambda t: shift(13.7 * t + 8 * t * t, 9 * np.sin(5 * t)), 9)
    np.testing.assert_allclose(
        path.apply(picture, View(90.0)).sum((0, 1), np.float64), picture.sum((0, 1), np.float64), rtol=1e-6
    )


def test_even_light_stays_even_and_suns_have_no_dark_rings():
    camera, view = TurningCamera(0.4, 0.1, 0.3), View(60.0)
    np.testing.assert_allclose(camera.apply(np.full((33, 50, 3), 0.3, np.float32), view), 0.3, rtol=1e-6)
    picture = np.full((60, 83, 3), 1e-3, np.float32)
    picture[30, 40] = 1e6
    assert camera.apply(picture, view).min() == pytest.approx(1e-3, rel=1e-5)
    for shape in ((1, 1, 3), (5, 7, 3), (2, 30, 3)):
        np.testing.assert_allclose(camera.apply(np.full(shape, 0.3, np.float32), View(9.0)), 0.3, rtol=1e-6)


def test_a_streak_has_no_bands():
    # An even line crossed by a turn: along the streak light changes smoothly, though runs and steps do not.
    picture = np.zeros((200, 400, 3), np.float32)
    picture[100, 150:250] = 1
    seen = TurningCamera(0.0, 37 / 900, 0.0).apply(picture, View(900.0))
    inside = seen[85:115, 155:245, 0]
    assert np.abs(inside / inside.mean() - 1).max() < 0.004
    assert np.abs(np.diff(inside, axis=1)).max() < 1e-5


def test_what_never_saw_the_picture_is_black_and_known_not_at_all():
    away = HomographyPath(np.stack([shift(500, 0), shift(510, 0)]))
    assert not away.apply(rough(), View(60.0)).any()
    assert not away.coverage((50, 70), View(60.0)).any()


def test_threads_change_nothing(monkeypatch):
    camera, picture = TurningCamera(0.2, 0.0, 0.1), rough(90, 70)
    several = camera.apply(picture, View(60.0))
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    np.testing.assert_array_equal(camera.apply(picture, View(60.0)), several)


def test_the_arc_is_as_fine_as_said():
    # Half way between two keys the chord of a turn by δ is r (1 − cos δ/2) within the arc.
    for shape, allowed in (((60, 80), 7.5e-6 * 50), ((4000, 6000), 0.02)):
        path = TurningCamera(0.0, 0.0, 0.2).path(shape, 5000.0)
        step, radius = 0.2 / (len(path.matrices) - 1), np.hypot(*shape) / 2
        assert allowed / 4 < radius * (1 - np.cos(step / 2)) <= allowed
    assert len(TurningCamera(0.0).path((60, 80), 70.0).matrices) == 2


def test_bad_paths_are_refused():
    good = np.stack([np.eye(3)] * 3)
    with pytest.raises(ValueError, match=r"expected \(K, 3, 3\)"):
        HomographyPath(np.eye(3))
    with pytest.raises(ValueError, match="singular"):
        HomographyPath(np.stack([np.eye(3), np.zeros((3, 3))]))
    for times in ([-0.5, 0.5], [-0.5, 0.6, 0.5], [0, 0.2, 1]):
        with pytest.raises(ValueError, match=r"rise from -0\.5 to 0\.5"):
            HomographyPath(good, np.array(times))
    for wrong in (np.nan, 4.0):
        with pytest.raises(ValueError, match="at most 180°"):
            TurningCamera(wrong)


def test_a_turn_that_takes_a_corner_behind_the_camera_is_refused_with_the_largest_that_does_not():
    # 70 pixels at a focal length of 35 are 90° wide: a corner lies 45° off the axis, and reaches 90° at half of 90°.
    picture, view = rough(), View(35.0)
    for degrees in (91.0, 140.0, 180.0):
        with pytest.raises(ValueError, match=r"behind the camera; .* at most 89\.9°") as caught:
            TurningCamera(np.radians(degrees)).apply(picture, view)
        assert f"turns by {degrees:g}° and a picture of 90° × 71.1°" in str(caught.value)
    with pytest.raises(ValueError, match="behind the camera"):
        TurningCamera(np.radians(91.0)).coverage((50, 70), view)
    TurningCamera(np.radians(89.8)).apply(picture, view)
    # 2 atan(35 / 25) = 108.9° up or down; about its own axis a camera may turn as it likes.
    with pytest.raises(ValueError, match=r"at most 108\.8°"):
        TurningCamera(0.0, np.radians(120.0)).apply(picture, view)
    TurningCamera(0.0, 0.0, np.pi).apply(picture, view)


def test_a_path_that_takes_a_corner_behind_the_camera_is_refused():
    tilted = np.eye(3)
    tilted[2, 0] = -1 / 60
    with pytest.raises(ValueError, match="at key time 2 of 2 the path takes a corner of the 70×50 picture behind"):
        HomographyPath(np.stack([np.eye(3), tilted])).apply(rough(), View(60.0))


def test_what_is_far_beside_the_picture_takes_no_samples():
    # A way of 1e30 pixels beside the picture: no integer counts the samples of it.
    times = np.array([-0.5, -0.25, 0.0, 0.5])
    path = HomographyPath(np.stack([shift(0, 0), shift(10, 0), shift(90, 0), shift(1e30, 0)]), times)
    near = HomographyPath(np.stack([shift(0, 0), shift(10, 0), shift(90, 0), shift(200, 0)]), times)
    seen, known = path.apply(rough(), View(60.0)), path.coverage((50, 70), View(60.0))
    np.testing.assert_allclose(known, near.coverage((50, 70), View(60.0)), atol=1e-6)
    np.testing.assert_allclose(seen, near.apply(rough(), View(60.0)), atol=1e-5)


def test_a_turn_is_what_another_renderer_sees():
    # The mean of views of one sphere of light, as cameras turned about their own axes see it.
    generator = np.random.default_rng(4)
    light = np.kron(generator.random((32, 64, 3)), np.ones((8, 8, 1))).astype(np.float32)
    sphere = EnvironmentMap(light, LatLong())
    turn, field, size, samples = np.array([0.03, 0.1, 0.2]), np.radians(60), (96, 64), 24
    sharp = perspective_view(sphere, np.eye(3), field, size).radiance
    truth = np.zeros(sharp.shape)
    for time in (np.arange(samples) + 0.5) / samples - 0.5:
        rotation = Rotation.from_rotvec(time * turn).as_matrix()
        truth += perspective_view(sphere, rotation, field, size).radiance / samples
    camera, view = TurningCamera(turn[1], turn[0], turn[2]), View(48 / np.tan(field / 2))
    seen, known = camera.apply(sharp, view), camera.coverage((64, 96), view) > 0.999
    assert np.abs(seen - truth)[known].mean() < 0.01 * truth.mean()
    wrong = TurningCamera(-turn[1], turn[0], turn[2]).apply(sharp, view)
    assert np.abs(wrong - truth)[known].mean() > 0.03 * truth.mean()
