"""Motion blur and soft focus in linear light, as a lens and a shutter make them: bright streaks stay bright.

At the border the picture goes on as its mirror image, pixel for pixel: constant light stays constant and what a blur
carries out of the frame comes back in. The weights by which a blur gathers pixels are of a Gaussian, or of light that
moves along a straight line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from relume.image.filtering import Spread, spread_through
from relume.image.radiance import RadianceMap

REACH = 8.0
"""Deviations to which a Gaussian is followed: light a million times brighter than its surroundings ends unseen."""
_TOGETHER = 64  # rows or columns that are transformed at once


def motion_blurred(picture: RadianceMap, length: float, angle: float = 0.0) -> RadianceMap:
    """What a shutter sees while the picture moves along a straight line at an even speed.

    length : of the way, pixels; at most the picture's diagonal
    angle : of the line, radians, anticlockwise from the right; 0 is horizontal

    The mean is kept exactly by level and upright lines; by slanted ones but for light within `length` of a corner.
    Raises ValueError for another length, NaN or infinite radiance.
    """
    width, height = picture.size
    if not 0 <= length <= np.hypot(width, height):
        raise ValueError(
            f"the length is {length:g} pixels; expected 0 to the diagonal, {np.hypot(width, height):.0f} pixels"
        )
    if not np.isfinite(angle):
        raise ValueError(f"the angle is {angle}; expected radians")
    # Not `develop`'s StraightMotion, which averages what a camera saw: an edit keeps the mean, variance and marks.
    streak = streak_kernel(length, angle)
    return spread_through(picture, _convolution(streak), _convolution(streak**2))


def soft_blurred(picture: RadianceMap, sigma: float, *, share: float = 1.0) -> RadianceMap:
    """The picture out of focus, by a Gaussian; with a share below 1 a sharp picture with a glow, soft focus.

    sigma : standard deviation, pixels; at most the longer side
    share : of the light that is blurred; 1 is all of it

    The mean is kept exactly. Raises ValueError for another sigma or share, NaN or infinite radiance.
    """
    if not 0 <= sigma <= max(picture.size):
        raise ValueError(f"sigma is {sigma:g} pixels; expected 0 to the longer side, {max(picture.size)} pixels")
    if not 0 <= share <= 1:
        raise ValueError(f"the share is {share:g}; expected 0 to 1")
    taps = gaussian_taps(sigma)
    blur, square = _symmetric(taps), _symmetric(taps**2)

    def glow(field: np.ndarray) -> np.ndarray:
        return (1 - share) * field + share * blur(field)

    def glow_squared(field: np.ndarray) -> np.ndarray:
        # The middle weight is (1 − s) + s·w, the others are s·w.
        middle = (1 - share) ** 2 + 2 * (1 - share) * share * taps[0] ** 2
        return middle * field + share**2 * square(field)

    return spread_through(picture, glow, glow_squared)


def streak_kernel(length: float, angle: float) -> np.ndarray:
    """The time that a moving pixel spends over each of its neighbours, shared by area: odd sides, sum 1.

    length : pixels
    angle : radians, anticlockwise from the right; rows count downwards
    """
    rows, columns, weights = line_weights(length * np.cos(angle), -length * np.sin(angle))
    reach = np.abs(rows).max(), np.abs(columns).max()
    kernel = np.zeros((2 * reach[0] + 1, 2 * reach[1] + 1))
    kernel[rows + reach[0], columns + reach[1]] = weights
    return kernel


def gaussian_taps(sigma: float) -> np.ndarray:
    """Weights of the middle pixel and of its neighbours to one side: the Gaussian's share of each pixel's width.

    sigma : standard deviation, pixels
    None is negative, and on both sides together they sum to 1.
    """
    from scipy.special import erf

    if sigma == 0:
        return np.ones(1)
    edges = (np.arange(int(np.ceil(REACH * sigma)) + 2) - 0.5) / (sigma * np.sqrt(2))
    taps = np.diff(erf(edges)) / 2
    return taps / (taps[0] + 2 * taps[1:].sum())


def mirrored_transfer(taps: np.ndarray, size: int) -> np.ndarray:
    """By what symmetric taps scale each cosine wave (size,) of a line of pixels that goes on as its mirror image.

    taps : of the middle pixel and of its neighbours to one side
    """
    from scipy.fft import rfft

    # Far taps fall on the same pixels again, mirrored and mirrored back.
    folded = np.zeros(2 * size)
    places = np.arange(len(taps))
    np.add.at(folded, places % (2 * size), taps)
    np.add.at(folded, -places[1:] % (2 * size), taps[1:])
    return np.real(np.asarray(rfft(folded)))[:size]


def line_weights(
    dx: float,
    dy: float,
    light: Callable[[np.ndarray], np.ndarray] = np.ones_like,
    bends: Sequence[float] = (-0.5, 0.5),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (N,) int64 relative to a pixel, and the weights (N,) float64, sum 1, that it gathers from there
    while it moves evenly by `dx` pixels right and `dy` down and the picture is bilinear between its pixels.

    light : let through at times from −½ to ½, all the same unless given
    bends : the times between which `light` is straight, first and last included

    They are exact: between crossings of the pixel lattice and bends of the light the bilinear weight times the light is
    a cubic of the time, which two Gauss–Legendre nodes integrate (Abramowitz & Stegun 1964, 25.4.29).
    """
    bounds = [np.array(bends)]
    for extent in (abs(dx), abs(dy)):
        if extent > 0:
            lattice = np.arange(-np.floor(extent / 2), np.floor(extent / 2) + 1)
            bounds.append(np.clip(lattice / extent, -0.5, 0.5))
    times = np.unique(np.concatenate(bounds))
    middle, radius = (times[1:] + times[:-1]) / 2, np.diff(times) / 2
    moments = (middle[:, None] + radius[:, None] * np.array([-1, 1]) / np.sqrt(3)).ravel()
    spent = np.repeat(radius, 2) * light(moments)
    x, y = moments * dx, moments * dy
    left, above = np.floor(x), np.floor(y)
    rows, columns, weights = [], [], []
    for down in (0, 1):
        for right in (0, 1):
            rows.append(above + down)
            columns.append(left + right)
            weights.append(spent * np.abs(1 - right - (x - left)) * np.abs(1 - down - (y - above)))
    places, index = np.unique(np.stack([np.concatenate(rows), np.concatenate(columns)]), axis=1, return_inverse=True)
    summed = np.bincount(index.ravel(), np.concatenate(weights), places.shape[1])
    kept = summed > 1e-12
    taps = places[:, kept].astype(np.int64)
    return taps[0], taps[1], summed[kept] / summed[kept].sum()


