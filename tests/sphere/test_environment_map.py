"""Light by direction: totals, irradiance, look-ups, and what remapping and turning must keep."""

import numpy as np
import pytest

import naive
from angles import degrees_between
from lights import NAMED, SIMPLE, fitting, of_directions, spread
from relume.image.radiance import RadianceMap
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_files import as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular, Fisheye, MirrorBall
from relume.sphere.mappings.mapping import LatLong, pixel_directions, pixel_points

EVERY = pytest.mark.parametrize("mapping", SIMPLE, ids=[m.name for m in SIMPLE])
X, Y, Z = np.eye(3)


def constant(mapping, size, value=(1.0, 2.0, 0.5)):
    flat = np.broadcast_to(np.float32(value), (*mapping.shape(size), 3))
    return EnvironmentMap(flat.copy(), mapping)


def noise(mapping, size, seed=3):
    random = np.random.default_rng(seed).random((*mapping.shape(size), 3))
    return EnvironmentMap(random.astype(np.float32), mapping)


def lone(size, row, column, value=(8.0, 4.0, 2.0), mapping=LatLong()):
    radiance = np.zeros((*mapping.shape(size), 3), np.float32)
    radiance[row, column] = value
    return EnvironmentMap(radiance, mapping)


def shows(mapping, size):
    """Where the middle of a pixel shows a direction: (rows, columns) bool."""
    return ~np.isnan(mapping.directions(pixel_points(mapping, size))[..., 0])


def first_moment(light):
    """∫ L ω dω, green, with the mean direction of each pixel taken over 8 × 8 cells of it."""
    mapping, size, cells = light.mapping, light.size, 8
    directions = np.nan_to_num(mapping.directions(pixel_points(mapping, size, cells)))
    weighted = directions * mapping.solid_angles(size * cells)[..., None]
    moments = weighted.reshape(size, cells, mapping.shape(size)[1], cells, 3).sum((1, 3))
    return np.einsum("hwk,hw->k", moments, light.radiance[..., 1].astype(np.float64))


# --- what light adds up to -------------------------------------------------------------------------------------------


@EVERY
def test_constant_light_totals_four_pi_times_its_radiance(mapping):
    np.testing.assert_allclose(constant(mapping, 64).total(), 4 * np.pi * np.array([1, 2, 0.5]), rtol=2e-5)


@EVERY
def test_constant_light_gives_irradiance_pi_times_radiance(mapping):
    # A1. Pixel centres stand for pixels: 1e-4 at 512 rows of a lat-long (G8). A rim pixel of a disc is wide and
    # radial; its centre may be a degree or two off its middle.
    allowed = 1e-4 if isinstance(mapping, LatLong) else 2e-3
    size = 512 if isinstance(mapping, LatLong) else 256
    normals = np.concatenate([np.eye(3), -np.eye(3), spread(4)])
    irradiance = constant(mapping, size).irradiance(normals)
    np.testing.assert_allclose(irradiance, np.pi * np.broadcast_to([1, 2, 0.5], irradiance.shape), rtol=allowed)


@pytest.mark.parametrize(
    ("degrees", "expected"), [(0, 3.141593), (60, 2.356194), (90, 1.570796), (120, 0.785398), (180, 0)]
)
@pytest.mark.parametrize(("axis", "turn"), [(X, Z), (Y, X), (-Z, Y)], ids=["from +X", "from +Y", "from -Z"])
def test_half_lit_surroundings_give_half_pi_times_one_plus_cosine(axis, turn, degrees, expected):
    # A2: these axes divide the map between pixels, so each pixel is wholly lit or wholly dark.
    light = of_directions(lambda d: (d @ axis > 0).astype(float), 256)
    normal = rotation_about(turn, np.radians(degrees)) @ axis
    assert light.irradiance(normal)[1] == pytest.approx(expected, abs=1e-4 * np.pi)


@pytest.mark.parametrize(
    ("normal", "expected"), [(Y, 5.235988), (X, np.pi), (-Z, np.pi), (-Y, 1.047198)], ids=["up", "+X", "-Z", "down"]
)
def test_light_that_brightens_upwards_gives_pi_plus_two_thirds_pi_times_height(normal, expected):
    light = of_directions(lambda d: 1 + d[..., 1], 256)  # A3
    assert light.irradiance(normal)[1] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("degree", "factor"), [(2, np.pi / 4), (3, 0), (4, -0.130900), (6, 0.049087), (8, -0.024544)])
