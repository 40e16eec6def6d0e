"""Nine harmonics of a light: known integrals, the frame, and a document that is enough by itself."""

import json

import numpy as np
import pytest

from lights import SIMPLE, of_directions, spread
from relume.light.harmonics.spherical_harmonics import SphericalHarmonics, project_sh, sh_basis
from relume.light.reflection.irradiance_harmonics import as_json
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

X, Y, Z = np.eye(3)


def directional(row, column, size=64):
    """Light of one pixel that gives E = 1 on a surface facing it, and the direction to it."""
    radiance = np.zeros((size, 2 * size, 3), np.float32)
    radiance[row, column] = 1 / LatLong().solid_angles(size)[row, column]
    return EnvironmentMap(radiance), LatLong().directions(np.array([(column + 0.5) / (2 * size), (row + 0.5) / size]))


def test_the_basis_is_the_literal_polynomials_of_x_y_z():
    x, y, z = normalised([0.3, -0.5, 0.7])
    expected = [0.282095, 0.488603 * y, 0.488603 * z, 0.488603 * x, 1.092548 * x * y, 1.092548 * y * z]
    expected += [0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y)]
    assert sh_basis(np.array([x, y, z]), 2) == pytest.approx(expected, abs=1e-6)


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


def test_a_directional_light_is_blurred_by_nine_harmonics():
    for row, column in ((31, 64), (10, 3), (50, 100)):
        light, towards = directional(row, column)
        side = normalised(np.cross(towards, spread(1, row)[0]))
        found = project_sh(light)
        assert found.coefficients[:, 2] == pytest.approx(sh_basis(towards, 2), rel=1e-6)
        assert found.irradiance(towards) == pytest.approx(1.0625, rel=1e-6)
        assert found.irradiance(side) == pytest.approx(0.09375, rel=1e-5)


def test_light_without_finer_detail_is_lit_exactly():
    random = np.random.default_rng(2).normal(size=(3, 3))
    light = of_directions(lambda d: 8 + d @ random[0] + (d @ random[1]) * (d @ random[2]), 256)
    assert project_sh(light).irradiance(spread(10)) == pytest.approx(light.irradiance(spread(10)), rel=1e-4)


def test_colours_stay_apart():
    light, _ = directional(20, 20)
    tinted = project_sh(EnvironmentMap(light.radiance * np.array([1, 2, 4], np.float32))).coefficients
    assert tinted[:, 2] == pytest.approx(4 * tinted[:, 0])


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


def test_a_wrong_call_is_told():
    with pytest.raises(ValueError, match="harmonics of degree 1; expected 2, nine coefficients"):
        as_json(SphericalHarmonics(np.zeros((4, 3))))
    with pytest.raises(ValueError, match="unit is"):
        as_json(SphericalHarmonics(np.zeros((9, 3)), "nits"))
