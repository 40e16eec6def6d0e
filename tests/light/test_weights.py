"""W_d and W_s by the angle of view: the known values of Schlick's and Fresnel's formulas."""

import numpy as np
import pytest

from relume.light.reflection.weights import ENTRIES, Complement, Even, Fresnel, Schlick, tabulated

ANGLES = np.radians([0, 30, 45, 60, 75, 85, 90])


def polarised(ior, cosine):
    """Fresnel's two reflectances from Snell's law, across and along the plane of incidence."""
    refracted = np.sqrt(1 - (1 - cosine**2) / ior**2 + 0j).real
    across = (cosine - ior * refracted) / (cosine + ior * refracted)
    along = (ior * cosine - refracted) / (ior * cosine + refracted)
    return across**2, along**2


def test_an_even_weight_is_the_same_at_every_angle():
    assert Even(0.3)(np.array([0.0, 0.5, 1.0])) == pytest.approx([0.3, 0.3, 0.3])
    assert Even((0.1, 0.2, 0.3))(np.zeros((2, 5))).shape == (2, 5, 3)
    assert Even((0.1, 0.2, 0.3))(np.zeros(())) == pytest.approx([0.1, 0.2, 0.3])


def test_schlicks_weight_is_f0_along_the_normal_and_1_at_grazing_angles():
    # 0.04 + 0.96/32 at 60°.
    assert Schlick()(np.array([1.0, 0.5, 0.0])) == pytest.approx([0.04, 0.07, 1.0])


def test_schlicks_weight_may_be_coloured():
    values = Schlick((1.0, 0.8, 0.3))(np.array([1.0, 0.5]))
    np.testing.assert_allclose(values, [[1, 0.8, 0.3], [1, 0.80625, 0.321875]])


@pytest.mark.parametrize(("ior", "value"), [(1.33, 0.020059), (1.5, 0.04), (2, 0.111111), (2.42, 0.172395)])
def test_fresnels_reflectance_along_the_normal(ior, value):
    assert float(Fresnel(ior)(np.array(1.0))) == pytest.approx(value, abs=1e-6)  # A23
    assert float(Fresnel(1 / ior)(np.array(1.0))) == pytest.approx(value, abs=1e-6)


def test_fresnels_reflectance_of_glass_by_the_angle():
    expected = [0.04, 0.041523, 0.050240, 0.089187, 0.253061, 0.612800, 1.0]  # A23
    assert Fresnel(1.5)(np.cos(ANGLES)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("ior", [0.7, 1.33, 1.5, 2.42])
def test_fresnels_reflectance_is_the_mean_of_both_polarisations(ior):
    cosines = np.linspace(0.001, 1, 500)
    cosines = cosines[1 - cosines**2 < ior**2]
    np.testing.assert_allclose(Fresnel(ior)(cosines), np.mean(polarised(ior, cosines), axis=0), rtol=1e-9)


def test_at_brewsters_angle_half_of_what_is_reflected_across_is_all():
    cosine = np.cos(np.radians(56.3099))  # A22
    across, along = polarised(1.5, np.array(cosine))
    assert along < 1e-10
    # sin²(i − t) at i + t = 90° is cos²(2i): ((n² − 1)/(n² + 1))² = 0.147929.
    assert float(Fresnel(1.5)(np.array(cosine))) == pytest.approx(0.147929 / 2, abs=1e-6)
    assert across == pytest.approx(0.147929, abs=1e-6)


def test_all_is_reflected_within_beyond_the_critical_angle():
    inside = Fresnel(1 / 1.5)  # A22: 41.8103°
    assert float(inside(np.cos(np.radians(41.82)))) == 1
    assert float(inside(np.cos(np.radians(41.80)))) < 0.96
    assert inside(np.cos(np.radians([45, 60, 89, 90]))) == pytest.approx([1, 1, 1, 1])


def test_glass_seen_from_either_side_reflects_alike_along_a_refracted_ray():
    cosine = np.linspace(0.05, 1, 50)
    refracted = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    np.testing.assert_allclose(Fresnel(1.5)(cosine), Fresnel(1 / 1.5)(refracted), rtol=1e-9)


def test_the_mean_over_cosines_of_glass():
    cosine = (np.arange(1_000_000) + 0.5) / 1_000_000
    assert (2 * Fresnel(1.5)(cosine) * cosine).mean() == pytest.approx(0.0917780, abs=1e-7)  # A23
    # What gets out of glass gets in: 1 − (1 − 0.0917780)/1.5². A23 prints 0.5963819, which does not fit its own pair.
    assert (2 * Fresnel(1 / 1.5)(cosine) * cosine).mean() == pytest.approx(0.5963458, abs=1e-7)


def test_schlick_is_near_fresnel():
    cosine = np.linspace(0, 1, 200)
    assert np.abs(Schlick(0.04)(cosine) - Fresnel(1.5)(cosine)).max() < 0.05


@pytest.mark.parametrize("weight", [Schlick(0.04), Fresnel(1.5), Fresnel(0.7)])
def test_a_weight_beyond_grazing_is_that_at_grazing(weight):
    # Interpolated normals may face away from the viewer a little, and rounding may exceed 1.
    assert float(weight(np.array(-0.1))) == 1
    assert float(weight(np.array(1 + 1e-7))) == float(weight(np.array(1.0)))


def test_a_complement_is_what_is_left():
    cosine = np.linspace(0, 1, 50)
    for weight in (Even(0.3), Even((0.1, 0.2, 0.3)), Schlick((1.0, 0.8, 0.3)), Fresnel(1.5)):
        np.testing.assert_allclose(Complement(weight)(cosine) + weight(cosine), 1, rtol=1e-12)
    assert Complement(Even(1.5))(cosine).max() == 0


@pytest.mark.parametrize("weight", [Even(0.3), Even((0.1, 0.2, 0.3)), Schlick(0.04), Fresnel(1.5), Complement(Even(1))])
def test_a_tabulated_weight_is_the_weight_at_even_cosines(weight):
    table = tabulated(weight)
    assert (table.shape, table.dtype) == ((ENTRIES, 3), np.float32)
    assert table.flags.c_contiguous
    for entry in (0, 1, 512, 1024):
        np.testing.assert_allclose(table[entry], np.broadcast_to(weight(np.array(entry / 1024)), 3), rtol=1e-6)


@pytest.mark.parametrize(
    "weight",
    [
        lambda c: np.ones((*np.shape(c), 2)),
        lambda c: 1.0,
        lambda c: -np.ones_like(c),
        lambda c: np.full_like(c, np.nan),
        Even((0.1, 0.2)),  # type: ignore[arg-type]
    ],
    ids=["two channels", "a number", "negative", "NaN", "two numbers"],
)
def test_a_weight_that_is_no_reflectance_is_refused(weight):
    with pytest.raises(ValueError, match=r"a weight gave .*; it must return one or three finite reflectances"):
        tabulated(weight)


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf, (0.1, -0.2, 0.3)])
def test_an_even_weight_below_nothing_is_refused(value):
    with pytest.raises(ValueError, match="expected a reflectance of 0 or more"):
        Even(value)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan, (0.1, 0.2, 1.3)])
def test_a_reflectance_beyond_0_to_1_along_the_normal_is_refused(value):
    with pytest.raises(ValueError, match="expected 0 to 1"):
        Schlick(value)


@pytest.mark.parametrize("ior", [0, -1.5, np.nan, np.inf])
def test_an_index_of_refraction_that_cannot_be_is_refused(ior):
    with pytest.raises(ValueError, match=rf"index of refraction is {ior}; expected above 0, like 1\.5 for glass"):
        Fresnel(ior)