def test_irradiance_damps_harmonics_by_the_cosine_factors(degree, factor):
    legendre = np.polynomial.Legendre.basis(degree)
    light = of_directions(lambda d: 1 + legendre(d[..., 1]), size=512)  # A4, on top of π so that light is not negative
    for normal in (Y, -Y, X, normalised([1, 1, 1])):
        assert light.irradiance(normal)[0] == pytest.approx(np.pi + factor * legendre(normal[1]), abs=1e-4 * np.pi)


def test_irradiance_keeps_the_shape_of_its_normals():
    light = constant(LatLong(), 8)
    assert light.irradiance(Y).shape == (3,)
    assert light.irradiance(np.broadcast_to(Y, (2, 5, 3))).shape == (2, 5, 3)


# --- looking up ------------------------------------------------------------------------------------------------------


@EVERY
def test_looking_up_a_pixels_centre_gives_the_pixel(mapping):
    y, x = np.indices(mapping.shape(9))
    numbered = np.stack([x + 1000 * y, x, y], axis=-1).astype(np.float32)
    light = EnvironmentMap(numbered, mapping)
    directions = mapping.directions(pixel_points(mapping, 9))
    shown = ~np.isnan(directions[..., 0])
    np.testing.assert_allclose(light.lookup(directions[shown]), numbered[shown], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", NAMED)
def test_constant_light_is_constant_wherever_it_is_looked_up(name):
    mapping = NAMED[name]
    light = constant(mapping, fitting(mapping, 48))
    # What other programs leave beside a disc or a cross is no light.
    garbage = np.where(mapping.solid_angles(light.size)[..., None] > 0, light.radiance, np.float32(99))
    found = EnvironmentMap(garbage, mapping).lookup(spread(4000, seed=11))
    np.testing.assert_allclose(found, np.broadcast_to([1.0, 2.0, 0.5], found.shape), rtol=1e-5)


def test_beyond_its_field_a_fisheye_shows_nothing():
    light = constant(Fisheye(), 32)
    assert light.lookup(Z).tolist() == [0, 0, 0] and light.lookup(-Z).tolist() == [1, 2, 0.5]


def test_what_a_file_reported_stays_with_its_light():
    light = EnvironmentMap(noise(LatLong(), 12).radiance, attributes={"owner": "me"})
    picture = as_radiance_map(light.remapped(Angular(), 12).rotated(rotation_about(X, 1)))
    assert picture.attributes == {"owner": "me", "mapping": "angular"}


@pytest.mark.parametrize("matrix", [2 * np.eye(3), np.diag([-1, 1, 1]), np.eye(2), [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]])
def test_a_matrix_that_is_no_rotation_is_refused(matrix):
    with pytest.raises(ValueError, match=r"expected an? (orthonormal|rotation)"):
        noise(LatLong(), 8).rotated(matrix)


@EVERY
@pytest.mark.parametrize("size", [4, 7])
def test_look_up_equals_its_slow_twin(mapping, size):
    light = noise(mapping, size)
    directions = np.concatenate([spread(300, seed=5), np.eye(3), -np.eye(3)])
    # Near the poles and the seam, where taps leave the image.
    edges = normalised(
        np.concatenate([spread(40) * [0.05, 0, 0.05] + [0, 1, 0], spread(40) * [0.05, 1, 0] + [0, 0, 1]])
    )
    directions = np.concatenate([directions, edges, -edges])
    slow = np.array([naive.lookup(light.radiance.astype(float), mapping.name, d) for d in directions])
    np.testing.assert_allclose(light.lookup(directions), slow, atol=1e-6)


def test_look_up_goes_on_over_the_seam():
    light = noise(LatLong(), 8)
    heights = np.linspace(-0.9, 0.9, 21)
    left, right = (normalised(np.stack([np.full(21, s * 1e-9), heights, np.ones(21)], -1)) for s in (-1, 1))
    np.testing.assert_allclose(light.lookup(left), light.lookup(right), atol=1e-6)


@pytest.mark.parametrize("pole", [1.0, -1.0], ids=["+Y", "-Y"])
def test_look_up_goes_on_over_the_poles(pole):
    light = noise(LatLong(), 8)
    longitudes = np.linspace(0, np.pi, 13)
    step = 1e-9 * np.stack([np.sin(longitudes), np.zeros(13), np.cos(longitudes)], -1)
    before, after = (light.lookup(normalised(s * step + [0, pole, 0])) for s in (-1, 1))
    np.testing.assert_allclose(before, after, atol=1e-6)


def test_a_great_circle_over_both_poles_and_the_seam_meets_no_jump():
    light = noise(LatLong(), 8)
    angle = np.linspace(0, 2 * np.pi, 20_001)
    circle = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], -1) @ rotation_about(Y, 0.3).T
    # Radiance below 1 changes by at most 2 a pixel, and a pixel is π/8 wide: 2·8/π a radian.
    assert np.abs(np.diff(light.lookup(circle), axis=0)).max() < 2 * 8 / np.pi * (angle[1] - angle[0]) * 1.01


