"""Every mapping: solid angles, inverse, and where the named directions lie."""

import numpy as np
import pytest

from lights import NAMED, fitting, spread
from relume.sphere.directions import normalised
from relume.sphere.mappings.discs import Angular, Fisheye, Hemispheres, MirrorBall
from relume.sphere.mappings.mapping import LatLong, pixel_directions, pixel_points
from relume.sphere.mappings.names import mapping_named

EVERY = pytest.mark.parametrize("mapping", NAMED.values(), ids=NAMED.keys())
X, Y, Z = np.eye(3)


def _is_round(mapping):
    return isinstance(mapping, Angular | MirrorBall | Fisheye | Hemispheres)


@EVERY
@pytest.mark.parametrize("size", [1, 2, 3, 5, 16, 33, 100, 257])
def test_pixel_solid_angles_sum_to_the_whole_sphere(mapping, size):
    size = fitting(mapping, size)
    solid_angles = mapping.solid_angles(size)
    assert solid_angles.shape == mapping.shape(size)
    assert solid_angles.min() >= 0
    # All sums telescope but for the discs': round a rim the quadrature meets a kink, worst where pixels are large.
    allowed = 1e-12 if not _is_round(mapping) else 5e-4 if size < 16 else 2e-5
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
    count, size = 400_000, fitting(mapping, size)
    u, v = np.moveaxis(mapping.image_points(spread(count, seed=7)), -1, 0)
    shape = mapping.shape(size)
    rows, columns = (
        np.minimum((v * shape[0]).astype(int), size - 1),
        np.minimum((u * shape[1]).astype(int), shape[1] - 1),
    )
    counted = np.zeros(shape)
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
    points = pixel_points(mapping, fitting(mapping, 33))
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
    size = fitting(mapping, 50)
    shown = ~np.isnan(mapping.directions(pixel_points(mapping, size))[..., 0])
    assert np.all(mapping.solid_angles(size)[shown] > 0)


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


@EVERY
def test_the_first_moment_of_constant_light_is_nothing(mapping):
    # Σ ω dΩ = 0: solid angles put beside the wrong pixels would draw it to a side.
    size = fitting(mapping, 120)
    moment = np.einsum("hwk,hw->k", pixel_directions(mapping, size), mapping.solid_angles(size))
    assert np.abs(moment).max() < 2e-3


@EVERY
def test_a_files_name_finds_the_mapping_again(mapping):
    assert mapping_named(mapping.name) == mapping


def test_a_name_nobody_knows_is_answered_with_all_there_are():
    with pytest.raises(ValueError, match=r'no mapping "mercator"; there are latlong, angular, ball, cross, .* fisheye'):
        mapping_named("mercator")


CROSSES = {
    # face: (its middle's column and row, the direction of its right edge's middle), in cells of the image
    "cross": {
        "-Z": (1.5, 1.5, X),
        "+X": (2.5, 1.5, Z),
        "+Z": (3.5, 1.5, -X),
        "-X": (0.5, 1.5, -Z),
        "+Y": (1.5, 0.5, X),
    },
    "cross-vertical": {"-Z": (1.5, 1.5, X), "+X": (2.5, 1.5, Z), "+Z": (1.5, 3.5, X), "-Y": (1.5, 2.5, X)},
    "strip": {
        "+X": (0.5, 0.5, -Z),
        "-X": (1.5, 0.5, Z),
        "+Y": (2.5, 0.5, X),
        "+Z": (4.5, 0.5, X),
        "-Z": (5.5, 0.5, -X),
    },
}
GRIDS = {"cross": (4, 3), "cross-vertical": (3, 4), "strip": (6, 1)}
AXES = {
    sign + name: (1 if sign == "+" else -1) * axis for sign in "+-" for name, axis in zip("XYZ", (X, Y, Z), strict=True)
}


@pytest.mark.parametrize(("name", "face"), [(name, face) for name, faces in CROSSES.items() for face in faces])
def test_each_face_of_a_cube_lies_where_the_layout_says_and_as_turned(name, face):
    column, row, right = CROSSES[name][face]
    middle = np.array([column / GRIDS[name][0], row / GRIDS[name][1]])
    mapping = mapping_named(name)
    np.testing.assert_allclose(mapping.directions(middle), AXES[face], atol=1e-15)
    np.testing.assert_allclose(mapping.image_points(AXES[face]), middle, atol=1e-15)
    towards = mapping.directions(middle + np.array([0.25 / GRIDS[name][0], 0]))
    np.testing.assert_allclose(towards, normalised(AXES[face] + right / 2), atol=1e-15)


