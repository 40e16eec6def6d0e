"""The sample photographs beside the repository, and one virtual bracket that many tests look at."""

from pathlib import Path

import numpy as np
import pytest

from relume.capture.bracket import Bracket
from relume.capture.calibration import Calibration, recover_response
from synthetic import NOISELESS, wide_scene

SHARED = Path(__file__).resolve().parents[3] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of sample files beside the repository; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip(f"the sample files in {SHARED} are not here")
    return SHARED


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