# --- moving light ----------------------------------------------------------------------------------------------------

PAIRS = [(a, b) for a in SIMPLE for b in SIMPLE]
PLACES = {
    "inside": (9, 37),
    "left of the seam": (12, 63),
    "right of the seam": (20, 0),
    "ahead": (15, 31),
    "at +Y": (0, 11),
    "at -Y": (31, 50),
}
ROTATIONS = {
    "a quarter turn about up": rotation_about(Y, np.pi / 2),
    "over the pole": rotation_about(X, np.pi / 2),
    "askew": rotation_about([1, 2, -0.5], 2.2),
}


KEPT = 2e-6
"""A total is kept to float32's rounding. A pixel missed at the seam would lose a half of a lone one."""


@pytest.mark.parametrize(("source", "target"), PAIRS, ids=[f"{a.name} to {b.name}" for a, b in PAIRS])
@pytest.mark.parametrize("size", [24, 33, 50])
def test_remapping_keeps_total_radiance(source, target, size):
    light = noise(source, 33)
    np.testing.assert_allclose(light.remapped(target, size).total(), light.total(), rtol=KEPT)


@pytest.mark.parametrize(("source", "target"), PAIRS, ids=[f"{a.name} to {b.name}" for a, b in PAIRS])
def test_remapping_loses_no_lone_light(source, target):
    solid_angles = source.solid_angles(24)
    whole = np.argwhere(solid_angles > 0.5 * np.median(solid_angles[solid_angles > 0]))
    for row, column in whole[:: len(whole) // 12]:
        light = lone(24, row, column, mapping=source)
        moved = light.remapped(target, 24)
        np.testing.assert_allclose(moved.total(), light.total(), rtol=KEPT)


@EVERY
@pytest.mark.parametrize("rotation", ROTATIONS.values(), ids=ROTATIONS.keys())
def test_turning_keeps_total_radiance(mapping, rotation):
    light = noise(mapping, 32)
    np.testing.assert_allclose(light.rotated(rotation).total(), light.total(), rtol=KEPT)


@EVERY
def test_constant_light_stays_constant_when_turned(mapping):
    turned = constant(mapping, 20).rotated(ROTATIONS["askew"])
    shown = shows(mapping, 20)
    np.testing.assert_allclose(turned.radiance[shown], np.broadcast_to([1, 2, 0.5], (shown.sum(), 3)), rtol=1e-6)


@EVERY
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
def test_a_lone_bright_pixel_stays_where_its_direction_points_when_remapped(mapping, place):
    light = lone(32, *place)
    moved = light.remapped(mapping, 64)
    # Half a pixel of the source: bilinear cells reach a pixel out, alike on both sides, but balancing tilts them.
    # A ball shows −Z at its rim, where the outermost of 64 pixels spans 2 acos(1 − 2/64) = 28.7°: half of that.
    at_the_rim = isinstance(mapping, MirrorBall) and place == PLACES["ahead"]
    allowed = 14.4 if at_the_rim else 0.5 * 180 / 32
    assert degrees_between(first_moment(moved), first_moment(light)) < allowed
    np.testing.assert_allclose(moved.total(), light.total(), rtol=KEPT)


@pytest.mark.parametrize("rotation", ROTATIONS.values(), ids=ROTATIONS.keys())
@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES.keys())
def test_a_lone_bright_pixel_goes_where_the_rotation_takes_it(rotation, place):
    light = lone(32, *place)
    turned = light.rotated(rotation)
    assert degrees_between(first_moment(turned), rotation @ first_moment(light)) < 0.5 * 180 / 32
    np.testing.assert_allclose(turned.total(), light.total(), rtol=KEPT)


def test_turning_by_half_a_pixel_is_the_same_at_the_seam_as_elsewhere():
    light = noise(LatLong(), 8)
    turn = rotation_about(Y, np.pi / 16)
    rolled = EnvironmentMap(np.roll(light.radiance, 5, axis=1))
    np.testing.assert_allclose(rolled.rotated(turn).radiance, np.roll(light.rotated(turn).radiance, 5, 1), atol=1e-5)


