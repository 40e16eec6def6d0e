"""Differential rendering: add to the photograph what the objects changed, and nothing else (Debevec 1998, §6)."""

from __future__ import annotations

import numpy as np


def differential(plate: np.ndarray, with_: np.ndarray, without: np.ndarray, matte: np.ndarray) -> np.ndarray:
    """matte · with + (1 − matte) · (plate + with − without), never below 0.

    plate, with_, without : (H, W, 3) float32 radiance on one scale: the photograph, the local scene rendered with the
        objects and without them
    matte : (H, W), the share of each pixel that the objects cover, 0 to 1
    A pixel that the objects neither cover nor change keeps the plate's value to the bit. Where a render is wrong by
    more than the plate's radiance (the paper's "LS_final negative") the result is 0.
    Raises ValueError when the sizes differ.
    """
    if not plate.shape == with_.shape == without.shape or matte.shape != plate.shape[:2]:
        raise ValueError(
            f"plate {plate.shape}, with {with_.shape}, without {without.shape} and matte {matte.shape} differ in size; "
            "render with a camera of the plate's size"
        )
    cover = matte[..., None].astype(np.float64)
    change = with_.astype(np.float64) - without
    picture = cover * with_ + (1 - cover) * (plate + change)
    touched = (cover > 0) | (change != 0)
    return np.where(touched, np.maximum(picture, 0), plate).astype(np.float32)
