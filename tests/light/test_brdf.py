"""Reflection functions of view and light: known albedos, reciprocity, and their formulas written out again."""

from functools import cache

import numpy as np
import pytest
from scipy.special import roots_legendre

import naive
from relume.light.reflection.brdf import GGX, PhongReflectance, Ward
from relume.light.reflection.glossy import albedo
from relume.light.reflection.weights import Even, Fresnel, Schlick
from relume.sphere.directions import normalised

NORMAL = np.array([0.0, 0, 1])
ANGLES = np.radians([0, 20, 60, 85])
PAIRS = [(GGX(0.05), naive.ggx, 0.05), (GGX(0.5), naive.ggx, 0.5), (GGX(1.0), naive.ggx, 1.0)]
PAIRS += [(Ward(0.1), naive.ward, 0.1), (Ward(0.6), naive.ward, 0.6)]
PAIRS += [(PhongReflectance(0), naive.phong, 0), (PhongReflectance(30), naive.phong, 30)]
EVERY = pytest.mark.parametrize(("brdf", "slow", "width"), PAIRS, ids=[f"{b.name} {w}" for b, _, w in PAIRS])


def eye(angle):
    return np.array([np.sin(angle), 0, np.cos(angle)])


def lights(count=60):
    return normalised(np.random.default_rng(2).normal(size=(count, 3)))


@cache
def quadrature(count=400):
    """Directions of the upper hemisphere and their solid angles, Gauss in the cosine and even in azimuth."""
    nodes, weights = roots_legendre(count)
    cosine, azimuth = (nodes[:, None] + 1) / 2, 2 * np.pi * (np.arange(count) + 0.5) / count
    sine = np.sqrt(1 - cosine**2)
    directions = np.stack(np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), cosine), -1)
    return directions, np.repeat(weights[:, None] / 2 * 2 * np.pi / count, count, 1)


@EVERY
def test_a_reflection_function_is_its_formula_written_out(brdf, slow, width):
    for angle in ANGLES:
        written = [slow(width, NORMAL, eye(angle), light) for light in lights()]
        np.testing.assert_allclose(brdf(angle, lights()), written, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("alpha", "value"), [(1.0, 1 - np.log(2)), (0.1, 0.98830), (0.3, 0.87736), (0.5, 0.68785), (0.8, 0.42700)]
)
def test_the_albedo_of_white_ggx_along_the_normal(alpha, value):
    assert albedo(GGX(alpha), 0.0) == pytest.approx(value, abs=5e-6)  # A18
    if alpha == 1:
        assert albedo(GGX(alpha), 0.0) == pytest.approx(0.306853, abs=5e-7)


@pytest.mark.parametrize("n", [0, 1, 10, 50, 1000])
def test_phongs_reflectance_keeps_all_light_along_the_normal_and_never_makes_any(n):
    assert albedo(PhongReflectance(n), 0.0) == pytest.approx(1, abs=1e-6)
    for angle in ANGLES[1:]:
        assert albedo(PhongReflectance(n), angle) <= 1 + 1e-6


def test_the_norm_of_phongs_reflectance():
    # A8: (n + 2)/2π.
    for n, norm in ((10, 1.909859), (50, 8.276057)):
        assert float(PhongReflectance(n)(0.0, NORMAL)) == pytest.approx(norm, abs=1e-6)


@EVERY
def test_an_albedo_is_the_integral_over_the_hemisphere(brdf, slow, width):
    directions, solid_angles = quadrature()
    for angle in np.radians([0, 40, 70]):
        slowly = (brdf(angle, directions) * solid_angles).sum()
        assert albedo(brdf, angle) == pytest.approx(slowly, rel=1e-3)


@pytest.mark.parametrize("brdf", [GGX(0.1), Ward(0.15)], ids=lambda b: f"{b.name} {b.alpha}")
def test_an_albedo_is_the_integral_where_the_lobe_is_thin_at_grazing_angles(brdf):
    directions, solid_angles = quadrature(1200)
    slowly = (brdf(np.radians(88), directions) * solid_angles).sum()
    assert albedo(brdf, np.radians(88)) == pytest.approx(slowly, rel=2e-3)


@pytest.mark.parametrize("alpha", [0.05, 0.3, 1.0])
def test_white_ggx_never_makes_light(alpha):
    for angle in np.radians([0, 30, 60, 80, 88]):
        assert albedo(GGX(alpha), angle) <= 1 + 1e-3


@pytest.mark.parametrize("brdf", [GGX(0.1), GGX(0.7), Ward(0.2), PhongReflectance(20)], ids=lambda b: b.name)
def test_light_may_go_either_way(brdf):
    # Reciprocity: f_r, without the cosine to the light, is the same with eye and light exchanged.
    for one in ANGLES:
        for other in ANGLES:
            for azimuth in (0, 1, 2.5):
                light = np.array([np.sin(other) * np.cos(azimuth), np.sin(other) * np.sin(azimuth), np.cos(other)])
                there = brdf(one, light) / light[2]
                back = np.array([np.sin(one) * np.cos(azimuth), np.sin(one) * np.sin(azimuth), np.cos(one)])
                assert brdf(other, back) / back[2] == pytest.approx(there, rel=1e-9)


@EVERY
def test_no_light_from_below_is_reflected(brdf, slow, width):
    below = lights() * [1, 1, -1] * np.sign(lights()[:, 2:])
    for angle in ANGLES:
        assert not brdf(angle, below).any()


@EVERY
def test_a_reflection_function_is_the_same_on_both_sides_of_the_plane_of_incidence(brdf, slow, width):
    np.testing.assert_allclose(brdf(0.8, lights()), brdf(0.8, lights() * [1, -1, 1]), rtol=1e-12)


def test_ggx_is_masked_separably_as_in_mitsuba():
    # Mitsuba's `roughconductor` multiplies smith_g1(wi) by smith_g1(wo) = 2/(1 + √(1 + α² tan²θ)).
    alpha, angle, other = 0.5, 1.2, 1.3
    towards = np.array([-np.sin(other), 0, np.cos(other)])
    half = normalised(towards + eye(angle))
    cosine2 = half[2] ** 2
    distribution = 1 / (np.pi * alpha**2 * cosine2**2 * (1 + (1 - cosine2) / cosine2 / alpha**2) ** 2)
    masked, shadowed = (2 / (1 + np.sqrt(1 + (alpha * np.tan(a)) ** 2)) for a in (angle, other))
    expected = distribution * masked * shadowed / (4 * np.cos(angle))
    assert float(GGX(alpha)(angle, towards)) == pytest.approx(expected, rel=1e-12)
    correlated = distribution / (4 * np.cos(angle)) / (1 / masked + 1 / shadowed - 1)
    assert float(GGX(alpha)(angle, towards)) < 0.98 * correlated


@pytest.mark.parametrize("fresnel", [Even(0.5), Schlick(0.04), Fresnel(1.5)])
def test_ggx_reflects_by_the_angle_on_its_facets(fresnel):
    for angle in ANGLES:
        half = normalised(lights() + eye(angle))
        np.testing.assert_allclose(
            GGX(0.3, fresnel)(angle, lights()),
            GGX(0.3)(angle, lights()) * fresnel(np.clip(half @ eye(angle), 0, 1)),
            rtol=1e-12,
        )


def test_mirror_smooth_ggx_in_dielectric_reflects_fresnels_share():
    for angle in np.radians([0, 45, 60]):
        assert albedo(GGX(0.01, Fresnel(1.5)), angle) == pytest.approx(float(Fresnel(1.5)(np.cos(angle))), rel=0.01)
