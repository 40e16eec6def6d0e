"""Which pixels of the plate say something about a real surface, and what the others are taken to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_bands
from relume.image.bilinear import bilinear

EDGE = 2
"""Pixels along the outline of a surface that are not trusted: a camera's pose is known to about one, and a pixel of the
outline shows what is behind as well."""


def trustworthy(shown: np.ndarray, clipped: np.ndarray | None) -> np.ndarray:
    """(H, W) bool: pixels well inside of a surface that were measured.

    shown : (H, W) bool, where the plate shows the surface
    clipped : the plate's marks, 0 where it was measured
    """
    from scipy.ndimage import binary_erosion

    # Beyond the frame the surface goes on.
    inside = binary_erosion(shown, np.ones((3, 3), bool), EDGE, border_value=1)
    return inside if clipped is None else inside & (clipped == 0)


def filled_in(values: np.ndarray, known: np.ndarray, parts: np.ndarray, *, own: bool = False) -> np.ndarray:
    """An image (H, W, C) whose unknown pixels continue the known ones: first those of the same part, then any.

    own : whether nobody else needs `values`, which then becomes the result and is not copied
    Each takes the mean of the known pixels in the smallest square round it that holds any (Gortler et al. 1996, §4.4).
    """
    result, done = values if own else values.copy(), known.copy()
    for part in range(int(parts.max(initial=-1)) + 1):
        inside = parts == part
        if (known & inside).any() and not known[inside].all():
            _spread(result, known & inside, inside & ~known)
            done |= inside
    if done.any() and not done.all():
        _spread(result, done, ~done)
    return result


def _spread(values: np.ndarray, known: np.ndarray, wanted: np.ndarray) -> None:
    """Give the wanted pixels of values (H, W, C) means over ever larger squares where the smaller ones hold nothing
    known, laid out smoothly again. Of the whole size only these pixels are made; they are not known themselves."""
    levels = [_halved(values, known)]
    while max(levels[-1][0].shape[:2]) > 1:
        levels.append(_halved(*levels[-1]))
    coarse = levels.pop()[0]
    while levels:
        coarse = _over(*levels.pop(), coarse)
    height, width = known.shape
    x, y = (np.arange(width) + 0.5) / 2, (np.arange(height) + 0.5) / 2

    def work(rows: slice) -> None:
        if wanted[rows].any():
            values[rows][wanted[rows]] = _looked_up(coarse, x, y[rows])[wanted[rows]]

    in_bands(height, width, work)


def _over(mean: np.ndarray, weight: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """The mean by its weight over what is known of it at half its size."""
    result, (height, width) = np.empty_like(mean), mean.shape[:2]
    x, y = (np.arange(width) + 0.5) / 2, (np.arange(height) + 0.5) / 2

    def work(rows: slice) -> None:
        doubled = _looked_up(coarse, x, y[rows])
        result[rows] = weight[rows] * mean[rows] + (1 - weight[rows]) * doubled

    in_bands(height, width, work)
    return result


@dataclass(frozen=True, eq=False)
class Enlarged:
    """Smooth pictures at a large plate's size, whose rows are made when they are asked for: `enlarged[rows]`, float32.

    pictures : (h, w, 3) each, and the part of the plate that shows it; None for all of it, the first
    parts : (H, W) int
    """

    pictures: Sequence[tuple[int | None, np.ndarray]]
    parts: np.ndarray

    def __getitem__(self, rows: slice) -> np.ndarray:
        height, width = self.parts.shape
        own = self.parts[rows]
        result = np.zeros((*own.shape, 3), np.float32)
        for part, picture in self.pictures:
            x = (np.arange(width) + 0.5) * picture.shape[1] / width
            y = (np.arange(height)[rows] + 0.5) * picture.shape[0] / height
            np.copyto(result, _looked_up(picture, x, y), where=True if part is None else (own == part)[..., None])
        return result


def _looked_up(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return bilinear(picture, *np.broadcast_arrays(x[None, :], y[:, None])).astype(np.float32)


def _halved(mean: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The weighted mean over squares of four pixels; a square that knows one of its four knows its mean.

    weight : (h, w, 1), or (h, w) bool, which pixels are known
    """
    height, width = mean.shape[:2]
    half = -(-height // 2), -(-width // 2)
    means, shares = np.empty((*half, mean.shape[2]), np.float32), np.empty((*half, 1), np.float32)

    def work(rows: slice) -> None:
        part = slice(2 * rows.start, 2 * rows.stop)
        odd = [(0, -mean[part].shape[0] % 2), (0, width % 2), (0, 0)]
        own, each_known = mean[part], weight[part]
        if each_known.dtype == bool:
            each_known = each_known.astype(np.float32)[..., None]
            own = np.where(each_known > 0, own, 0).astype(np.float32, copy=False)
        total, share = (np.pad(each, odd) for each in (own * each_known, each_known))
        total, share = (
            each.reshape(each.shape[0] // 2, 2, half[1], 2, -1).sum((1, 3)) for each in (total, share)
        )  # fmt: skip
        means[rows], shares[rows] = total / np.maximum(share, 1e-6), np.minimum(share, 1)

    in_bands(*half, work)
    return means, shares
