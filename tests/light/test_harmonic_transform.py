"""Harmonics of any spin: Wigner's functions by closed forms, and sums over pixels against the sums written out."""

import numpy as np
import pytest
from scipy.special import sph_harm_y

import naive
from lights import lone, spiky
from relume.light.harmonics.transform import Flux, analysed, synthesised, wigner
from relume.light.reflection.lobes import quadrature
from relume.sphere.mappings.mapping import LatLong

ANGLES = np.array([0.0, 0.3, 1.1, np.pi / 2, 2.5, 3.1, np.pi])
COSINE, SINE = np.cos(ANGLES), np.sin(ANGLES)
SPINS = pytest.mark.parametrize("spin", [0, 1, 2, 3])


def at_degree(degree, orders, spin, angles=ANGLES):
    return list(wigner(np.asarray(orders), spin, angles, degree))[degree]


def flux_of(light):
    return light.radiance * light.mapping.solid_angles(light.size)[..., None]


def profile(spin, cosine):
    """A lobe that vanishes at its centre as a lobe of that spin must."""
    return np.maximum(cosine, 0) ** 6 * np.sqrt(np.maximum(1 - cosine**2, 0)) ** spin


def kernel(spin, degree):
    angles, weights = quadrature(0.4, degree)
    scale = np.sqrt((2 * np.arange(degree + 1) + 1) / (4 * np.pi))
    values = np.array([v[0] for v in wigner(np.array([spin]), 0, angles, degree)])
    return 2 * np.pi * scale * (values @ (profile(spin, np.cos(angles)) * weights))


def convolved_slowly(light, spin, rows):
    """Σ flux · g(γ) · e^{i·spin·χ} at every entry, χ from the south towards growing longitude."""
    directions, flux = naive.latlong_pixels(light.radiance)
    table = np.zeros((rows, 2 * rows, 3), complex)
    for j in range(rows):
        for i in range(2 * rows):
            polar, longitude = np.pi * (j + 0.5) / rows, np.pi * (i + 0.5) / rows - np.pi
            sideways = np.array([np.sin(longitude), 0, -np.cos(longitude)])
            entry = np.sin(polar) * sideways + [0, np.cos(polar), 0]
            south = np.cos(polar) * sideways - [0, np.sin(polar), 0]
            east = np.array([np.cos(longitude), 0, np.sin(longitude)])
            azimuth = np.arctan2(directions @ east, directions @ south)
            table[j, i] = (profile(spin, directions @ entry) * np.exp(1j * spin * azimuth)) @ flux
    return table


def test_wigners_functions_of_degree_one_are_the_printed_ones():
    # Varshalovich et al. 1988, table 4.3; rows are the orders −1, 0, 1.
    for spin, expected in {
        -1: [(1 + COSINE) / 2, -SINE / np.sqrt(2), (1 - COSINE) / 2],
        0: [SINE / np.sqrt(2), COSINE, -SINE / np.sqrt(2)],
        1: [(1 - COSINE) / 2, SINE / np.sqrt(2), (1 + COSINE) / 2],
    }.items():
        np.testing.assert_allclose(at_degree(1, [-1, 0, 1], spin), expected, atol=1e-14)


def test_wigners_functions_of_degree_two_are_the_printed_ones():
    expected = {
        (2, 2): ((1 + COSINE) / 2) ** 2,
        (2, 1): -SINE * (1 + COSINE) / 2,
        (2, 0): np.sqrt(3 / 8) * SINE**2,
        (2, -1): -SINE * (1 - COSINE) / 2,
        (2, -2): ((1 - COSINE) / 2) ** 2,
        (1, 1): (2 * COSINE**2 + COSINE - 1) / 2,
        (1, 0): -np.sqrt(3 / 2) * SINE * COSINE,
        (1, -1): (-2 * COSINE**2 + COSINE + 1) / 2,
        (0, 0): (3 * COSINE**2 - 1) / 2,
        (0, 1): np.sqrt(3 / 2) * SINE * COSINE,
        (-1, 2): SINE * (1 - COSINE) / 2,
        (-2, 1): SINE * (1 - COSINE) / 2,
    }
    for (order, spin), values in expected.items():
        np.testing.assert_allclose(at_degree(2, [order], spin)[0], values, atol=1e-14, err_msg=f"{order}, {spin}")


@pytest.mark.parametrize("spin", range(-4, 5))
def test_wigners_functions_are_his_sums_of_factorials(spin):
    orders = np.arange(-9, 10)
    for degree, values in enumerate(wigner(orders, spin, ANGLES, 9)):
        for order, row in zip(orders, values, strict=True):
            if degree < max(abs(order), abs(spin)):
                assert not row.any()
            else:
                slow = [naive.wigner(degree, int(order), spin, float(angle)) for angle in ANGLES]
                np.testing.assert_allclose(row, slow, atol=1e-13, err_msg=f"d^{degree}_{order},{spin}")


@pytest.mark.parametrize("angle", [0.02, 0.77, 2.9])
def test_wigners_functions_of_one_degree_are_a_rotation(angle):
    size = 12
    orders = np.arange(-size, size + 1)
    matrix = np.stack([at_degree(size, orders, int(k), np.array([angle]))[:, 0] for k in orders], axis=1)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(2 * size + 1), atol=1e-12)


