"""Self-identifying pictures and the shared sample files that the tests of image files use."""

from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of sample files beside the repository; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip(f"the sample files in {SHARED} are not here")
    return SHARED


@pytest.fixture
def numbered() -> np.ndarray:
    """(5, 7, 3) float32 in which every value tells where it is: x + 1000·y, plus a quarter a channel."""
    y, x, channel = np.indices((5, 7, 3))
    return (x + 1000 * y + channel / 4).astype(np.float32)
