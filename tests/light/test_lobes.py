"""Convolution functions: the paper's values, their integrals, and what is refused."""

import numpy as np
import pytest

import naive
from relume.light.reflection.brdf import GGX, PhongReflectance, Ward
from relume.light.reflection.convolution import zonal_coefficients
from relume.light.reflection.lobes import (
    VARNISH,
    Cosine,
    GGXLobe,
    Lambert,
    Mirror,
    Phong,
    SelfLuminous,
    WardLobe,
    quadrature,
)

LOBES = [
    Lambert(0.7),
    SelfLuminous(0.3),
    Mirror(0.9),
    Phong(0, 0.5),
    Phong(1.5, 0.8),
    Phong(50, 2.0),
    Phong(20, 0.5, VARNISH),
    GGXLobe(0.05, 0.7),
    GGXLobe(0.3, 0.7),
    GGXLobe(1.0, 0.7),
    WardLobe(0.05, 0.4),
    WardLobe(0.2, 0.4),
    WardLobe(1.0, 0.4),
    Cosine(lambda x: (x > 0.5) * 1.0, 0.6),
    Cosine(lambda x: (1 + x) ** 2, 0.25),
]
EVERY = pytest.mark.parametrize("lobe", LOBES, ids=lambda lobe: f"{lobe.name}{getattr(lobe, 'n', '')}")
COSINES = np.array([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0])


def test_lambert_is_k_times_the_cosine_above_the_horizon():
    assert Lambert(0.5)(COSINES) == pytest.approx([0, 0, 0, 0.125, 0.25, 0.5])


def test_self_luminous_material_is_the_same_at_every_angle():
    assert SelfLuminous(0.5)(COSINES) == pytest.approx([0.5] * 6)


def test_phong_is_k_times_a_power_of_the_cosine_above_the_horizon():
    assert Phong(2, 0.5)(COSINES) == pytest.approx([0, 0, 0, 0.03125, 0.125, 0.5])
    assert Phong(0, 0.5)(COSINES) == pytest.approx([0, 0, 0, 0.5, 0.5, 0.5])


def test_varnish_adds_a_half_at_the_very_peak_and_nothing_beside_it():
    varnished = Phong(2, 0.5, varnish=VARNISH)
    assert varnished.mirror == 0.5
    assert varnished(COSINES) == pytest.approx(Phong(2, 0.5)(COSINES))


def test_a_mirror_reflects_all_unblurred():
    assert Mirror(0.9).mirror == 0.9
    assert not Mirror(0.9)(COSINES).any()


@EVERY
def test_a_lobes_integral_is_that_of_its_values(lobe):
    # The midpoint rule in θ on 400 001 points; a step between two of its points, or of the quadrature's, costs more.
    theta = np.pi * (np.arange(400_001) + 0.5) / 400_001
    integral = 2 * np.pi * (lobe(np.cos(theta)) @ np.sin(theta)) * np.pi / 400_001
    assert lobe.integral == pytest.approx(integral, rel={"cosine": 5e-3, "phong": 1e-5}.get(lobe.name, 1e-6))


@pytest.mark.parametrize("lobe", [Lambert, SelfLuminous, Phong, Mirror])
def test_k_multiplies_the_lobe(lobe):
    np.testing.assert_allclose(lobe(k=0.25)(COSINES), 0.25 * lobe()(COSINES))
    assert lobe(k=0.25).integral == pytest.approx(0.25 * lobe().integral)


@pytest.mark.parametrize(
    ("lobe", "integral"),
    [
        (Lambert(), 3.141593),
        (SelfLuminous(), 12.566371),
        (Phong(1), 3.141593),
        (Phong(10), 0.571199),
        (Phong(50), 0.123200),
        (Phong(200), 0.031260),
        (Phong(1000), 0.006277),
        (GGXLobe(0.3, 0.7), 0.7),
        (WardLobe(0.3, 0.7), 0.7),
    ],
)
def test_the_integrals_of_the_table_of_truths(lobe, integral):
    assert lobe.integral == pytest.approx(integral, abs=5e-7)  # A7


@pytest.mark.parametrize("alpha", [0.02, 0.1, 0.5, 1.0])
@pytest.mark.parametrize(("lobe", "slow"), [(GGXLobe, naive.ggx), (WardLobe, naive.ward)])
def test_ggx_and_ward_have_the_shape_of_the_brdf_seen_along_its_normal(lobe, slow, alpha):
    normal, angles = np.array([0.0, 0, 1]), np.array([0.0, 0.05, 0.3, 0.9, 1.4, 1.7])
    lights = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    brdf = np.array([slow(alpha, normal, normal, light) for light in lights])
    values = lobe(alpha)(np.cos(angles))
    np.testing.assert_allclose(values / values[0], brdf / brdf[0], rtol=1e-9, atol=1e-300)


