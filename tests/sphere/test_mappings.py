"""Every mapping: solid angles, inverse, and where the named directions lie."""

import numpy as np
import pytest

from relume.sphere.directions import normalised
from relume.sphere.mappings import MAPPINGS, Angular, LatLong, MirrorBall, pixel_points

EVERY = pytest.mark.parametrize("mapping", MAPPINGS.values(), ids=MAPPINGS.keys())
X, Y, Z = np.eye(3)


def spread(count, seed=0):
    return normalised(np.random.default_rng(seed).normal(size=(count, 3)))


@EVERY
@pytest.mark.parametrize("size", [1, 2, 3, 5, 16, 33, 100, 257])
def test_pixel_solid_angles_sum_to_the_whole_sphere(mapping, size):
    solid_angles = mapping.solid_angles(size)
    assert solid_angles.shape == (size, mapping.aspect * size)
    assert solid_angles.min() >= 0
    # The lat-long sum telescopes; round a disc's rim the quadrature meets a kink, worst where pixels are large.
    allowed = 1e-12 if isinstance(mapping, LatLong) else 5e-4 if size < 16 else 2e-5
    assert solid_angles.sum() == pytest.approx(4 * np.pi, rel=allowed)


def test_a_lat_long_pixel_has_the_solid_angle_of_its_band():
    # dΩ = (2π/W)(cos θ₁ − cos θ₂) with W = 8, θ = 0, 45°, 90°.
    rows = LatLong().solid_angles(4)[:, 0]
    np.testing.assert_allclose(rows, [0.230038, 0.555360, 0.555360, 0.230038], atol=5e-7)


def test_the_middle_of_an_angular_map_is_pi_squared_times_its_area():
    # dΩ/dA = π sin(πr)/r → π² at the centre; a pixel of 1/128 of the map has side 2/128 in r.
    middle = Angular().solid_angles(129)[64, 64]
    assert middle == pytest.approx(np.pi**2 * (2 / 129) ** 2, rel=1e-3)  # sin is πr to (πr)²/6


def test_every_whole_pixel_of_a_mirror_ball_has_the_same_solid_angle():
    # dΩ = 4 dA, A27.
    solid_angles = MirrorBall().solid_angles(64)
    across, upward = np.moveaxis(2 * pixel_points(MirrorBall(), 64) - 1, -1, 0)
    whole = np.hypot(np.abs(across) + 1 / 64, np.abs(upward) + 1 / 64) < 1
    np.testing.assert_allclose(solid_angles[whole], 4 * (2 / 64) ** 2, rtol=1e-9)


@EVERY
@pytest.mark.parametrize("size", [6, 9])
def test_solid_angles_agree_with_counting_directions(mapping, size):
    count = 400_000
    u, v = np.moveaxis(mapping.image_points(spread(count, seed=7)), -1, 0)
    rows = np.minimum((v * size).astype(int), size - 1)
    columns = np.minimum((u * mapping.aspect * size).astype(int), mapping.aspect * size - 1)
    counted = np.zeros((size, mapping.aspect * size))
    np.add.at(counted, (rows, columns), 1)
    share = mapping.solid_angles(size) / (4 * np.pi)
    assert counted[share < 1e-15].sum() == 0
    # Counts are binomial; 4.5 standard deviations hold for all of ≤ 162 pixels but once in a thousand runs.
    deviation = np.sqrt(count * share * (1 - share))
    assert np.all(np.abs(counted - count * share) <= 4.5 * deviation + 1e-9)


@EVERY
def test_directions_undo_image_points(mapping):
    directions = spread(5000, seed=1)
    back = mapping.directions(mapping.image_points(directions))
    np.testing.assert_allclose(back, directions, atol=1e-7)  # a ball's rim: asin loses half of the digits


@EVERY
def test_image_points_undo_directions(mapping):
    points = pixel_points(mapping, 33)
    directions = mapping.directions(points)
    shown = ~np.isnan(directions[..., 0])
    np.testing.assert_allclose(np.linalg.norm(directions[shown], axis=-1), 1, atol=1e-12)
    np.testing.assert_allclose(mapping.image_points(directions[shown]), points[shown], atol=1e-12)


@EVERY
def test_the_six_axes_and_their_opposites_have_finite_points_inside_the_image(mapping):
    points = mapping.image_points(np.concatenate([np.eye(3), -np.eye(3)]))
    assert np.all((points >= 0) & (points <= 1))


@EVERY
def test_a_pixel_has_a_solid_angle_wherever_the_image_shows_a_direction(mapping):
    shown = ~np.isnan(mapping.directions(pixel_points(mapping, 50))[..., 0])
    assert np.all(mapping.solid_angles(50)[shown] > 0)


def test_pixel_centres_lie_half_a_pixel_in():
    points = pixel_points(LatLong(), 2)
    assert points.shape == (2, 4, 2)
    assert points[0, 0].tolist() == [0.125, 0.25]
    assert points[1, 3].tolist() == [0.875, 0.75]
    assert pixel_points(Angular(), 2, subdivision=2)[0, 0].tolist() == [0.125, 0.125]


@pytest.mark.parametrize(
    ("direction", "point"),
    [(-Z, (0.5, 0.5)), (X, (0.75, 0.5)), (-X, (0.25, 0.5)), (Z, (0.0, 0.5)), (normalised(Y - Z), (0.5, 0.25))],
    ids=["-Z", "+X", "-X", "+Z", "up and ahead"],
)
def test_a_lat_long_has_minus_z_in_its_centre_and_plus_x_to_the_right(direction, point):
    np.testing.assert_allclose(LatLong().image_points(direction), point, atol=1e-15)


def test_row_0_of_a_lat_long_is_plus_y():
    assert LatLong().image_points(Y)[1] == 0
    assert LatLong().image_points(-Y)[1] == 1


@pytest.mark.parametrize(
    ("direction", "radius"),  # A29
    [(-Z, 0), (X, 0.5), (normalised(X - Z), 0.25), ((0.6, 0, -0.8), 0.204833), ((0.6, 0, 0.8), 0.795167), (Z, 1)],
)
def test_an_angular_map_has_minus_z_in_its_centre_and_the_angle_as_its_radius(direction, radius):
    u, v = Angular().image_points(np.asarray(direction, float))
    assert u == pytest.approx(0.5 + radius / 2, abs=5e-7)
    assert v == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize(
    ("radius", "degrees"),  # A27: θ = 2 asin r from the direction towards the camera
    [(0, 0), (0.25, 28.955024), (0.5, 60), (0.70710678, 90), (0.9, 128.316), (0.99, 163.781), (0.999, 174.875)],
)
def test_a_mirror_ball_has_plus_z_in_its_centre_and_reflects_by_twice_the_arc(radius, degrees):
    direction = MirrorBall().directions(np.array([0.5 + radius / 2, 0.5]))
    assert np.degrees(np.arccos(direction[2])) == pytest.approx(degrees, abs=1e-3)
    assert direction[0] >= 0  # +X to the right


@pytest.mark.parametrize("mapping", [Angular(), MirrorBall()], ids=["angular", "ball"])
def test_a_disc_shows_up_above_and_right_to_the_right(mapping):
    (right, _), (_, above) = mapping.image_points(X), mapping.image_points(Y)
    assert right > 0.5 > above


@pytest.mark.parametrize("mapping", [Angular(), MirrorBall()], ids=["angular", "ball"])
def test_the_corners_of_a_disc_show_nothing(mapping):
    assert np.isnan(mapping.directions(np.array([0.01, 0.01]))).all()
    assert mapping.solid_angles(32)[0, 0] < 1e-15  # rounding of terms that cancel
