"""Layers one over the other (Porter & Duff 1984)."""

from __future__ import annotations

import numpy as np


def over(foreground: np.ndarray, matte: np.ndarray, plate: np.ndarray) -> np.ndarray:
    """The foreground matted over a plate: foreground + (1 − matte)·plate.

    foreground : (H, W, 3) radiance, premultiplied: what the objects add to each pixel, black where there are none, as
        `Prefiltered(background=False)` renders it
    matte : (H, W), the share of each pixel that the objects cover, 0 to 1
    plate : (H, W, 3) radiance on the same scale

    A pixel that the objects do not cover keeps the plate's value to the bit. Raises ValueError when the sizes differ.
    """
    if foreground.shape != plate.shape or matte.shape != plate.shape[:2]:
        raise ValueError(
            f"foreground {foreground.shape}, matte {matte.shape} and plate {plate.shape} differ in size; "
            "render with a camera of the plate's size"
        )
    cover = matte[..., None].astype(np.float64)
    return np.where(cover > 0, foreground + (1 - cover) * plate, plate).astype(np.float32)
