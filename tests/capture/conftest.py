"""One virtual bracket that many tests look at."""

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.capture.response.calibration import Calibration, recover_response
from synthetic import NOISELESS, wide_scene


@pytest.fixture(scope="session")
def scene() -> np.ndarray:
    return wide_scene()


@pytest.fixture(scope="session")
def bracket(scene) -> Bracket:
    """Nine photographs of `scene` without noise, one stop apart."""
    return NOISELESS.bracket(scene)


@pytest.fixture(scope="session")
def calibration(bracket) -> Calibration:
    return recover_response(bracket)
