"""The codes of Radiance pictures, without a file around them."""

from __future__ import annotations

import numpy as np

from relume.image.files.hdr.scanlines import encoded


def encode(radiance: np.ndarray) -> np.ndarray:
    """(..., 4) uint8 RGBE of (..., 3) float32, rounded to nearest; raises ValueError for pixels it cannot hold."""
    pieces, unfit, _ = encoded(np.reshape(radiance, (-1, 1, 3)), compressed=False)
    if unfit:
        raise ValueError(f"{unfit} of {np.size(radiance) // 3} pixels are negative, or others that it cannot hold")
    return np.concatenate([*pieces, np.empty(0, np.uint8)]).reshape(*np.shape(radiance)[:-1], 4)
