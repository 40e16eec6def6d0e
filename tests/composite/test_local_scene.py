"""Recovering the reflectance of a plane: a plate made from a known one gives it back."""

import numpy as np
import pytest

from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from relume.surface.local_scene import Recovered, recover_reflectance

REFLECTANCE = np.array([0.6, 0.35, 0.08])
CAMERA = Camera.looking_at(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.0, 0.0]), width=96, height=64, focal_length=80.0)
PLANE = Plane(Diffuse((0.5, 0.5, 0.5)))


def sky(size: int = 64) -> EnvironmentMap:
    """Light from above that grows with height, radiance c·(1 + 2y): its irradiance upwards is c·(π + 4π/3)."""
    up = LatLong().directions(pixel_points(LatLong(), size))[..., 1]
    colour = np.array([1.0, 0.8, 1.5])
    return EnvironmentMap((colour * (1 + 2 * np.maximum(up, 0))[..., None]).astype(np.float32))


IRRADIANCE = np.array([1.0, 0.8, 1.5]) * np.pi * 7 / 3


def plate_of(reflectance: np.ndarray, camera: Camera = CAMERA) -> RadianceMap:
    """The plane seen by the camera, L = ρ E / π, and a sky that must not count."""
    rays = camera.rays()
    radiance = np.where(rays[..., 1:2] < 0, reflectance * IRRADIANCE / np.pi, 99.0)
    return RadianceMap(radiance.astype(np.float32))


def box(x: float, z: float, *, width: float = 0.2, height: float = 0.2) -> Mesh:
    """A box that stands on the plane."""
    corners = np.array([[a, b, c] for a in (-0.5, 0.5) for b in (0, 1) for c in (-0.5, 0.5)])
    vertices = (corners * [width, height, width] + [x, 0, z]).astype(np.float32)
    return Mesh(vertices, np.array([[0, 1, 2], [4, 5, 6]], np.int32), Diffuse((0.5, 0.5, 0.5)))


def ground(camera: Camera = CAMERA) -> np.ndarray:
    """Where each pixel's ray meets y = 0, (H, W, 3)."""
    rays = camera.rays()
    return camera.position + (-camera.position[1] / rays[..., 1])[..., None] * rays


def test_a_plane_of_known_reflectance_gives_it_back():
    recovered = recover_reflectance(plate_of(REFLECTANCE), CAMERA, sky(), PLANE)
    assert isinstance(recovered, Recovered)
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3)
    assert recovered.measured == recovered.reflectance
    assert recovered.spread == pytest.approx([0, 0, 0], abs=1e-6)
    assert recovered.pixels == 96 * 64  # this camera sees nothing else


def test_the_reflectance_of_a_camera_that_sees_the_horizon_is_the_plane_s_alone():
    camera = Camera.looking_at(
        np.array([0.0, 0.3, 2.0]), np.array([0.0, 0.2, 0.0]), width=96, height=64, focal_length=60.0
    )
    recovered = recover_reflectance(plate_of(REFLECTANCE, camera), camera, sky(), PLANE)
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3)
    assert recovered.spread == pytest.approx([0, 0, 0], abs=1e-6)
    assert 0 < recovered.pixels < 0.9 * 96 * 64


def test_twice_the_light_on_both_sides_is_the_same_reflectance():
    plate, light = plate_of(REFLECTANCE), sky()
    twice = recover_reflectance(RadianceMap(2 * plate.radiance), CAMERA, EnvironmentMap(2 * light.radiance), PLANE)
    assert twice.reflectance == pytest.approx(REFLECTANCE, abs=1e-3)


def test_only_the_ground_round_the_objects_is_looked_at():
    plate, points = plate_of(REFLECTANCE), ground()
    # Another colour wherever it is farther than an object's height from its footprint.
    near = (np.abs(points[..., 0] - 0.3) < 0.3) & (np.abs(points[..., 2] + 0.2) < 0.3)
    plate.radiance[~near] = 7.0
    recovered = recover_reflectance(plate, CAMERA, sky(), PLANE, [box(0.3, -0.2)])
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3)
    assert recovered.pixels == near.sum()


