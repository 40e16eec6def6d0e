"""Real spherical harmonics: their polynomials, their products, their turns, and light that goes through them."""

import json

import numpy as np
import pytest
from scipy.special import sph_harm_y

from lights import SIMPLE, of_directions, spread
from relume.light.harmonics.spherical_harmonics import (
    Hann,
    Lanczos,
    SphericalHarmonics,
    cosine_factors,
    project_sh,
    sh_basis,
)
from relume.light.harmonics.transform import euler_angles, wigner
from relume.light.reflection.storage import as_json
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from relume.sphere.mappings.names import mapping_named

X, Y, Z = np.eye(3)
ROTATIONS = {
    "none": np.eye(3),
    "a quarter about X": rotation_about(X, np.pi / 2),
    "half about X": rotation_about(X, np.pi),
    "half about Y": rotation_about(Y, np.pi),
    "about Z alone": rotation_about(Z, 2.5),
    "a hair about Y": rotation_about(Y, 1e-9),
    "any": rotation_about([1, -2, 3], 2.2),
}


def random_harmonics(degree, seed=1):
    return SphericalHarmonics(np.random.default_rng(seed).normal(size=((degree + 1) ** 2, 3)))


def spiky(mapping, size, seed=4):
    random = np.random.default_rng(seed).random((*mapping.shape(size), 3))
    return EnvironmentMap((random**6).astype(np.float32), mapping)


def gauss(degree):
    """Directions and weights that integrate harmonics up to that degree exactly."""
    nodes, weights = np.polynomial.legendre.leggauss(degree // 2 + 1)
    azimuths = 2 * np.pi * np.arange(degree + 1) / (degree + 1)
    ring = np.sqrt(1 - nodes**2)[:, None]
    parts = (
        ring * np.cos(azimuths),
        ring * np.sin(azimuths),
        np.broadcast_to(nodes[:, None], (len(nodes), degree + 1)),
    )
    return np.stack(parts, axis=-1).reshape(-1, 3), np.repeat(weights * 2 * np.pi / (degree + 1), degree + 1)


# The functions


def test_harmonics_of_degrees_three_and_four_are_the_printed_polynomials():
    x, y, z = normalised([0.3, -0.5, 0.7])
    values = sh_basis(np.array([x, y, z]), 4)
    assert values.shape == (25,)
    expected = {
        9: 0.590043589926644 * y * (3 * x * x - y * y),
        10: 2.890611442640554 * x * y * z,
        11: 0.457045799464466 * y * (5 * z * z - 1),
        12: 0.373176332590115 * z * (5 * z * z - 3),
        13: 0.457045799464466 * x * (5 * z * z - 1),
        14: 1.445305721320277 * z * (x * x - y * y),
        15: 0.590043589926644 * x * (x * x - 3 * y * y),
        16: 2.503342941796705 * x * y * (x * x - y * y),
        20: 0.105785546915204 * (35 * z**4 - 30 * z * z + 3),
        24: 0.625835735449176 * (x * x * (x * x - 3 * y * y) - y * y * (3 * x * x - y * y)),
    }
    for row, value in expected.items():
        assert values[row] == pytest.approx(value, abs=1e-14), row


def test_the_basis_is_the_literal_polynomials_of_x_y_z():
    x, y, z = normalised([0.3, -0.5, 0.7])
    expected = [0.282095, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z]
    expected += [0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y)]
    assert sh_basis(np.array([x, y, z]), 2) == pytest.approx(expected, abs=1e-6)


def test_harmonics_are_scipys_without_their_sign():
    directions = spread(40)
    polar, azimuth = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])
    values = sh_basis(directions, 40)
    for l in (1, 7, 40):  # noqa: E741
        assert values[:, l * l + l] == pytest.approx(sph_harm_y(l, 0, polar, azimuth).real, abs=1e-12)
        for m in range(1, l + 1):
            theirs = np.sqrt(2) * (-1.0) ** m * sph_harm_y(l, m, polar, azimuth)
            assert values[:, l * l + l + m] == pytest.approx(theirs.real, abs=1e-12), (l, m)
            assert values[:, l * l + l - m] == pytest.approx(theirs.imag, abs=1e-12), (l, m)


def test_harmonics_are_orthonormal():
    directions, weights = gauss(60)
    values = sh_basis(directions, 30)
    assert np.abs(values.T @ (values * weights[:, None]) - np.eye(31**2)).max() < 1e-12


