"""Tables of measured surfaces that are not measured: of a formula, and MERL files written from them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from relume.scene.materials.measured import MERL_SCALE, MERL_SHAPE, MeasuredBRDF


def directions_of(theta_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of unit vectors (…, 3) of these angles in radians, with h towards +x: the inverse of the angles."""
    sine = np.sin(theta_d)
    x, y, z = sine * np.cos(phi_d), sine * np.sin(phi_d), np.cos(theta_d)
    cosine_h, sine_h = np.cos(theta_h), np.sin(theta_h)
    pair = [
        np.stack([cosine_h * s * x + sine_h * z, s * y + 0 * theta_h, cosine_h * z - sine_h * s * x], -1)
        for s in (1.0, -1.0)
    ]
    return pair[0], pair[1]


def middles(shape: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """θh (H, 1, 1), θd (1, D, 1) and φd (1, 1, P) at the middles of a table's entries, radians."""
    shares = [(np.arange(count) + 0.5) / count for count in shape]
    return (
        np.pi / 2 * shares[0][:, None, None] ** 2,
        np.pi / 2 * shares[1][None, :, None],
        np.pi * shares[2][None, None, :],
    )


def tabulated(brdf, shape: tuple[int, int, int] = MERL_SHAPE, name: str = "table") -> MeasuredBRDF:
    """The values of a BRDF at the middles of a table's entries."""
    pair = directions_of(*np.broadcast_arrays(*middles(shape)))
    return MeasuredBRDF(brdf.evaluate(*pair).astype(np.float32), name)


def write_merl(path: Path, values: np.ndarray) -> Path:
    """A .binary file of values (90, 90, 180, 3) in 1/sr."""
    raw = np.moveaxis(values, -1, 0) / np.array(MERL_SCALE)[:, None, None, None]
    path.write_bytes(struct.pack("<3i", *values.shape[:3]) + raw.astype("<f8").tobytes())
    return path