def test_lamberts_zonal_coefficients_are_the_cosines_factors():
    expected = [3.141593, 2.094395, 0.785398, 0, -0.130900, 0, 0.049087, 0, -0.024544]  # A4
    assert zonal_coefficients(Lambert(), 8) == pytest.approx(expected, abs=5e-7)
    assert zonal_coefficients(Lambert(0.5), 8) == pytest.approx(np.array(expected) / 2, abs=5e-7)


def test_phongs_zonal_coefficients_are_known_integrals():
    # 2π ∫₀¹ xⁿ P_l(x) dx: for n = 2 2π/3, 2π/4, 2π(3/10 − 1/6), …; in general f_1/f_0 = (n + 1)/(n + 2).
    assert zonal_coefficients(Phong(2), 3) == pytest.approx(np.pi * np.array([2 / 3, 1 / 2, 4 / 15, 1 / 12]), abs=1e-9)
    for n in (1, 10, 50, 200, 1000):
        zeroth, first, second = zonal_coefficients(Phong(n), 2)
        assert zeroth == pytest.approx(2 * np.pi / (n + 1), rel=1e-9)
        assert first / zeroth == pytest.approx((n + 1) / (n + 2), rel=1e-9)
        assert second / zeroth == pytest.approx(n / (n + 3), rel=1e-9)


def test_self_luminous_material_has_one_zonal_coefficient():
    assert zonal_coefficients(SelfLuminous(), 4) == pytest.approx([4 * np.pi, 0, 0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("width", [1e-4, 0.03, 1.0])
def test_the_quadrature_integrates_a_narrow_peak_and_the_whole_sphere(width):
    theta, weights = quadrature(width, 200)
    assert weights.sum() == pytest.approx(2, rel=1e-13)
    assert theta.min() > 0
    assert theta.max() < np.pi
    tail = width**2 * (1 - np.exp(-2 / width**2))
    assert np.exp((np.cos(theta) - 1) / width**2) @ weights == pytest.approx(tail, rel=1e-9)


# --- what is refused -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("k", [-0.1, np.nan, np.inf])
@pytest.mark.parametrize(
    "lobe",
    [
        Lambert,
        SelfLuminous,
        Mirror,
        Phong,
        lambda k: GGXLobe(0.1, k),
        lambda k: WardLobe(0.1, k),
        lambda k: Cosine(np.abs, k),
    ],
    ids=["lambert", "self-luminous", "mirror", "phong", "ggx", "ward", "cosine"],
)
def test_a_reflectance_below_nothing_is_refused(lobe, k):
    with pytest.raises(ValueError, match=rf"k of [a-z-]+ is {k}; expected a reflectance of 0 or more"):
        lobe(k=k)


@pytest.mark.parametrize("n", [-1, np.nan, np.inf])
@pytest.mark.parametrize("kind", [Phong, PhongReflectance])
def test_a_glossiness_below_nothing_is_refused(kind, n):
    with pytest.raises(ValueError, match=rf"n of phong is {n}; expected a glossiness of 0 or more"):
        kind(n)


def test_a_negative_varnish_is_refused():
    with pytest.raises(ValueError, match=r"varnish of phong is -0\.5; expected a share of 0 or more"):
        Phong(50, varnish=-0.5)


@pytest.mark.parametrize("alpha", [0, -0.1, 1.1, 1.5, np.nan])
@pytest.mark.parametrize("lobe", [GGXLobe, WardLobe, GGX, Ward])
def test_an_alpha_beyond_0_to_1_is_refused(lobe, alpha):
    with pytest.raises(ValueError, match=rf"alpha of (ggx|ward) is {alpha}; expected above 0 and at most 1"):
        lobe(alpha)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: x, r"returned values from -1\.0 to 1\.0 for 2001 cosines.* finite values of 0 or more"),
        (lambda x: np.where(x > 0.5, np.nan, 1), r"returned values from nan to nan"),
        (lambda x: np.where(x > 0.5, np.inf, 1), r"returned values from 1\.0 to inf"),
        (lambda x: 1.0, r"returned shape \(\) for 2001 cosines; it must return an array of that shape"),
        (lambda x: np.ones((2001, 3)), r"returned shape \(2001, 3\)"),
    ],
    ids=["negative", "NaN", "infinite", "a number", "coloured"],
)
def test_a_function_that_is_no_reflectance_is_refused(function, message):
    with pytest.raises(ValueError, match=message):
        Cosine(function, name="mine")
