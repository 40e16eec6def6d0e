"""Robertson's iteration: what it converges to, and its first turn written out slowly."""

import numpy as np
import pytest

from relume.capture.response.other_methods import Robertson
from relume.capture.response.sampling import Observations


def seen(exponent: float, levels: int = 256) -> Observations:
    light = np.geomspace(0.002, 1.0, 4000)[:, None]
    log_exposures = np.log(2.0) * np.arange(-5, 2)
    values = np.rint((levels - 1) * np.minimum(light * np.exp(log_exposures), 1.0) ** (1 / exponent)).astype(int)
    return Observations(np.where(values == levels - 1, 0, values), log_exposures)


@pytest.mark.parametrize("exponent", [1.0, 1.8, 2.4])
@pytest.mark.parametrize("levels", [256, 65536])
def test_a_power_law_is_recovered(exponent, levels):
    curve, error = Robertson().curve([seen(exponent, levels)], levels)
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
