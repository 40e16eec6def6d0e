"""Motion blur and soft focus in linear light, as a lens and a shutter make them: bright streaks stay bright.

At the border the picture goes on as its mirror image, pixel for pixel: constant light stays constant and what a blur
carries out of the frame comes back in.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import dctn, idctn, rfft
from scipy.signal import oaconvolve
from scipy.special import erf

from relume.image.filtering import Spread, spread_through
from relume.image.radiance import RadianceMap

_REACH = 8.0
"""Deviations to which a Gaussian is followed: light a million times brighter than its surroundings ends unseen."""


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
    taps = _gaussian(sigma)
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
    step = np.array([np.cos(angle), -np.sin(angle)])
    ends = np.abs(step) * length / 2
    half = np.ceil(ends - 1e-12).astype(int)
    if length == 0:
        return np.ones((1, 1))
    # Between crossings of the pixel lattice the area shared is a quadratic of the time: two nodes integrate it.
    crossings = [np.arange(-h, h + 1) / s for h, s in zip(half, step, strict=True) if abs(s) > 1e-12]
    times = np.unique(np.clip(np.concatenate([*crossings, [-length / 2, length / 2]]), -length / 2, length / 2))
    nodes, weights = np.polynomial.legendre.leggauss(2)
    middle, radius = (times[1:] + times[:-1]) / 2, np.diff(times) / 2
    moments = (middle[:, None] + radius[:, None] * nodes).ravel()
    spent = (radius[:, None] * weights).ravel() / length
    kernel = np.zeros((2 * half[1] + 3, 2 * half[0] + 3))
    x, y = (moments * s for s in step)
    left, above = np.floor(x).astype(int), np.floor(y).astype(int)
    for down, by_row in ((0, 1 - (y - above)), (1, y - above)):
        for right, by_column in ((0, 1 - (x - left)), (1, x - left)):
            np.add.at(kernel, (above + down + half[1] + 1, left + right + half[0] + 1), spent * by_row * by_column)
    return kernel / kernel.sum()


def _convolution(kernel: np.ndarray) -> Spread:
    reach = [side // 2 for side in kernel.shape]

    def spread(field: np.ndarray) -> np.ndarray:
        padded = np.pad(field, [(reach[0],) * 2, (reach[1],) * 2, (0, 0)], mode="symmetric")
        return oaconvolve(padded, kernel[..., None], mode="valid", axes=(0, 1))

    return spread


def _gaussian(sigma: float) -> np.ndarray:
    """Weights of the middle pixel and of its neighbours to one side: the Gaussian's share of each pixel's width."""
    if sigma == 0:
        return np.ones(1)
    edges = (np.arange(int(np.ceil(_REACH * sigma)) + 2) - 0.5) / (sigma * np.sqrt(2))
    taps = np.diff(erf(edges)) / 2
    return taps / (taps[0] + 2 * taps[1:].sum())


def _symmetric(taps: np.ndarray) -> Spread:
    """The separable convolution with symmetric taps of a picture mirrored at its border: a product of cosine series."""

    def transfer(size: int) -> np.ndarray:
        # Far taps fall on the same pixels again, mirrored and mirrored back.
        folded = np.zeros(2 * size)
        places = np.arange(len(taps))
        np.add.at(folded, places % (2 * size), taps)
        np.add.at(folded, -places[1:] % (2 * size), taps[1:])
        return np.real(np.asarray(rfft(folded)))[:size]

    def spread(field: np.ndarray) -> np.ndarray:
        waves = dctn(field, axes=(0, 1), workers=-1)
        waves *= (transfer(field.shape[0])[:, None] * transfer(field.shape[1]))[..., None]
        return np.asarray(idctn(waves, axes=(0, 1), workers=-1))

    return spread
