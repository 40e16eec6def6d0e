"""The loops of the raw merge: one frame added to the sums, and the sums made a mosaic of radiance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import inlined, kernel
from relume.image.radiance import BLACK, SATURATED

_ROWS = 64
"""Rows of one call; every photosite is its own sum, so the result does not depend on it."""


def mirrored(count: int) -> np.ndarray:
    """Indices −2 … count + 1 turned back at the first and last, which keeps the colour of a Bayer pattern."""
    return np.pad(np.arange(count), 2, mode="reflect")


@dataclass(frozen=True, eq=False)
class Frame:
    """A raw of a bracket as the merge sees it.

    mosaic : (H, W) uint16
    black : (2, 2) float64, the value of no light
    white : the value at which the signal is 1
    factor : t, light per unit of radiance
    noise : (shot, read): the signal's variance is shot · signal + read²
    saturation : the signal at which the sensor is saturated
    """

    mosaic: np.ndarray
    black: np.ndarray
    white: float
    factor: float
    noise: tuple[float, float]
    saturation: float


def accumulate(sums: np.ndarray, frame: Frame, shorter: Frame | None) -> None:
    """Add a frame to the sums, (4, H, W) float32: Σ w·x, Σ w, Σ w²·shot/t and Σ w²·read²/t² of every photosite.

    shorter : the frame added before, which had less light; None for the first, whose values bound what none measures
    """
    rows, columns = mirrored(frame.mosaic.shape[0]), mirrored(frame.mosaic.shape[1])
    before, (shot, read) = shorter or frame, frame.noise
    in_threads(
        lambda begin, end: _accumulate(
            sums[0], sums[1], sums[2], sums[3], frame.mosaic, frame.black, frame.white, frame.factor, shot, read,
            frame.saturation, before.mosaic, before.black, before.white, frame.factor / before.factor,
            shorter is None, rows, columns, begin, end,
        ),
        frame.mosaic.shape[0],
        chunk=_ROWS,
    )  # fmt: skip


@inlined
def _around(mosaic, y, x, above, below, left, right):
    """The mean of the eight nearest photosites of one colour."""
    beside = float(mosaic[y, left]) + mosaic[y, right] + mosaic[above, x] + mosaic[below, x]
    return (beside + mosaic[above, left] + mosaic[above, right] + mosaic[below, left] + mosaic[below, right]) / 8


@kernel
def _accumulate(
    total, weights, shot_part, read_part, mosaic, black, white, factor, shot, read, saturation, before, before_black,
    before_white, ratio, first, rows, columns, begin, end,
):  # fmt: skip
    deviation = np.sqrt(shot * saturation + read * read)
    ceiling = saturation * (1 - 1e-6)
    # Far below saturation the photosite's own value may decide: none that is truly saturated reads so low.
    doubtful, neighbours_ceiling = saturation - 14 * deviation, saturation - 5 * deviation
    for y in range(begin, end):
        above, below = rows[y], rows[y + 4]
        for x in range(mosaic.shape[1]):
            left, right = columns[x], columns[x + 4]
            level = black[y & 1, x & 1]
            scale = 1 / (white - level)
            signal = (mosaic[y, x] - level) * scale
            if first:
                total[y, x] = signal / factor
            if signal >= ceiling:
                continue
            expected = (_around(mosaic, y, x, above, below, left, right) - level) * scale
            if signal > doubtful:
                if expected > neighbours_ceiling:
                    continue
                # Where the neighbours are partly saturated their mean is too low; the shorter exposure has it whole.
                floor = before_black[y & 1, x & 1]
                foreseen = _around(before, y, x, above, below, left, right) - floor
                if foreseen / (before_white - floor) * ratio > neighbours_ceiling:
                    continue
            # Rounding to whole values is noise too, and an eighth of an electron stands for none among eight.
            fixed = read * read + scale * scale / 12
            weight = factor * factor / (fixed + shot * (max(expected, 0.0) + shot / 8))
            total[y, x] = weight * (signal / factor) + (total[y, x] if weights[y, x] > 0 else 0.0)
            weights[y, x] += weight
            shot_part[y, x] += weight * weight * shot / factor
            read_part[y, x] += weight * weight * fixed / (factor * factor)


def concluded(sums: np.ndarray, black: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mosaic of radiance, its variance and its clipped mask (0, SATURATED, BLACK); overwrites the sums."""
    _, height, width = sums.shape
    clipped = np.zeros((height, width), np.uint8)
    rows, columns = mirrored(height), mirrored(width)
    in_threads(lambda begin, end: _divide(sums[0], sums[1], clipped, begin, end), height, chunk=_ROWS)
    in_threads(
        lambda begin, end: _spread(sums[0], sums[1], sums[2], sums[3], clipped, rows, columns, begin, end),
        height,
        chunk=_ROWS,
    )
    in_threads(lambda begin, end: _bound(sums[0], sums[1], black, clipped, begin, end), height, chunk=_ROWS)
    return sums[0], sums[1], clipped


@kernel
def _divide(total, weights, clipped, begin, end):
    for y in range(begin, end):
        for x in range(total.shape[1]):
            if weights[y, x] > 0:
                total[y, x] /= weights[y, x]
            else:
                clipped[y, x] = SATURATED


@kernel
def _spread(radiance, weights, shot_part, read_part, clipped, rows, columns, begin, end):
    """Write the variance over the weights; its photon noise is that of the radiance with its neighbours, if alike.

    The photosite's own value alone would have a variance that rises and falls with its error, which in the dark makes
    the one of half of them too large.
    """
    for y in range(begin, end):
        for x in range(radiance.shape[1]):
            if clipped[y, x] != 0:
                weights[y, x] = np.inf
                continue
            weight, own = float(weights[y, x]), float(radiance[y, x])
            around = _around(radiance, y, x, rows[y], rows[y + 4], columns[x], columns[x + 4])
            smooth = (8 * around + own) / 9
            variance = (shot_part[y, x] * max(smooth, 0.0) + read_part[y, x]) / (weight * weight)
            if (own - smooth) ** 2 > 9 * variance:
                variance = (shot_part[y, x] * max(own, 0.0) + read_part[y, x]) / (weight * weight)
            weights[y, x] = variance


@kernel
def _bound(radiance, variance, black, clipped, begin, end):
    for y in range(begin, end):
        for x in range(radiance.shape[1]):
            # A file whose black is 0 cannot show less: where all frames read it, the light lies below the noise.
            if radiance[y, x] == 0 and black[y & 1, x & 1] == 0:
                clipped[y, x] = BLACK
                radiance[y, x] = 2 * np.sqrt(variance[y, x])
                variance[y, x] = np.inf
