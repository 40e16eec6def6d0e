"""What the eye sees of a picture at each scale: blurs of it an octave apart, kept no larger than they need be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import kernel

PEAKS = (16.0, 8.0, 4.0, 2.0, 1.0, 0.5)
"""Cycles per degree that the six bands see best (Pattanaik et al. 1998)."""
BLUR_OF_PEAK = float(np.sqrt(np.log(4) / 6) / np.pi)
"""Deviation in degrees, times the peak, of the sharper of two Gaussians whose deviations are as 1 to 2: the transform
of their difference, e^(−2π²σ²f²) − e^(−8π²σ²f²), is greatest where 2π²σ²f² = ln 4/3."""
_LEAST = 1.0
"""Deviation, pixels, of the sharpest blur kept at a size: at half the lattice's frequencies it has lost 99 %."""
_BAND = 64


@dataclass(frozen=True, eq=False)
class Level:
    """A blurred picture.

    pixels : (h, w, C) float32
    variance : in areas of a pixel, of the blur that `pixels` still lack: small ones are made where they are asked for,
        because blurs of the picture's full size would each need as much memory as the picture
    size : of the pixels, in the picture's pixels: a power of 2
    """

    pixels: np.ndarray
    variance: float
    size: int

    def rows(self, begin: int, end: int) -> np.ndarray:
        """Rows begin…end, blurred."""
        return blurred_rows(self.pixels, self.variance, begin, end)


def levels(picture: np.ndarray, degrees_per_pixel: float) -> list[Level]:
    """Blurs of a picture, the sharpest first: band i is the difference of blur i and the one before, or the picture.

    picture : (H, W, C) float32 of any size; at its border it goes on as its mirror image
    degrees_per_pixel : the angle of a pixel

    The picture stands for the sharpest Gaussian of the paper, so that the first band holds all that is finer too: a
    picture has what it has, and the eye that looks at it does its own blurring (Burt & Adelson 1983, with the
    deviations of the angles instead of those of the lattice).
    """
    pixels, size, variance = np.ascontiguousarray(picture, np.float32), 1, 0.0
    found: list[Level] = []
    for peak in PEAKS:
        wanted = 2 * BLUR_OF_PEAK / peak / degrees_per_pixel
        # Halving blurs too, by the weights 1 3 3 1, whose variance is 3/4 of a pixel's area.
        while wanted >= _LEAST * 2 * size and max(pixels.shape[:2]) > 1:
            pixels, variance, size = _halved(pixels), variance + 0.75 * size**2, 2 * size
        # So does the way back to the picture's size, octave by octave.
        on_the_way_back = (size**2 - 1) / 4
        missing = max(wanted**2 - variance - on_the_way_back, 0.0)
        if size > 1:
            pixels, variance = _blurred(pixels, missing / size**2), variance + missing
        found.append(Level(pixels, 0.0 if size > 1 else missing, size))
    return found


def blurred_rows(pixels: np.ndarray, variance: float, begin: int, end: int) -> np.ndarray:
    """Rows begin…end of pixels (h, w, C) float32 blurred by the Gaussian of a lattice (Lindeberg 1990), e^(−t) I_n(t).

    variance : t, in areas of a pixel; exact for small ones too, where samples of a Gaussian are not
    """
    from scipy.special import ive

    reach = int(np.ceil(4.5 * np.sqrt(variance)))
    if reach == 0:
        return pixels[begin:end]
    taps = ive(np.arange(-reach, reach + 1), variance)
    taps = (taps / taps.sum()).astype(np.float32)
    height, width, channels = pixels.shape
    down = np.empty((end - begin, width, channels), np.float32)
    _blur_down(pixels.reshape(height, -1), taps, down.reshape(end - begin, -1), begin)
    result = np.empty_like(down)
    _blur_across(down, taps, result)
    return result


def _blurred(pixels: np.ndarray, variance: float) -> np.ndarray:
    result = np.empty_like(pixels)

    def blur(begin: int, end: int) -> None:
        result[begin:end] = blurred_rows(pixels, variance, begin, end)

    in_threads(blur, len(pixels), chunk=_BAND)
    return result


def _halved(pixels: np.ndarray) -> np.ndarray:
    height, width, channels = pixels.shape
    half = np.empty(((height + 1) // 2, (width + 1) // 2, channels), np.float32)
    in_threads(lambda begin, end: _halve(pixels, half, begin, end), half.shape[0], chunk=_BAND)
    return half


@kernel
def _blur_down(source, taps, target, first):
    height = source.shape[0]
    reach = len(taps) // 2
    for y in range(target.shape[0]):
        row = target[y]
        row[:] = 0
        for k in range(len(taps)):
            place = (first + y + k - reach) % (2 * height)
            other = source[min(place, 2 * height - 1 - place)]
            weight = taps[k]
            for x in range(len(row)):
                row[x] += weight * other[x]


@kernel
def _blur_across(source, taps, target):
    height, width, channels = source.shape
    reach = len(taps) // 2
    # A row with its mirror images is one run of numbers, which the compiler turns into vectors.
    wide = np.empty((width + 2 * reach) * channels, np.float32)
    for y in range(height):
        for x in range(width + 2 * reach):
            place = (x - reach) % (2 * width)
            place = min(place, 2 * width - 1 - place)
            for c in range(channels):
                wide[x * channels + c] = source[y, place, c]
        row = target[y].reshape(-1)
        row[:] = 0
        for k in range(len(taps)):
            weight = taps[k]
            other = wide[k * channels :]
            for i in range(len(row)):
                row[i] += weight * other[i]


@kernel
def _halve(source, target, begin, end):
    height, width, channels = source.shape
    for y in range(begin, end):
        for x in range(target.shape[1]):
            for c in range(channels):
                total = np.float32(0)
                for j in range(4):
                    row = (2 * y - 1 + j) % (2 * height)
                    row = min(row, 2 * height - 1 - row)
                    line = np.float32(0)
                    for i in range(4):
                        column = (2 * x - 1 + i) % (2 * width)
                        column = min(column, 2 * width - 1 - column)
                        line += np.float32(3 if 0 < i < 3 else 1) * source[row, column, c]
                    total += np.float32(3 if 0 < j < 3 else 1) * line
                target[y, x, c] = total / np.float32(64)
