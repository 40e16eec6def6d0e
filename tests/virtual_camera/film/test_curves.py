"""The characteristic curve: its ends, its slope, its inverse, and that it never turns."""

import numpy as np
import pytest

from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve

CURVE = CharacteristicCurve(gamma=0.7, minimum=0.2, maximum=2.2, toe=0.15, shoulder=0.3, inertia=-1.0)


def test_pinned_densities_of_the_closed_form():
    # By hand: softplus(0) = ln 2 makes 0.7 · 0.15 · 0.6931 = 0.0728 of the line at the inertia; two decades on the line
    # is 1.4, and ln(1 + e^((2 − 1.4) / 0.3)) = 2.1269 of 6.6679 is left of the span of 2.
    # ln(1 + e^((2 − 0.0728) / 0.3)) = 6.4256.
    assert CURVE.density(-1.0) == pytest.approx(2.2 - 2 * 6.42555 / 6.66794, abs=1e-4)
    assert CURVE.density(1.0) == pytest.approx(2.2 - 2 * 2.12693 / 6.66794, abs=1e-4)


def test_it_runs_from_the_minimum_to_the_maximum():
    np.testing.assert_allclose(CURVE.density(np.array([-np.inf, -30.0, 30.0])), [0.2, 0.2, 2.2], atol=1e-12)


def test_the_straight_line_has_the_slope_gamma_and_meets_the_minimum_at_the_inertia():
    straight = CharacteristicCurve(gamma=0.6, minimum=0.1, maximum=4.0, toe=0.1, shoulder=0.1, inertia=-2.0)
    x = np.linspace(-0.5, 2.0, 20)
    np.testing.assert_allclose(np.diff(straight.density(x)) / np.diff(x), 0.6, rtol=1e-4)
    np.testing.assert_allclose(straight.density(x), 0.1 + 0.6 * (x + 2), atol=1e-4)


def test_it_rises_everywhere_without_a_corner():
    x = np.linspace(-6, 6, 4001)
    density = CURVE.density(x)
    slope = np.gradient(density, x)
    # Beyond these exposures it is flat to the last digit.
    assert np.all(np.diff(density[(x > -4) & (x < 5)]) > 0)
    # A corner would show as a jump of the slope between neighbours 0.003 decades apart.
    assert np.abs(np.diff(slope)).max() < 0.005


def test_the_inverse_gives_the_exposure_back():
    x = np.linspace(-2.2, 4.0, 50)
    np.testing.assert_allclose(CURVE.log_exposure(CURVE.density(x)), x, atol=1e-6)
    for density in (0.2, 2.2, 3.0):
        with pytest.raises(ValueError, match=r"this curve has those between 0\.2 and 2\.2"):
            CURVE.log_exposure(density)


def test_a_faster_layer_has_the_same_curve_at_less_light():
    moved = CURVE.through(-2.5, 1.0)
    assert moved.density(-2.5) == pytest.approx(1.0, abs=1e-9)
    shift = moved.inertia - CURVE.inertia
    x = np.linspace(-3, 3, 30)
    np.testing.assert_allclose(moved.density(x + shift), CURVE.density(x), atol=1e-12)
