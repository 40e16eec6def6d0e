"""A camera that is a polynomial is recovered as one, whatever degree it is given room for."""

import numpy as np
import pytest

from relume.capture.response.other_methods import MitsunagaNayar
from relume.capture.response.sampling import Observations
from relume.errors import NotABracket

TRUE = np.array([0.0, 0.2, 0.3, 0.5])
"""f⁻¹(m) = 0.2 m + 0.3 m² + 0.5 m³: 1 at 1."""


def seen(levels: int, stops: float = 1.0) -> Observations:
    """Places of many brightnesses in four exposures of a camera whose inverse response is `TRUE`."""
    light = np.geomspace(0.01, 1.0, 600)[:, None]
    log_exposures = np.log(2.0) * stops * np.arange(-3, 1)
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
