"""Luminance and chroma: Y of every pixel, and of every fourth how red and how blue it is, as OpenEXR stores them.

RY = (R − Y) / Y and BY = (B − Y) / Y, where Y is the luminance of the file's own primaries. The chroma of the pixels
between is interpolated by the windowed sinc of 27 taps that OpenEXR reads with, so that both read the same picture
("Technical Introduction to OpenEXR", "Luminance/Chroma Images"; weights: ImfRgbaYca, 27-pixel reconstruction filter).
"""

from __future__ import annotations

import numpy as np

from relume.image.primaries import Primaries

# Of the samples 1, 3, 5, … 13 pixels to either side; they sum to ½.
_WEIGHTS = (0.627123, -0.186077, 0.087929, -0.043159, 0.019597, -0.007540, 0.002128)


def to_rgb(luminance: np.ndarray, red: np.ndarray, blue: np.ndarray, primaries: Primaries) -> list[np.ndarray]:
    """Planes R, G and B, (H, W) float32, in `primaries`.

    luminance : (H, W) Y, any float
    red, blue : RY and BY, (⌈H/2⌉, ⌈W/2⌉) or as large as `luminance`

    Raises ValueError for another size. Unlike OpenEXR, which makes saturated pixels paler and clips negative ones,
    nothing is changed after the interpolation.
    """
    of_red, _, of_blue = primaries.to_xyz()[1].tolist()
    light = luminance.astype(np.float32, copy=False)
    r = _upsampled(red, light.shape)
    b = _upsampled(blue, light.shape)
    for plane in (r, b):
        plane += 1
        plane *= light
    # Grey stays grey to the last bit: R = G = B = Y where both chromas are 0.
    green = light + (light - r) * np.float32(of_red / (1 - of_red - of_blue))
    green += (light - b) * np.float32(of_blue / (1 - of_red - of_blue))
    return [r, green, b]


def _upsampled(chroma: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """(H, W) float32 of a chroma of that size or of every second pixel in x and y."""
    if chroma.shape == shape:
        return chroma.astype(np.float32)
    if chroma.shape != tuple(-(-length // 2) for length in shape):
        raise ValueError(f"chroma is {chroma.shape}; expected {shape}, or half of that")
    tall = _doubled(chroma.astype(np.float32), shape[0])
    return _doubled(tall.T, shape[1]).T


def _doubled(samples: np.ndarray, length: int) -> np.ndarray:
    """(length, N) of every second row: those between are interpolated, the edges go on as they are."""
    rows = np.empty((length, samples.shape[1]), np.float32)
    rows[::2] = samples
    count, reach = length // 2, len(_WEIGHTS)
    padded = np.pad(samples, ((reach - 1, reach), (0, 0)), mode="edge")
    between = rows[1::2]
    between[...] = 0
    for i, weight in enumerate(_WEIGHTS):
        # Between samples k and k + 1 lies row 2k + 1; those 2i + 1 pixels away are samples k − i and k + 1 + i.
        between += np.float32(weight) * padded[reach - 1 - i : reach - 1 - i + count]
        between += np.float32(weight) * padded[reach + i : reach + i + count]
    return rows
