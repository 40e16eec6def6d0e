"""Materials refuse what cannot be, and say what fills the bodies behind them."""

from dataclasses import replace

import numpy as np
import pytest

from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.media import Medium
from relume.scene.materials.presets import PRESETS, material_preset

GLASS = Material(roughness=0.0, transmission=1.0)


def test_a_materials_defaults_are_those_of_gltf_for_a_dielectric():
    material = Material()
    assert (material.base_color, material.roughness, material.transmission, material.ior) == ((1, 1, 1), 1, 0, 1.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"base_color": (0.2, 1.5, 0)}, "base_color of material 'tin' is .*expected 0 to 1"),
        ({"metallic": -0.1}, "metallic of material 'tin' is .*expected 0 to 1"),
        ({"roughness": np.full((2, 2), 1.2)}, "roughness of material 'tin' is .*expected 0 to 1"),
        ({"roughness": float("nan")}, "roughness of material 'tin' is nan"),
        ({"transmission": 2.0}, "transmission of material 'tin' is .*expected 0 to 1"),
        ({"base_color": np.arange(12, dtype=np.float32).reshape(2, 2, 3) % 4}, "is an image from 0 to 3; expected"),
        ({"ior": 0.9}, r"ior of material 'tin' is 0\.9; expected 1 or more"),
        ({"clearcoat": 1.5}, "clearcoat of material 'tin' is 1.5; expected 0 to 1"),
        ({"emission": (0, -1, 0)}, r"emission of material 'tin' is \[0, -1, 0\]; expected 0 or more"),
        ({"emission": 2.0}, r"emission of material 'tin' has the shape \(\); expected three numbers"),
        ({"clearcoat": np.zeros((2, 2, 3))}, r"clearcoat of material 'tin' has the shape \(2, 2, 3\)"),
        ({"normal": np.zeros((4, 4))}, r"normal of material 'tin' has the shape \(4, 4\)"),
        ({"attenuation_distance": 0.0}, "attenuation_distance of material 'tin' is 0.0; expected"),
        ({"scattering_anisotropy": 1.0}, "scattering_anisotropy of material 'tin' is 1.0"),
        ({"scattering_distance": (1, 1, 0), "transmission": 1.0}, "expected three lengths above 0"),
        ({"scattering_distance": (1, 1, 1)}, "'tin' scatters inside but lets no light in"),
        ({"anisotropy_rotation": np.nan}, "anisotropy_rotation of material 'tin' is nan"),
    ],
)
def test_a_number_that_cannot_be_is_refused(changes, message):
    with pytest.raises(ValueError, match=message) as caught:
        Material(**changes, name="tin")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"alpha_x": 0.0}, "alpha_x of material 'brass' is 0.0"),
        ({"diffuse": (0.5, 0.5, 0.8)}, "reflectance and diffuse of material 'brass' add up to 1.1; expected 1 at most"),
    ],
)
def test_a_ward_surface_that_cannot_be_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        replace(Ward((0.3, 0.3, 0.3), 0.1, 0.2, name="brass"), **changes)


@pytest.mark.parametrize("reflectance", [(0.5, 0.5), (0.5, 0.5, 1.01), (-0.1, 0, 0)])
def test_a_reflectance_that_would_make_light_is_refused(reflectance):
    with pytest.raises(ValueError, match="expected three numbers from 0 to 1"):
        Diffuse(reflectance)


def test_light_dims_inside_as_the_attenuation_says():
    medium = replace(GLASS, attenuation_color=(0.25, 0.5, 1.0), attenuation_distance=0.02).medium
    assert medium is not None
    # −ln(0.25)/0.02 and −ln(0.5)/0.02 per metre.
    np.testing.assert_allclose(medium.absorption, (69.314718, 34.657359, 0), atol=1e-6)
    np.testing.assert_allclose(np.exp(-0.04 * np.array(medium.extinction)), (0.0625, 0.25, 1))
    assert medium.scattering == (0, 0, 0)


def test_a_body_scatters_by_its_mean_free_path_and_albedo():
    material = replace(GLASS, scattering_distance=(0.001, 0.002, 0.004), scattering_albedo=(1.0, 0.5, 0.25))
    medium = material.medium
    assert medium is not None
    np.testing.assert_allclose(medium.scattering, (1000, 250, 62.5))
    np.testing.assert_allclose(medium.absorption, (0, 250, 187.5))
    np.testing.assert_allclose(medium.albedo, (1, 0.5, 0.25))


@pytest.mark.parametrize(
    "material", [GLASS, replace(GLASS, thin=True, attenuation_color=(0, 0, 0), attenuation_distance=1.0),
                 Material(attenuation_color=(0.1, 0.1, 0.1), attenuation_distance=1.0)],
    ids=["clear", "a sheet", "opaque"],
)  # fmt: skip
def test_what_holds_nothing_has_no_medium(material):
    assert material.medium is None


def test_a_black_attenuation_is_black_and_not_infinite():
    medium = replace(GLASS, attenuation_color=(0, 0, 0), attenuation_distance=0.01).medium
    assert medium is not None
    np.testing.assert_allclose(medium.absorption, 2000)


def half_space(albedo):
    """The share of even light that an evenly scattering half-space returns, by Chandrasekhar's H function (1950)."""
    points, weights = np.polynomial.legendre.leggauss(64)
    cosines, weights = 0.5 * (points + 1), 0.5 * weights
    root = np.sqrt(1 - albedo)
    h = np.ones(64)
    for _ in range(2000):
        h = 1 / (root + 0.5 * albedo * (weights * cosines * h / (cosines[:, None] + cosines)).sum(axis=1))
    return 1 - 2 * root * np.sum(weights * cosines * h)


@pytest.mark.parametrize("albedo", [0.0, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999])
def test_the_diffuse_albedo_of_a_half_space_is_about_the_exact_one(albedo):
    found = Medium((1 - albedo,) * 3, (albedo,) * 3).diffuse_reflectance()
    np.testing.assert_allclose(found, half_space(albedo), atol=0.0025)


@pytest.mark.parametrize("values", [(-1.0, 0, 0), (np.inf, 0, 0), (0, 0)])
def test_a_medium_that_cannot_be_is_refused(values):
    with pytest.raises(ValueError, match="absorption of the medium is"):
        Medium(values)


def test_what_goes_through_is_the_dielectric_share_at_the_larger_picture():
    material = Material(transmission=np.full((2, 2), 0.5, np.float32), metallic=np.eye(4, dtype=np.float32))
    np.testing.assert_array_equal(material.through, 0.5 * (1 - np.eye(4)))


def test_presets_are_known_by_their_names():
    assert all(each.name == name for name, each in PRESETS.items())
    gold, steel = material_preset("gold"), material_preset("brushed_steel")
    assert isinstance(gold, Material) and isinstance(steel, Ward)
    # Johnson and Christy's n and k under D65.
    np.testing.assert_allclose(gold.base_color, (1, 0.72822, 0.36468), atol=1e-5)
    with pytest.raises(ValueError, match=r"no preset 'glod'; the presets are aluminium, .*gold"):
        material_preset("glod")


def test_marble_is_as_jensen_measured_it():
    marble = material_preset("marble")
    assert isinstance(marble, Material) and marble.medium is not None
    np.testing.assert_allclose(marble.medium.scattering, (2190, 2620, 3000))
    np.testing.assert_allclose(marble.medium.absorption, (2.1, 4.1, 7.1), rtol=1e-9)
