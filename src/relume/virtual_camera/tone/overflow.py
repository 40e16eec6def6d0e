"""Light that single precision could not reckon with, held at what it can."""

from __future__ import annotations

import numpy as np

from relume._kernel import in_threads

MOST = 1e30
"""What luminances and display values are held at: the sun has 1.6e9 cd/m², and float32 ends at 3.4e38, so that sums
and products with anything an operator knows stay finite."""
_ROWS = 64


def without_overflow(radiance: np.ndarray, scale: float) -> np.ndarray:
    """Radiance (H, W, 3) float32 none of which is above MOST, nor above it when multiplied by `scale`; the input itself
    where there is nothing to hold."""
    limit = np.float32(MOST / max(scale, 1.0))
    highest = max(in_threads(lambda begin, end: radiance[begin:end].max(), len(radiance), chunk=_ROWS))
    return radiance if highest <= limit else np.minimum(radiance, limit)
