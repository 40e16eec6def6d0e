"""Angles between directions and between rotations, exact for small ones too (no arc cosine)."""

import numpy as np


def degrees_between(first, second):
    """Degrees (…) between directions (…, 3) of any length."""
    first, second = np.broadcast_arrays(np.asarray(first, np.float64), np.asarray(second, np.float64))
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second), axis=-1), np.sum(first * second, axis=-1)))


def degrees_turned(first, second) -> float:
    """Degrees by which one rotation (3, 3) turns from another; the chord of the rotation is |A − B|_F = √8 sin(θ/2)."""
    return float(np.degrees(2 * np.arcsin(min(np.linalg.norm(first - second) / np.sqrt(8), 1.0))))
