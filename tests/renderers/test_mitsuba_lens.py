"""The camera in Dr.Jit against the camera in NumPy: rays, where points are seen, and how large, also blurred."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion

PLAIN = replace(
    Camera.looking_at(np.array([0.4, 0.9, 1.6]), np.array([0, 0.1, -0.2]), width=160, height=100, focal_length=140),
    centre=(76.0, 53.0),
)
BENT = replace(PLAIN, distortion=Distortion(k1=-0.21, k2=0.06, p1=0.004, p2=-0.003, k3=-0.01))
CAMERAS = {"plain": PLAIN, "bent": BENT}


def lens_of(camera: Camera) -> Any:
    from relume.renderers.mitsuba.transport.lens import Lens

    return Lens(camera)


def points(count: int, seed: int = 2) -> np.ndarray:
    """Pixel coordinates all over the picture."""
    return np.random.default_rng(seed).random((count, 2)) * [PLAIN.width, PLAIN.height]


def rays(mi: Any, camera: Camera, at: np.ndarray, aperture: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (N, 3)."""
    disc = np.full_like(at, 0.5) if aperture is None else aperture
    x, y, u, v = (mi.Float(np.ascontiguousarray(c, np.float32)) for c in (*at.T, *disc.T))
    ray = lens_of(camera).rays(x, y, mi.Point2f(u, v))
    origins = np.broadcast_to(np.array(ray.o).T, (len(at), 3))
    return origins.astype(np.float64), np.array(ray.d).T.astype(np.float64)


def seen_at(mi: Any, camera: Camera, places: np.ndarray, aperture: np.ndarray | None = None) -> tuple[Any, Any, Any]:
    """Pixel coordinates (N, 2) of places (N, 3), factors (N,), and the ways back as Mitsuba's rays."""
    import drjit as dr

    disc = np.full((len(places), 2), 0.5) if aperture is None else aperture
    si = dr.zeros(mi.SurfaceInteraction3f, len(places))
    si.p = mi.Point3f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in places.T))
    si.n = mi.Vector3f(0, 1, 0)
    point = mi.Point2f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in disc.T))
    at, factor, back = lens_of(camera).seen_at(si, point, mi.Bool(True))
    return np.array(at).T, np.array(factor), back


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_rays_are_those_of_the_camera(mi, camera):
    at = points(4000)
    origins, directions = rays(mi, camera, at)
    assert np.abs(origins - camera.position).max() < 1e-6
    assert np.abs(directions - camera.rays_through(at)).max() < 1e-4
    # And so the camera sees what lies on them where they went through the picture.
    assert np.abs(camera.project(origins + 3 * directions) - at).max() < 5e-3


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_a_point_is_seen_where_the_camera_projects_it_and_as_large(mi, camera):
    at = points(300)
    distance = np.random.default_rng(4).uniform(0.5, 4, (300, 1))
    way = camera.rays_through(at)
    places = camera.position + distance * way
    found, factor, back = seen_at(mi, camera, places)
    assert np.abs(found - camera.project(places)).max() < 5e-3
    assert np.abs(np.array(back.d).T + way).max() < 1e-5
    assert np.array(back.maxt) == pytest.approx(distance[:, 0], rel=1e-3)
    # A square millimetre that faces the camera: the area of its picture by its corners.
    right = np.cross(way, camera.rotation[:, 1])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(right, way)
    corners = [camera.project(places + 5e-4 * (a * right + b * up)) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    across, along = corners[2] - corners[0], corners[3] - corners[1]
    area = np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0]) / 2
    assert factor == pytest.approx(area / 1e-6, rel=1e-3)


def test_what_is_behind_the_camera_or_beside_the_picture_is_not_seen(mi):
    behind = PLAIN.position + PLAIN.rotation[:, 2]
    beside = PLAIN.position + PLAIN.rays_through(np.array([-3.0, 50.0]))
    within = PLAIN.position + PLAIN.rays_through(np.array([3.0, 50.0]))
    _, factor, _ = seen_at(mi, PLAIN, np.array([behind, beside, within]))
    assert factor[0] == factor[1] == 0 and factor[2] > 0


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_rays_of_all_points_of_a_lens_meet_in_the_plane_of_focus(mi, camera):
    thin = replace(camera, aperture=0.05, focus=1.3)
    at = np.repeat(points(20), 50, axis=0)
    aperture = np.random.default_rng(5).random((1000, 2))
    origins, directions = rays(mi, thin, at, aperture)
    # The lens is a disc across the viewing axis.
    offset = (origins - camera.position) @ camera.rotation
    assert np.abs(offset[:, 2]).max() < 1e-6
    assert 0.045 < np.linalg.norm(offset, axis=1).max() <= 0.05 + 1e-6
    axis = -camera.rotation[:, 2]
    reach = (1.3 - (origins - camera.position) @ axis) / (directions @ axis)
    meeting = (origins + reach[:, None] * directions).reshape(20, 50, 3)
    assert np.ptp(meeting, axis=1).max() < 1e-5
    sharp = camera.rays_through(at[::50])
    expected = camera.position + 1.3 * sharp / (sharp @ axis)[:, None]
    assert np.abs(meeting.mean(1) - expected).max() < 1e-4
    # At half that distance they are half of the lens apart.
    halfway = (origins + reach[:, None] / 2 * directions).reshape(20, 50, 3)
    assert np.ptp(halfway, axis=1).max() > 0.04


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_through_a_lens_a_point_is_seen_where_its_ray_went_through_the_picture(mi, camera):
    thin = replace(camera, aperture=0.05, focus=1.3)
    at, aperture = points(500), np.random.default_rng(6).random((500, 2))
    origins, directions = rays(mi, thin, at, aperture)
    distance = np.random.default_rng(7).uniform(0.5, 4, (500, 1))
    found, factor, back = seen_at(mi, thin, origins + distance * directions, aperture)
    inside = np.all((at > 0.1) & (at < [camera.width - 0.1, camera.height - 0.1]), axis=1)
    assert inside.sum() > 480 and (factor[inside] > 0).all()
    assert np.abs(found - at)[inside].max() < 0.01
    assert np.abs(np.array(back.d).T + directions).max() < 1e-4
