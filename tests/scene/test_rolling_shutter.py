"""Rolling shutters: every row has the pose of its time, also in windows and smaller pictures, and in Dr.Jit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relume.composite.surface.several_plates import LitView, _Places
from relume.composite.surface.two_views import plate_points, shown_at
from relume.errors import InvalidShot, UnsupportedScene
from relume.export.shot_lamps import undistorted as exported
from relume.image.radiance import RadianceMap
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.whitted.kernel_data import view_of
from relume.scene.cameras.camera import Camera, undistorted
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.rolling_shutter import RollingShutter, rolling_through
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Diffuse, Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap

EYE, SIZE, FOCAL = np.array([0.1, 0.2, 1.0]), (96, 64), 80.0


def pose(share: float) -> tuple[np.ndarray, np.ndarray]:
    """A camera that walks at an even pace and turns at one."""
    turn = Rotation.from_rotvec(share * np.array([0.02, 0.12, -0.05])).as_matrix()
    return EYE + share * np.array([0.06, -0.02, 0.03]), turn @ Rotation.from_euler("x", -10, degrees=True).as_matrix()


def rolling_camera(upwards: bool = False, lens: Distortion | None = None) -> Camera:
    (a, p), (b, q), (c, r) = (pose(share) for share in (-0.5, 0.0, 0.5))
    rolling = rolling_through((a, b, c), (p, q, r), SIZE[1], upwards)
    return Camera(*SIZE, FOCAL, b, q, distortion=lens, rolling=rolling)


def still(y: float, upwards: bool = False, lens: Distortion | None = None) -> Camera:
    """The camera at the time of a row."""
    share = y / SIZE[1] - 0.5
    return Camera(*SIZE, FOCAL, *pose(-share if upwards else share), distortion=lens)


@pytest.mark.parametrize("upwards", [False, True])
@pytest.mark.parametrize("lens", [None, Distortion(k1=-0.1, p1=0.002)])
@pytest.mark.parametrize("y", [0.5, 17.0, 32.0, 63.5])
def test_the_rays_of_a_row_are_those_of_a_still_camera_at_its_time(y, upwards, lens):
    points = np.array([[3.0, y], [50.0, y], [95.0, y]])
    camera, there = rolling_camera(upwards, lens), still(y, upwards, lens)
    np.testing.assert_allclose(camera.rays_through(points), there.rays_through(points), atol=1e-12)
    np.testing.assert_allclose(camera.eyes(points), np.tile(there.position, (3, 1)), atol=1e-12)
    # What lies on them is projected back.
    ends = camera.eyes(points) + 2.5 * camera.rays_through(points)
    np.testing.assert_allclose(camera.project(ends), points, atol=1e-6)


def test_windows_and_smaller_pictures_keep_the_times_of_their_rows():
    camera, points = rolling_camera(), np.array([[10.0, 6.0], [20.0, 9.5]])
    part = camera.window(8, 40, 30, 20)
    np.testing.assert_allclose(part.rays_through(points), camera.rays_through(points + np.array([8, 40])), atol=1e-12)
    np.testing.assert_allclose(part.eyes(points), camera.eyes(points + np.array([8, 40])), atol=1e-12)
    half = camera.resized(48, 32)
    np.testing.assert_allclose(half.rays_through(points), camera.rays_through(2 * points), atol=1e-12)
    np.testing.assert_allclose(half.eyes(points), camera.eyes(2 * points), atol=1e-12)
    # Another aspect: rows above and below.
    tall = camera.resized(48, 40)
    np.testing.assert_allclose(tall.eyes(points + np.array([0, 4])), camera.eyes(2 * points), atol=1e-12)


def test_an_undistorted_picture_is_of_one_moment():
    straight = undistorted(rolling_camera())
    assert straight.rolling is None and straight.width > SIZE[0]
    assert undistorted(still(32.0)).width == SIZE[0]


def test_a_motion_that_begins_with_the_picture_counts_for_both_halves():
    (_, _), (b, q), (c, r) = (pose(share) for share in (-0.5, 0.0, 0.5))
    begun, whole = rolling_through((b, b, c), (q, q, r), SIZE[1]), rolling_camera().rolling
    assert whole is not None
    np.testing.assert_allclose(begun.moves, whole.moves, atol=1e-12)
    np.testing.assert_allclose(begun.turns, whole.turns, atol=1e-12)


def test_rows_that_are_none_and_turns_that_are_no_shutters_are_refused():
    none = np.zeros((2, 3))
    with pytest.raises(ValueError, match="of 0 rows"):
        RollingShutter(none, none, 32.0, 0.0)
    with pytest.raises(ValueError, match="turns by 115°"):
        RollingShutter(none, np.array([[0, 2.0, 0], [0, 0, 0]]), 32.0, 64.0)
    with pytest.raises(ValueError, match=r"expected \(2, 3\) numbers"):
        RollingShutter(none * np.nan, none, 32.0, 64.0)


def test_renderers_that_see_from_one_point_refuse_it():
    with pytest.raises(UnsupportedScene, match="this one's lens moves"):
        view_of(rolling_camera())


def test_the_path_tracer_renders_each_row_at_its_time():
    scene = Scene(
        EnvironmentMap(np.full((8, 16, 3), 0.2, np.float32)),
        objects=(Sphere((0.05, 0.28, -0.3), 0.12, Diffuse((0.9, 0.9, 0.9))),),
    )
    camera = rolling_camera()
    depth = Mitsuba(samples=64, depth=2).render(scene, camera).depth
    seen = np.isfinite(depth) & (depth > 0)
    points = np.stack(np.meshgrid((np.arange(96 * 4) + 0.5) / 4, (np.arange(64 * 4) + 0.5) / 4), axis=-1)
    way = np.array([0.05, 0.28, -0.3]) - camera.eyes(points)
    rays = camera.rays_through(points)
    along = np.sum(way * rays, axis=-1)
    met = np.linalg.norm(way - along[..., None] * rays, axis=-1) < 0.12
    share = met.reshape(64, 4, 96, 4).mean((1, 3)) > 0.02
    # All that the rows' own rays meet is seen, and nothing else.
    assert share.sum() > 100 and np.sum(share != seen) < 8
    frozen = Mitsuba(samples=64, depth=2).render(scene, replace(camera, rolling=None)).depth
    assert np.sum(share != (np.isfinite(frozen) & (frozen > 0))) > 40


def test_an_export_refuses_it():
    plate = RadianceMap(np.ones((SIZE[1], SIZE[0], 3), np.float32))
    scene = Scene(EnvironmentMap(np.ones((8, 16, 3), np.float32)))
    with pytest.raises(InvalidShot, match=r"camera\.readout: other programs' cameras see all rows at once"):
        exported(PreparedShot(scene, rolling_camera(), plate))


def floor_seen() -> tuple[Camera, Scene]:
    """The camera over a floor that it sees in all its pixels, half a metre below."""
    light = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    (a, p), (b, q), (c, r) = (pose(share) for share in (-0.5, 0.0, 0.5))
    down = Rotation.from_euler("x", -45, degrees=True).as_matrix()
    rolling = rolling_through((a, b, c), (p @ down, q @ down, r @ down), SIZE[1])
    floor = Plane(Diffuse((0.5, 0.5, 0.5)), (40.0, 40.0), -0.5)
    return Camera(*SIZE, FOCAL, b, q @ down, rolling=rolling), Scene(light, (floor,))


def test_places_of_a_floor_are_found_where_the_row_that_shows_them_saw_them():
    camera, scene = floor_seen()
    middles, white = camera.middles(), np.ones((*SIZE[::-1], 3), np.float32)
    places = _Places.of(LitView(RadianceMap(white), camera, scene))
    assert np.all(places.parts == 0)
    np.testing.assert_allclose(places.points[..., 1], -0.5, atol=1e-5)
    assert np.abs(camera.project(places.points) - middles).max() < 0.05
    shared = plate_points(RadianceMap(white), camera, scene, 0, np.ones(SIZE[::-1], bool))
    at = camera.project(shared.points)
    assert np.abs(at - np.floor(at) - 0.5).max() < 0.05
    np.testing.assert_allclose(shared.seen_from, camera.eyes(at), atol=1e-4)
    np.testing.assert_allclose(camera.eyes_towards(shared.points), shared.seen_from, atol=1e-4)
    usable, caster = np.ones(SIZE[::-1], bool), RayCaster.of(scene.local)
    assert shown_at(camera, caster, shared.points, at, usable, 0).all()
    # From the middle row's place the rays of the first row would end pixels away.
    wrong = camera.position + places.points - camera.eyes(middles)
    assert np.abs(camera.project(wrong) - middles).max() > 1


def test_what_is_behind_the_camera_is_seen_from_the_middle_rows_place():
    camera, _ = floor_seen()
    np.testing.assert_array_equal(camera.eyes_towards(camera.position + camera.rotation[:, 2]), camera.position)