def test_the_ground_round_every_object_counts():
    plate, points = plate_of(REFLECTANCE), ground()
    left, right = ((np.abs(points[..., 0] - x) < 0.3) & (np.abs(points[..., 2]) < 0.3) for x in (-0.4, 0.4))
    assert not np.any(left & right)
    plate.radiance[right] *= 1.2
    recovered = recover_reflectance(plate, CAMERA, sky(), PLANE, [box(-0.4, 0), box(0.4, 0)])
    assert recovered.pixels == left.sum() + right.sum()
    # The two halves are of one size, so the 16th and 84th percentile are the two reflectances.
    assert recovered.spread == pytest.approx(0.1 * REFLECTANCE, rel=1e-2)


def test_the_median_passes_over_what_lies_on_the_ground():
    plate = plate_of(REFLECTANCE)
    plate.radiance[20:30, 30:60] = 0.01
    plate.radiance[40:44, 10:40] = 50.0
    assert recover_reflectance(plate, CAMERA, sky(), PLANE).reflectance == pytest.approx(REFLECTANCE, abs=1e-3)


def test_pixels_that_no_photograph_measured_are_left_out():
    plate = plate_of(REFLECTANCE)
    clipped = np.zeros((64, 96), np.uint8)
    clipped[:20], clipped[20:40] = SATURATED, BLACK
    plate.radiance[:40] = 123.0
    recovered = recover_reflectance(RadianceMap(plate.radiance, clipped=clipped), CAMERA, sky(), PLANE)
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3)
    assert recovered.pixels == 24 * 96


def test_a_reflectance_above_one_is_held_to_one_and_told():
    recovered = recover_reflectance(plate_of(np.array([1.7, 0.5, 1.01])), CAMERA, sky(), PLANE)
    assert recovered.reflectance == pytest.approx([1.0, 0.5, 1.0], abs=1e-3)
    assert recovered.measured == pytest.approx([1.7, 0.5, 1.01], abs=2e-3)


def test_a_rectangle_ends_where_it_ends():
    plate, points = plate_of(REFLECTANCE), ground()
    on = (np.abs(points[..., 0]) <= 0.4) & (np.abs(points[..., 2]) <= 0.25)
    plate.radiance[~on] = 9.0
    recovered = recover_reflectance(plate, CAMERA, sky(), Plane(PLANE.material, size=(0.8, 0.5)))
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3) and recovered.pixels == on.sum()


def test_a_plane_that_is_not_seen_is_refused():
    up = Camera.looking_at(
        np.array([0.0, 1.0, 2.0]), np.array([0.0, 3.0, 0.0]), width=96, height=64, focal_length=300.0
    )
    with pytest.raises(ValueError, match=r"sees 0 measured pixels of the plane; give its reflectance instead"):
        recover_reflectance(plate_of(REFLECTANCE, up), up, sky(), PLANE)


def test_a_plane_of_which_every_pixel_is_clipped_is_refused():
    plate = RadianceMap(plate_of(REFLECTANCE).radiance, clipped=np.full((64, 96), SATURATED, np.uint8))
    with pytest.raises(ValueError, match="give its reflectance instead"):
        recover_reflectance(plate, CAMERA, sky(), PLANE)


def test_the_plane_s_own_height_decides_where_it_is_seen():
    # The table top stands half a metre up; its corner pixels are those whose rays meet that level inside the rectangle.
    table = Plane(PLANE.material, size=(0.6, 0.6), height=0.5)
    rays = CAMERA.rays()
    points = CAMERA.position + ((0.5 - 1.0) / rays[..., 1])[..., None] * rays
    on = (rays[..., 1] < 0) & (np.abs(points[..., 0]) <= 0.3) & (np.abs(points[..., 2]) <= 0.3)
    plate = plate_of(REFLECTANCE)
    plate.radiance[~on] = 9.0
    recovered = recover_reflectance(plate, CAMERA, sky(), table)
    assert recovered.reflectance == pytest.approx(REFLECTANCE, abs=1e-3) and recovered.pixels == on.sum()