def scale_waves(plane: np.ndarray, down: np.ndarray, across: np.ndarray) -> None:
    """Multiply the cosine series of a plane (H, W) float64, in place, by a factor for each row's and column's wave."""
    from scipy.fft import dct, idct

    for left in range(0, plane.shape[1], _TOGETHER):
        band = plane[:, left : left + _TOGETHER]
        band[:] = idct(dct(band, axis=0, workers=-1) * down[:, None], axis=0, workers=-1)
    for top in range(0, plane.shape[0], _TOGETHER):
        band = plane[top : top + _TOGETHER]
        band[:] = idct(dct(band, axis=1, workers=-1) * across, axis=1, workers=-1)


def _convolution(kernel: np.ndarray) -> Spread:
    from scipy.signal import oaconvolve

    reach = [side // 2 for side in kernel.shape]

    def spread(field: np.ndarray) -> np.ndarray:
        padded = np.pad(field, [(reach[0],) * 2, (reach[1],) * 2, (0, 0)], mode="symmetric")
        return oaconvolve(padded, kernel[..., None], mode="valid", axes=(0, 1))

    return spread


def _symmetric(taps: np.ndarray) -> Spread:
    """The separable convolution with symmetric taps of a picture mirrored at its border: a product of cosine series."""

    def spread(field: np.ndarray) -> np.ndarray:
        down, across = (mirrored_transfer(taps, size) for size in field.shape[:2])
        planes = [field[..., channel].astype(np.float64) for channel in range(field.shape[2])]
        for plane in planes:
            scale_waves(plane, down, across)
        return np.stack(planes, axis=-1)

    return spread
