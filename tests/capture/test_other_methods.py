"""The other methods: a polynomial comes back as one; Robertson's iteration converges, its first turn written out."""

from __future__ import annotations

import numpy as np
import pytest

from relume.capture.response.other_methods import MitsunagaNayar, Robertson
from relume.capture.response.sampling import Observations
from relume.errors import NotABracket

TRUE = np.array([0.0, 0.2, 0.3, 0.5])
"""f⁻¹(m) = 0.2 m + 0.3 m² + 0.5 m³: 1 at 1."""


def seen(levels: int) -> Observations:
    """Places of many brightnesses in four exposures of a camera whose inverse response is `TRUE`."""
    light = np.geomspace(0.01, 1.0, 600)[:, None]
    log_exposures = np.log(2.0) * np.arange(-3, 1)
    grid = np.linspace(0, 1, 20001)
    encoded = np.interp(light * np.exp(log_exposures), np.polynomial.polynomial.polyval(grid, TRUE), grid)
    return Observations(np.rint(encoded * (levels - 1)).astype(int), log_exposures)


@pytest.mark.parametrize("method", [MitsunagaNayar(3), MitsunagaNayar()], ids=["degree 3", "degree chosen"])
@pytest.mark.parametrize("levels", [256, 65536])
def test_a_polynomial_is_recovered(method, levels):
    curve, error = method.curve([seen(levels)], levels)
    values = np.linspace(0, 1, levels)
    expected = np.log(np.polynomial.polynomial.polyval(values[levels // 8 :], TRUE))
    expected -= np.log(np.polynomial.polynomial.polyval(values[(levels - 1) // 2], TRUE))
    np.testing.assert_allclose(curve[levels // 8 :], expected, atol=0.02 if levels == 256 else 1e-3)
    assert np.all(np.diff(curve) > 0) and np.all(np.isnan(error)) and len(error) == levels


def test_ratios_that_were_given_a_little_wrong_are_found():
    right = seen(65536)
    wrong = Observations(right.values, right.log_exposures + np.array([0.0, 0.05, 0.0, 0.0]))
    deviations = []
    for rounds in (0, 30):
        curve, _ = MitsunagaNayar(3, rounds=rounds).curve([wrong], 65536)
        reference, _ = MitsunagaNayar(3).curve([right], 65536)
        deviations.append(np.abs(curve - reference)[10000:].max())
    assert deviations[1] < deviations[0]


def test_too_few_values_and_wrong_degrees_are_refused():
    with pytest.raises(NotABracket, match="between 5 and 250 of 255"):
        MitsunagaNayar().curve([Observations(np.full((50, 2), 254), np.log([1.0, 2.0]))], 256)
    with pytest.raises(ValueError, match="degree is 11; expected 1 to 10"):
        MitsunagaNayar(11)


def of_a_power_law(exponent: float, levels: int = 256) -> Observations:
    light = np.geomspace(0.002, 1.0, 4000)[:, None]
    log_exposures = np.log(2.0) * np.arange(-5, 2)
    values = np.rint((levels - 1) * np.minimum(light * np.exp(log_exposures), 1.0) ** (1 / exponent)).astype(int)
    return Observations(np.where(values == levels - 1, 0, values), log_exposures)


@pytest.mark.parametrize("exponent", [1.0, 1.8, 2.4])
@pytest.mark.parametrize("levels", [256, 65536])
def test_a_power_law_is_recovered(exponent, levels):
    curve, error = Robertson().curve([of_a_power_law(exponent, levels)], levels)
    part = slice(levels // 6, levels - levels // 20)
    expected = exponent * np.log(np.arange(levels)[part] / ((levels - 1) // 2))
    # The authors stop far from where the iteration would: the last hundredths come slowly.
    assert np.median(np.abs(curve[part] - expected)) < 0.02
    assert np.all(np.diff(curve) > 0) and np.all(np.isnan(error)) and curve.shape == (levels,)


def test_one_turn_is_the_paper_s_equations():
    values = np.random.default_rng(1).integers(1, 255, (400, 3))
    # Every value occurs, so that nothing is interpolated.
    values[:254, 0] = np.arange(1, 255)
    times = np.array([0.5, 1.0, 2.0])
    middle = 127.5

    def weight(value: int) -> float:
        least = np.exp(-4.0)
        return (np.exp(-4 * (value - middle) ** 2 / middle**2) - least) / (1 - least)

    sums, counts = np.zeros(256), np.zeros(256)
    for row in values:
        top = sum(weight(v) * t * (v / 127) for v, t in zip(row, times, strict=True))
        bottom = sum(weight(v) * t**2 for v, t in zip(row, times, strict=True))
        for value, time in zip(row, times, strict=True):
            sums[value] += time * top / bottom
            counts[value] += 1
    expected = np.log(sums[1:255] / counts[1:255])
    expected = np.maximum.accumulate(expected - expected[126])
    curve, _ = Robertson(rounds=1).curve([Observations(values, np.log(times))], 256)
    np.testing.assert_allclose(curve[127:255], expected[126:] - (expected[126] - curve[127]), atol=1e-6)
