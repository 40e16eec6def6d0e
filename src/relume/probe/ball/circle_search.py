"""Where circles are likely in a picture: at every centre and radius, how much of the circle has an edge along it.

The share of the circle on which the brightness changes across it and not along it is taken (a Hough transform by
convolution, blind to how strong the edges are). Of circles that the picture cuts, the part that lies in it counts.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy import fft
from scipy.ndimage import maximum_filter

SEARCH_SIDE = 256
"""Longer side, in pixels, of the picture in which circles are sought; finer ones are fitted afterwards."""
COARSE = 40.0
"""Radius, in pixels, from which on circles are sought at half that size: a quarter of the time."""
LEAST_RADIUS = 5.0
"""Pixels of that picture: smaller ones are specks."""
LEAST_SHOWN = 0.4
"""The share of a circle that has to lie in the picture."""
CIRCLES = 32
"""The likeliest circles, which are fitted."""
Circle = tuple[float, float, float]


def likeliest_circles(picture: np.ndarray) -> list[Circle]:
    """The likeliest circles (x, y, radius), in pixels of `picture` (H, W), even luminance; the likeliest first."""
    height, width = picture.shape
    largest = 0.62 * max(min(height, width), 0.75 * max(height, width))
    found = _at_scale(picture, LEAST_RADIUS, min(COARSE, largest))
    if largest > COARSE:
        half = cv2.resize(picture, (max(width // 2, 1), max(height // 2, 1)), interpolation=cv2.INTER_AREA)
        across, down = width / half.shape[1], height / half.shape[0]
        mean = float(np.sqrt(across * down))
        coarse = _at_scale(half, COARSE / 2, largest / 2)
        found += [(worth, x * across, y * down, radius * mean) for worth, x, y, radius in coarse]
    found.sort(key=lambda circle: -circle[0])
    chosen: list[Circle] = []
    for _, cx, cy, radius in found:
        if all(np.hypot(cx - x, cy - y) + abs(radius - r) > max(2.0, 0.05 * radius) for x, y, r in chosen):
            chosen.append((cx, cy, radius))
        if len(chosen) == CIRCLES:
            break
    return chosen


def _at_scale(picture: np.ndarray, least: float, largest: float) -> list[tuple[float, float, float, float]]:
    """Circles with radii between two, each with its worth: (worth, x, y, radius)."""
    # Beyond the picture is a margin in which nothing changes, for circles whose middle is near an edge.
    margin = int(0.3 * largest) + 2
    gx, gy = gradient(picture.astype(np.float32), 1.0)
    strength = gx**2 + gy**2
    # Each direction of change counts alike once it stands out of the noise.
    level = strength + np.percentile(strength, 50) + 1e-8
    height, width = (int(fft.next_fast_len(side + 2 * margin, True) or 0) for side in picture.shape)
    inner = slice(margin, margin + picture.shape[0]), slice(margin, margin + picture.shape[1])

    def spectrum(image: np.ndarray) -> np.ndarray:
        wide = np.zeros((height, width), np.float32)
        wide[inner] = image
        return np.asarray(fft.rfft2(wide))

    across, along = spectrum((gx**2 - gy**2) / level), spectrum(2 * gx * gy / level)
    shown = spectrum(np.ones_like(picture))
    y, x = np.indices((height, width))
    x, y = (x + width // 2) % width - width // 2, (y + height // 2) % height - height // 2
    distance, angle = np.hypot(x, y).astype(np.float32), np.arctan2(y, x)
    double, other = np.cos(2 * angle).astype(np.float32), np.sin(2 * angle).astype(np.float32)
    found: list[tuple[float, float, float, float]] = []
    radius = least
    while radius < largest:
        thick = max(0.8, 0.02 * radius)
        ring = np.exp(-0.5 * ((distance - np.float32(radius)) / np.float32(thick)) ** 2)
        ring /= ring.sum()
        # Change across the circle minus change along it: (g·n)² − (g·t)², with n at angle ψ.
        total = across * np.conj(np.asarray(fft.rfft2(ring * double)))
        total += along * np.conj(np.asarray(fft.rfft2(ring * other)))
        share = np.asarray(fft.irfft2(total, s=(height, width)))[inner]
        part = np.asarray(fft.irfft2(shown * np.conj(np.asarray(fft.rfft2(ring))), s=(height, width)))[inner]
        # A short arc is matched by chance more easily than a long one, and so is a small circle.
        share = np.where(part > LEAST_SHOWN, share / np.maximum(part, LEAST_SHOWN) ** 0.7, 0) * radius**0.25
        peak = np.where(share == maximum_filter(share, 7), share, 0)
        for index in np.argpartition(peak, -4, axis=None)[-4:]:
            row, column = divmod(int(index), share.shape[1])
            found.append((float(share[row, column]), column + 0.5, row + 0.5, float(radius)))
        radius += 0.95 * thick
    return found


def gradient(picture: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """The derivative of the blurred picture to the right and down."""
    soft = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), blur)
    wide = cv2.copyMakeBorder(soft, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return (wide[1:-1, 2:] - wide[1:-1, :-2]) / 2, (wide[2:, 1:-1] - wide[:-2, 1:-1]) / 2
