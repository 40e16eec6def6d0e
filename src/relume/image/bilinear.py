"""Bilinear look-up in plain images: pixel centres at (i + ½), so point (0.5, 0.5) is the middle of the first pixel."""

from __future__ import annotations

import numpy as np


def bilinear(image: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values of `image` (H, W, …) at pixel coordinates x, y (right, down); beyond the border the edge goes on."""
    height, width = image.shape[:2]
    x, y = np.clip(x - 0.5, 0, width - 1), np.clip(y - 0.5, 0, height - 1)
    left, top = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    right, below = min(1, width - 1), min(1, height - 1)
    extra = (...,) + (None,) * (image.ndim - 2)
    fx, fy = (x - left)[extra], (y - top)[extra]
    # By one number a pixel, in half of the time, where the image need not be copied for that.
    flat = image.reshape(height * width, *image.shape[2:]) if image.flags.c_contiguous else None
    first = top * width + left

    def picked(down: int, across: int) -> np.ndarray:
        return image[top + down, left + across] if flat is None else flat.take(first + (down * width + across), 0)

    upper = picked(0, 0) * (1 - fx) + picked(0, right) * fx
    lower = picked(below, 0) * (1 - fx) + picked(below, right) * fx
    return upper * (1 - fy) + lower * fy