@pytest.mark.parametrize(("order", "spin"), [(0, 0), (3, 0), (2, 2), (5, -3)])
def test_wigners_functions_of_different_degrees_are_orthogonal(order, spin):
    # ∫ d^l d^l' sin θ dθ = 2/(2l + 1) where l = l', to degree 120.
    nodes, weights = np.polynomial.legendre.leggauss(130)
    values = np.array([v[0] for v in wigner(np.array([order]), spin, np.arccos(nodes), 120)])
    first = max(abs(order), abs(spin))
    products = (values * weights) @ values.T
    expected = np.diag(np.where(np.arange(121) < first, 0, 2 / (2 * np.arange(121) + 1)))
    np.testing.assert_allclose(products, expected, atol=1e-13)


def test_spin_zero_gives_the_harmonics_of_scipy():
    for degree, values in enumerate(wigner(np.arange(41), 0, ANGLES, 40)):
        orders = np.arange(degree + 1)
        theirs = sph_harm_y(degree, orders[:, None], ANGLES, 0).real
        ours = values[: degree + 1] * np.sqrt((2 * degree + 1) / (4 * np.pi))
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


@pytest.mark.parametrize("rows", [4, 5])
def test_coefficients_are_the_sums_over_pixels_beyond_the_maps_own_frequencies_too(rows):
    light, degree = spiky(rows), 27
    directions, flux = naive.latlong_pixels(light.radiance)
    polar = np.arccos(directions[:, 1])
    longitude = np.arctan2(directions[:, 0], -directions[:, 2]) + np.pi  # from the left edge
    coefficients = analysed(flux_of(light), degree)
    for l in range(degree + 1):  # noqa: E741
        for m in range(l + 1):
            slow = np.conj(sph_harm_y(l, m, polar, longitude)) @ flux
            np.testing.assert_allclose(coefficients[l, m], slow, atol=1e-10 * flux.sum(), err_msg=f"{l}, {m}")
        assert not coefficients[l, l + 1 :].any()


def test_constant_light_has_one_coefficient():
    coefficients = analysed(LatLong().solid_angles(256)[..., None], 6)
    assert coefficients[0, 0, 0] == pytest.approx(np.sqrt(4 * np.pi), rel=1e-12)
    coefficients[0, 0, 0] = 0
    assert np.abs(coefficients).max() < 1e-4


@SPINS
@pytest.mark.parametrize(("size", "rows"), [(6, 9), (7, 6), (24, 4)])
def test_light_convolved_by_harmonics_is_the_sum_written_out(spin, size, rows):
    # Degree 60 is beyond the frequencies of a map of 6 rows, and of a table of 4.
    light = spiky(size)
    found = synthesised(analysed(flux_of(light), 60), kernel(spin, 60)[None], spin, rows)[0]
    slow = convolved_slowly(light, spin, rows)
    found = found.real if spin == 0 else found  # half of a real signal's orders are summed
    np.testing.assert_allclose(found, slow, atol=2e-5 * np.abs(slow).max())


@SPINS
def test_a_lone_light_at_the_seam_or_a_pole_is_convolved_like_any_other(spin):
    for row, column in ((0, 0), (3, 15), (7, 8)):
        light = lone(8, row, column)
        found = synthesised(analysed(flux_of(light), 60), kernel(spin, 60)[None], spin, 6)[0]
        slow = convolved_slowly(light, spin, 6)
        np.testing.assert_allclose(
            found.real if spin == 0 else found, slow, atol=2e-5 * np.abs(slow).max(), err_msg=f"{row}, {column}"
        )


def test_several_kernels_at_once_are_each_alone():
    coefficients, kernels = analysed(flux_of(spiky(6)), 40), np.stack([kernel(2, 40), 3 * kernel(2, 40)[::-1]])
    together = synthesised(coefficients, kernels, 2, 5)
    for k in range(2):
        np.testing.assert_allclose(together[k], synthesised(coefficients, kernels[k : k + 1], 2, 5)[0], rtol=1e-12)


@pytest.mark.parametrize(("spin", "rows"), [(0, 7), (2, 8), (3, 9)])
def test_in_single_precision_the_sums_are_off_by_what_that_rounds(spin, rows):
    coefficients, kernels = analysed(flux_of(spiky(6)), 60), np.stack([kernel(spin, 60)])
    exact = synthesised(coefficients, kernels, spin, rows)
    single = synthesised(coefficients.astype(np.complex64), kernels, spin, rows)
    assert exact.dtype == np.complex128
    assert single.dtype == np.complex64
    assert 0 < np.abs(single - exact).max() < 2e-6 * np.abs(exact).max()


def test_rows_that_are_made_as_they_are_asked_for_give_the_same_bits():
    radiance = np.random.default_rng(3).random((100, 200, 3)).astype(np.float32)
    areas = LatLong().solid_angles(100)
    flux = Flux(radiance, areas)
    whole = radiance * areas[..., None]
    assert flux.shape == (100, 200, 3) and np.array_equal(flux[90:], whole[90:])
    assert flux.sum() == pytest.approx(whole.sum((0, 1)), rel=1e-13)
    assert np.array_equal(analysed(flux, 12), analysed(whole, 12))