@pytest.mark.parametrize("name", ["cross", "cross-vertical"])
def test_a_cross_is_continuous_where_its_faces_touch(name):
    # Seen from inside, a step over an edge between two faces of the image is a small step of direction.
    mapping = mapping_named(name)
    columns, rows = GRIDS[name]
    joints = [(1, 1.5, 0), (2, 1.5, 0), (1.5, 1, 1), (1.5, 2, 1)] + ([(3, 1.5, 0)] if columns == 4 else [(1.5, 3, 1)])
    for column, row, down in joints:
        step = np.array([0.0, 1e-6] if down else [1e-6, 0.0])
        at = np.array([column / columns, row / rows])
        np.testing.assert_allclose(mapping.directions(at - step), mapping.directions(at + step), atol=1e-4)


def test_the_empty_cells_of_a_cross_show_nothing():
    assert np.isnan(mapping_named("cross").directions(np.array([0.9, 0.1]))).all()
    assert mapping_named("cross").solid_angles(9)[0, -1] == 0
    with pytest.raises(ValueError, match="a cross map of 100 rows; expected a multiple of 3, like 768"):
        mapping_named("cross").shape(100)


def test_a_corner_texel_of_a_cube_covers_less_than_one_in_the_middle():
    # A31: dΩ = du dv/(1+u²+v²)^{3/2}, on 3 × 3 texels: 4 atan-terms of the middle one, 0.3923 sr… and all 4π/6.
    face = mapping_named("strip").solid_angles(3)[:, :3]
    assert face.sum() == pytest.approx(2.094395, abs=1e-6)
    assert face[1, 1] == pytest.approx(4 * np.arctan((1 / 9) / np.sqrt(1 / 9 + 1 / 9 + 1)), rel=1e-12)


@pytest.mark.parametrize("name", ["octahedral", "equalarea"])
@pytest.mark.parametrize(
    ("direction", "point"),
    [(Y, (0.5, 0.5)), (X, (1, 0.5)), (Z, (0.5, 1)), (-Z, (0.5, 0)), (normalised(X + Z), (0.75, 0.75))],
    ids=["+Y", "+X", "+Z", "-Z", "between"],
)
def test_a_square_is_a_plan_seen_from_above(name, direction, point):
    np.testing.assert_allclose(mapping_named(name).image_points(direction), point, atol=1e-12)


def test_an_octahedron_is_flat_and_an_equal_area_square_is_not():
    # (1, 1, 0)/√2 halves the way on the octahedron; 1 − √½ of the upper half lies above it.
    up = normalised(X + Y)
    np.testing.assert_allclose(mapping_named("octahedral").image_points(up), (0.75, 0.5), atol=1e-12)
    u = 0.5 + np.sqrt(1 - np.sqrt(0.5)) / 2
    np.testing.assert_allclose(mapping_named("equalarea").image_points(up), (u, 0.5), atol=1e-12)
    assert np.ptp(mapping_named("equalarea").solid_angles(64)) == 0


@pytest.mark.parametrize(
    ("mapping", "degrees", "radius"),
    [
        (Fisheye(), 45, 0.5),
        (Fisheye(equisolid=True), 45, np.sin(np.pi / 8) / np.sin(np.pi / 4)),
        (Fisheye(np.radians(120)), 30, 0.5),
    ],
)
def test_a_fisheye_spreads_angles_as_its_lens_does(mapping, degrees, radius):
    angle = np.radians(degrees)
    u, v = mapping.image_points(np.array([0, np.sin(angle), -np.cos(angle)]))
    assert (u, v) == pytest.approx((0.5, 0.5 - radius / 2), abs=1e-12)


def test_a_fisheye_shows_its_field_and_nothing_else():
    lens = Fisheye(np.radians(120))
    assert lens.solid_angles(300).sum() == pytest.approx(np.pi, rel=1e-4)  # 2π(1 − cos 60°)
    assert np.isnan(lens.image_points(X)).all()
    with pytest.raises(ValueError, match="a fisheye of 400°; expected more than 0 and up to 360"):
        Fisheye(np.radians(400))
    with pytest.raises(ValueError, match="not a fisheye; write fisheye:equidistant:DEGREES"):
        mapping_named("fisheye:stereographic:180")
    assert mapping_named("fisheye") == Fisheye() == mapping_named("fisheye:equidistant:180")
    assert mapping_named(Fisheye(1.7).name) == Fisheye(1.7)
    assert mapping_named("fisheye:equisolid") == Fisheye(equisolid=True)
    assert mapping_named("fisheye:160") == Fisheye(np.radians(160)) == mapping_named("fisheye:equidistant:160")


def test_hemispheres_are_printed_as_the_paper_says():
    # Miller & Hoffman 1984, §4.2: u = x, v = y in both, so +X is to the right in the back half too.
    pair = Hemispheres()
    np.testing.assert_allclose(pair.image_points(normalised([0.6, 0, -0.8])), (0.4, 0.5), atol=1e-15)
    np.testing.assert_allclose(pair.image_points(normalised([0.6, 0, 0.8])), (0.9, 0.5), atol=1e-15)
    np.testing.assert_allclose(pair.image_points(Y - 1e-9 * Z), (0.25, 0.0), atol=1e-9)
