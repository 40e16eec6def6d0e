"""Motion blur and soft focus in linear light, as a lens and a shutter make them: bright streaks stay bright.

At the border the picture goes on as its mirror image, pixel for pixel: constant light stays constant and what a blur
carries out of the frame comes back in.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import dctn, idctn
from scipy.signal import oaconvolve

from relume.image.blur_weights import gaussian_taps, line_weights, mirrored_transfer
from relume.image.filtering import Spread, spread_through
from relume.image.radiance import RadianceMap


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


def _convolution(kernel: np.ndarray) -> Spread:
    reach = [side // 2 for side in kernel.shape]

    def spread(field: np.ndarray) -> np.ndarray:
        padded = np.pad(field, [(reach[0],) * 2, (reach[1],) * 2, (0, 0)], mode="symmetric")
        return oaconvolve(padded, kernel[..., None], mode="valid", axes=(0, 1))

    return spread


def _symmetric(taps: np.ndarray) -> Spread:
    """The separable convolution with symmetric taps of a picture mirrored at its border: a product of cosine series."""

    def spread(field: np.ndarray) -> np.ndarray:
        down, across = (mirrored_transfer(taps, size) for size in field.shape[:2])
        waves = dctn(field, axes=(0, 1), workers=-1)
        waves *= (down[:, None] * across)[..., None]
        return np.asarray(idctn(waves, axes=(0, 1), workers=-1))

    return spread
