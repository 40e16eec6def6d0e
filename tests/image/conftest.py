"""Self-identifying pictures that the tests of image files use."""

import numpy as np
import pytest


@pytest.fixture
def numbered() -> np.ndarray:
    """(5, 7, 3) float32 in which every value says where it is: x + 1000·y, plus a quarter a channel."""
    y, x, channel = np.indices((5, 7, 3))
    return (x + 1000 * y + channel / 4).astype(np.float32)