@pytest.mark.parametrize("degree", [100, 400])
def test_squares_of_one_degree_sum_to_the_same_everywhere_also_near_the_poles(degree):
    near = normalised(Z + 1e-5 * spread(3))
    values = sh_basis(np.concatenate([spread(20), near, [Z, -Z, X]]), degree)
    sums = np.add.reduceat(values**2, np.arange(degree + 1) ** 2, axis=1)
    np.testing.assert_allclose(
        sums, np.tile((2 * np.arange(degree + 1) + 1) / (4 * np.pi), (len(values), 1)), rtol=1e-10
    )


def test_the_cosines_factors_are_the_printed_ones():
    expected = np.array([1, 2 / 3, 1 / 4, 0, -1 / 24, 0, 1 / 64, 0, -1 / 128]) * np.pi
    assert cosine_factors(8) == pytest.approx(expected, abs=1e-15)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    half, legendre = (nodes + 1) / 2, np.polynomial.legendre.legval
    for l in (10, 51, 100):  # noqa: E741
        integral = np.pi * (weights * half * legendre(half, np.eye(l + 1)[l])).sum()
        assert cosine_factors(100)[l] == pytest.approx(integral, abs=1e-13)


# Turning


@pytest.mark.parametrize("rotation", ROTATIONS.values(), ids=ROTATIONS.keys())
def test_turned_light_comes_from_turned_directions(rotation):
    light, directions = random_harmonics(50), spread(200)
    turned = light.rotated(rotation)
    assert np.abs(turned.evaluate(directions @ rotation.T) - light.evaluate(directions)).max() < 1e-10
    assert turned.power() == pytest.approx(light.power(), rel=1e-12)


def test_degree_one_turns_as_a_vector():
    # Rows 1, 2, 3 are y, z, x.
    light = SphericalHarmonics(np.array([[0, 0, 0], [2, 0, 0], [3, 0, 0], [1, 0, 0]], np.float64))
    rotation = ROTATIONS["any"]
    y, z, x = light.rotated(rotation).coefficients[1:, 0]
    assert np.array([x, y, z]) == pytest.approx(rotation @ [1, 2, 3], abs=1e-14)


@pytest.mark.parametrize("beta", [0.0, 0.4, 2.9, np.pi])
def test_wigners_matrices_are_rows_of_his_functions(beta):
    orders = np.arange(-9, 10)
    for l, matrix in enumerate(wigner(np.arange(10), orders, beta, 9)):  # noqa: E741
        slow = [list(wigner(np.arange(10), int(k), np.array([beta]), l))[l][:, 0] for k in orders]
        assert matrix.T == pytest.approx(np.array(slow), abs=1e-13), l


def test_eulers_angles_make_the_rotation_again():
    for rotation in ROTATIONS.values():
        alpha, beta, gamma = euler_angles(rotation)
        again = rotation_about(Z, alpha) @ rotation_about(Y, beta) @ rotation_about(Z, gamma)
        assert again == pytest.approx(rotation, abs=1e-15)


