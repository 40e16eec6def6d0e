"""Whether two photographs show one scene, whatever their exposures and a shake of the hand between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter

from relume.capture.exposure.relative_brightness import Reduced

STRANGE = 0.36
"""Similarity below which photographs show different scenes: unrelated ones reach 0.27 at most, and pairs of one scene
that are four stops apart or hand-held lie above 0.46."""
_COARSE = 40  # blocks across: a hand's shake is less than two of them
_REACH = 2  # blocks
_VALUES = (12, 24, 48, 96)
"""Pixel values that are distinguished, coarsely against the noise of a black, finely for the little that a flat scene
shows; each picture pair is taken as it is most alike."""
_SURROUND = 9  # blocks; all pictures are lighter at the top and fall off at the edge, so only departures count


@dataclass(frozen=True, eq=False)
class Structure:
    """What is where in a photograph: ranks of coarse blocks less those around them, (V, h, w) for `_VALUES`."""

    ranks: np.ndarray


def structure(picture: Reduced) -> Structure:
    """The structure of a photograph made small; 0 outside the picture."""
    fine = max(1, round(max(picture.inside.shape) / _COARSE))
    height, width = (max(1, side // fine) for side in picture.inside.shape)
    grey = picture.encoded.mean(axis=2)[: height * fine, : width * fine].reshape(height, fine, width, fine)
    inside = picture.inside[: height * fine, : width * fine].reshape(height, fine, width, fine).all(axis=(1, 3))
    share = np.maximum(uniform_filter(inside.astype(np.float64), _SURROUND, mode="constant"), 1e-6)
    ranks = np.zeros((len(_VALUES), height, width))
    for plane, values in zip(ranks, _VALUES if inside.any() else (), strict=False):
        plane[inside] = _ranks(np.rint(values * grey.mean(axis=(1, 3)))[inside])
        plane[inside] -= plane[inside].mean()
        plane -= np.where(inside, uniform_filter(plane, _SURROUND, mode="constant") / share, 0.0)
    return Structure(ranks)


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 1, ties at their mean: `scipy.stats.rankdata`, whose module takes half a second to load."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[place]


def similarity(first: Structure, second: Structure) -> float | None:
    """Rank correlation of two structures at the best small shift, −1 to 1; None where one photograph shows nothing."""
    best = None
    for down in range(-_REACH, _REACH + 1):
        for right in range(-_REACH, _REACH + 1):
            a, b = _overlap(first.ranks, down, right), _overlap(second.ranks, -down, -right)
            power = np.sqrt((a * a).sum(axis=(1, 2)) * (b * b).sum(axis=(1, 2)))
            if (power > 0).any():
                alike = ((a * b).sum(axis=(1, 2))[power > 0] / power[power > 0]).max()
                best = float(alike) if best is None else max(best, float(alike))
    return best


def _overlap(ranks: np.ndarray, down: int, right: int) -> np.ndarray:
    """The planes without their first `down` rows and `right` columns; where negative, without the last ones."""
    _, height, width = ranks.shape
    rows = slice(max(down, 0), height + min(down, 0))
    return ranks[:, rows, max(right, 0) : width + min(right, 0)]