def test_turning_about_up_by_whole_pixels_moves_the_map_to_the_left():
    # Right-handed about +Y takes −Z (the middle) to −X (the left).
    light = lone(16, 8, 16)
    turned = light.rotated(rotation_about(Y, np.pi / 2))
    assert np.unravel_index(turned.radiance[..., 0].argmax(), (16, 32)) == (8, 8)


def test_turning_there_and_back_puts_smooth_light_where_it_was():
    light = of_directions(lambda d: 2 + d @ np.array([0.5, 0.7, -0.3]), size=64)
    back = light.rotated(ROTATIONS["askew"]).rotated(ROTATIONS["askew"].T)
    np.testing.assert_allclose(back.radiance, light.radiance, rtol=0.01)


def test_remapping_keeps_unit_and_takes_the_size_asked_for():
    light = EnvironmentMap(np.ones((8, 16, 3), np.float32), unit="cd/m²")
    moved = light.remapped(Angular(), 12)
    assert (moved.unit, moved.mapping, moved.radiance.shape) == ("cd/m²", Angular(), (12, 12, 3))
    assert light.remapped(LatLong()).size == 8
    assert light.remapped(MirrorBall()).size == 13  # at least as many pixels, 128, within the disc
    assert light.rotated(np.eye(3)).unit == "cd/m²"


# --- pictures and light ----------------------------------------------------------------------------------------------


@EVERY
def test_light_written_as_a_picture_is_read_back_as_the_same_light(mapping):
    light = EnvironmentMap(noise(mapping, 6).radiance, mapping, "cd/m²")
    picture = as_radiance_map(light)
    assert picture.attributes["mapping"] == mapping.name
    back = as_environment(picture)
    assert (back.mapping, back.unit) == (mapping, "cd/m²")
    assert np.array_equal(back.radiance, light.radiance)


def test_a_picture_twice_as_wide_as_high_is_a_lat_long():
    assert as_environment(RadianceMap(np.ones((3, 6, 3), np.float32))).mapping == LatLong()


@pytest.mark.parametrize(("height", "width"), [(6, 6), (4, 9)])
def test_a_picture_of_another_shape_does_not_say_its_mapping(height, width):
    with pytest.raises(ValueError, match=f"{width}×{height} pixels does not say its mapping"):
        as_environment(RadianceMap(np.ones((height, width, 3), np.float32)))


@pytest.mark.parametrize(
    ("shape", "mapping", "message"),
    [
        ((4, 4, 3), LatLong(), r"\(4, 4, 3\).*\(4, 8, 3\)"),
        ((4, 8, 3), Angular(), r"\(4, 8, 3\).*\(4, 4, 3\)"),
        ((4, 8), LatLong(), r"\(4, 8\).*\(4, 8, 3\)"),
        ((4, 8, 4), LatLong(), r"\(4, 8, 4\).*\(4, 8, 3\)"),
    ],
)
def test_a_map_of_the_wrong_shape_is_refused_with_the_shape_expected(shape, mapping, message):
    with pytest.raises(ValueError, match=message):
        EnvironmentMap(np.ones(shape, np.float32), mapping)


@pytest.mark.parametrize("value", [-1e-3, np.nan, np.inf])
def test_light_that_is_negative_or_not_finite_is_refused(value):
    radiance = np.ones((4, 8, 3), np.float32)
    radiance[1, 2, 0] = value
    with pytest.raises(ValueError, match="negative or non-finite"):
        EnvironmentMap(radiance)


@pytest.mark.parametrize("mapping", [LatLong(), MirrorBall()])
def test_sums_over_bands_of_rows_are_those_over_all(mapping, monkeypatch: pytest.MonkeyPatch):
    radiance = np.random.default_rng(5).random((*mapping.shape(50), 3)).astype(np.float32)
    light, normals = EnvironmentMap(radiance, mapping), normalised([[0.0, 1, 0], [1, -1, 2]])
    whole = light.total(), light.irradiance(normals)
    monkeypatch.setattr("relume.sphere.environment_map._BAND", 7 * radiance.shape[1])
    assert light.total() == pytest.approx(whole[0], rel=1e-13)
    assert light.irradiance(normals) == pytest.approx(whole[1], rel=1e-13)
    assert pixel_directions(mapping, 50, slice(7, 14)).tobytes() == pixel_directions(mapping, 50)[7:14].tobytes()