def test_a_mirror_is_no_rotation():
    with pytest.raises(ValueError, match="mirrors"):
        random_harmonics(2).rotated(np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(ValueError, match="orthonormal"):
        random_harmonics(2).rotated(2 * np.eye(3))


# Light


@pytest.mark.parametrize("size", [1, 5, 24])
def test_lat_long_light_is_summed_by_transforms_as_one_by_one(size):
    light = spiky(LatLong(), size)
    flux = light.radiance * LatLong().solid_angles(size)[..., None]
    slow = np.einsum("hwk,hwc->kc", sh_basis(pixel_directions(LatLong(), size), 20), flux)
    assert np.abs(project_sh(light, 20).coefficients - slow).max() < 1e-12 * flux.sum()


@pytest.mark.parametrize("name", ["angular", "ball", "cross", "octahedral", "fisheye:equidistant:180"])
def test_light_in_other_mappings_is_the_sum_over_its_pixels(name):
    mapping = mapping_named(name)
    light = spiky(mapping, 48)
    flux = light.radiance * mapping.solid_angles(48)[..., None]
    slow = np.einsum("hwk,hwc->kc", sh_basis(pixel_directions(mapping, 48), 9), flux)
    assert np.abs(project_sh(light, 9).coefficients - slow).max() < 1e-12 * flux.sum()


@pytest.mark.parametrize("name", ["latlong", "angular", "ball", "octahedral", "equalarea", "hemispheres"])
def test_one_light_has_the_same_harmonics_in_every_mapping(name):
    mapping, light = mapping_named(name), random_harmonics(4).coefficients
    light[0] = 40
    found = project_sh(SphericalHarmonics(light).as_map(512, mapping), 4)
    assert np.abs(found.coefficients - light).max() < 5e-4 * 40


def test_smooth_light_comes_back_from_a_map():
    light = random_harmonics(4)
    light.coefficients[0] = 60
    found = project_sh(light.as_map(1024), 8).coefficients
    assert np.abs(found[:25] - light.coefficients).max() < 1e-6 * 60
    # Nothing is there that was not put in: degrees 5 to 8 hold the error of the pixels' middles alone.
    assert np.abs(found[25:]).max() < 2e-6 * 60


def test_the_error_of_pixels_middles_falls_with_the_square_of_the_rows():
    light = random_harmonics(6)
    light.coefficients[0] = 80
    errors = [
        np.abs(project_sh(light.as_map(rows), 6).coefficients - light.coefficients).max() for rows in (32, 64, 128)
    ]
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx([4, 4], rel=0.1)


@pytest.mark.parametrize("name", ["latlong", "cross", "ball"])
def test_a_map_holds_the_harmonics_at_the_middles_of_its_pixels(name):
    mapping, light = mapping_named(name), random_harmonics(7)
    light.coefficients[0] = 200
    seen = mapping.solid_angles(24) > 0
    expected = light.evaluate(pixel_directions(mapping, 24))
    np.testing.assert_allclose(light.as_map(24, mapping).radiance[seen], expected[seen], rtol=1e-6)
    assert not light.as_map(24, mapping).radiance[~seen].any()


def test_constant_light_has_one_coefficient_and_gives_pi():
    light = project_sh(EnvironmentMap(np.full((64, 128, 3), 2.0, np.float32), unit="cd/m²"), 10)
    assert light.unit == "cd/m²"
    assert light.coefficients[0] == pytest.approx(2 * np.sqrt(4 * np.pi), rel=1e-12)
    assert np.abs(light.coefficients[1:]).max() < 3e-3
    assert SphericalHarmonics(light.coefficients[:1]).irradiance(spread(5)) == pytest.approx(
        np.full((5, 3), 2 * np.pi), rel=1e-12
    )


@pytest.mark.parametrize("mapping", SIMPLE, ids=[m.name for m in SIMPLE])
def test_constant_light_gives_pi(mapping):
    found = project_sh(of_directions(lambda d: np.ones(d.shape[:-1]), 256, mapping))
    assert found.coefficients.shape == (9, 3)
    assert found.coefficients[0] == pytest.approx(4 * np.pi * 0.282095, rel=1e-5)
    assert found.coefficients[1:] == pytest.approx(0, abs=2e-3)
    assert found.irradiance(spread(20)) == pytest.approx(np.pi, rel=1e-3)


@pytest.mark.parametrize("axis", [X, Y, Z])
def test_light_that_grows_towards_an_axis(axis):
    light = project_sh(of_directions(lambda d: 1 + d @ axis, 256))
    found = light.irradiance(np.stack([axis, np.roll(axis, 1), -axis]))[:, 0]
    assert found == pytest.approx([5.235988, 3.141593, 1.047198], abs=2e-4)


def test_each_harmonic_of_degree_two_is_multiplied_by_a_quarter_of_pi():
    light = project_sh(of_directions(lambda d: 1 + (3 * d[..., 2] ** 2 - 1) / 2, 256))
    found = light.irradiance(np.stack([Z, X]))[:, 1]
    assert found == pytest.approx([np.pi + 0.785398, np.pi - 0.785398 / 2], abs=2e-4)


def test_light_without_finer_detail_is_lit_exactly():
    random = np.random.default_rng(2).normal(size=(3, 3))
    light = of_directions(lambda d: 8 + d @ random[0] + (d @ random[1]) * (d @ random[2]), 256)
    assert project_sh(light).irradiance(spread(10)) == pytest.approx(light.irradiance(spread(10)), rel=1e-4)


def test_irradiance_of_high_degree_is_the_maps():
    light, normals = spiky(LatLong(), 32), spread(50)
    truth = light.irradiance(normals)
    assert project_sh(light, 40).irradiance(normals) == pytest.approx(truth, rel=1e-3)
    assert project_sh(light, 2).irradiance(normals) != pytest.approx(truth, rel=1e-3)


def test_degree_two_errs_by_no_more_than_three_thirty_seconds_of_the_light():
    # 1/4 + cos θ/2 + 5/64 (3 cos 2θ + 1) against max(0, cos θ): furthest apart at 90°.
    normals = spread(100)
    light = spiky(LatLong(), 8)
    error = np.abs(project_sh(light, 2).irradiance(normals) - light.irradiance(normals))
    assert np.all(error <= 3 / 32 * light.total())
    lone = np.zeros((64, 128, 3), np.float32)
    lone[20, 30] = 1 / LatLong().solid_angles(64)[20, 30]
    towards = pixel_directions(LatLong(), 64)[20, 30]
    side = normalised(np.cross(towards, Z))
    harmonics = project_sh(EnvironmentMap(lone * [1, 2, 3]), 2)
    assert harmonics.coefficients == pytest.approx(sh_basis(towards, 2)[:, None] * [1, 2, 3], rel=1e-6)
    found = harmonics.irradiance(np.stack([towards, side, -towards]))[:, 0]
    assert found == pytest.approx([1 + 1 / 16, 3 / 32, 1 / 16], rel=1e-6)


def test_windows_take_away_the_ringing():
    lone = np.zeros((32, 64, 3), np.float32)
    lone[8, 20] = 1000
    harmonics = project_sh(EnvironmentMap(lone), 12)
    values = [each.evaluate(spread(2000)) for each in (harmonics, *map(harmonics.windowed, (Lanczos(), Hann())))]
    # How far below 0 they go, as a share of their peaks.
    plain, lanczos, hann = (-each.min() / each.max() for each in values)
    assert plain > 0.14 and 0.03 < lanczos < 0.05 and hann < 0.03
    assert harmonics.windowed().coefficients[0] == pytest.approx(harmonics.coefficients[0])
    assert harmonics.windowed().coefficients[-1] == pytest.approx(
        harmonics.coefficients[-1] * (1 + np.cos(12 * np.pi / 13)) / 2
    )
    assert harmonics.windowed(Lanczos()).coefficients[1] == pytest.approx(
        harmonics.coefficients[1] * np.sin(np.pi / 13) / (np.pi / 13)
    )


def test_negative_light_is_reported():
    lone = np.zeros((32, 64, 3), np.float32)
    lone[8, 20] = 1000
    with pytest.warns(UserWarning, match=r"degree 6 ring below 0: \d+\.\d% of the light"):
        shown = project_sh(EnvironmentMap(lone), 6).as_map(16)
    assert shown.radiance.min() == 0


def test_a_wrong_call_is_reported():
    light = EnvironmentMap(np.ones((2, 4, 3), np.float32))
    for degree in (-1, 1001):
        with pytest.raises(ValueError, match="expected 0 to 1000"):
            project_sh(light, degree)
        with pytest.raises(ValueError, match="expected 0 to 1000"):
            sh_basis(Z, degree)
    for shape in ((8, 3), (9,), (9, 4), (0, 3)):
        with pytest.raises(ValueError, match=r"expected \(\(L \+ 1\)², 3\)"):
            SphericalHarmonics(np.zeros(shape))


def test_the_document_is_enough_to_light_a_surface():
    random = np.random.default_rng(5).normal(size=(9, 3))
    light = SphericalHarmonics(random, "cd/m²")
    document = json.loads(as_json(light))
    assert document["unit"] == {"radiance": "cd/m² · sr", "irradiance": "lx"}
    assert [(term["l"], term["m"]) for term in document["terms"][:5]] == [(0, 0), (1, -1), (1, 0), (1, 1), (2, -2)]
    assert document["terms"][3]["polynomial"] == "0.48860251 * x"
    for x, y, z in spread(5):
        factors = [eval(term["polynomial"], {"x": x, "y": y, "z": z}) for term in document["terms"]]
        lit = np.array(factors) @ np.array([term["irradiance"] for term in document["terms"]])
        assert lit == pytest.approx(light.irradiance(np.array([x, y, z])), abs=1e-6)
        assert np.array(factors) == pytest.approx(sh_basis(np.array([x, y, z]), 2), abs=1e-7)
    assert np.array([term["radiance"] for term in document["terms"]]) == pytest.approx(random, rel=1e-7)


def test_a_document_of_other_harmonics_is_refused():
    with pytest.raises(ValueError, match="harmonics of degree 1; expected 2, nine coefficients"):
        as_json(SphericalHarmonics(np.zeros((4, 3))))
    with pytest.raises(ValueError, match="unit is"):
        as_json(SphericalHarmonics(np.zeros((9, 3)), "nits"))
