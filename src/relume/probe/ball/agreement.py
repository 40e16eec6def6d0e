"""Which of several views of a ball contradicts the others, and where: what moved, or who stood there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.image.bilinear import bilinear
from relume.image.colour import luminance
from relume.probe.ball.unwrapping import BallView
from relume.probe.ball.weights import trust
from relume.sphere.mappings.mapping import LatLong, pixel_points

ROWS = 96
"""Rows of the charts that are compared: 1.9° each, more than registration leaves between views."""
TOLERANCE = 0.35
"""Difference in ln luminance, half a stop, at which a view counts half: edges that are blurred differ by less."""
EDGES: Any = ("nearest", "wrap")
"""How a lat-long chart goes on beyond its edges when it is blurred."""
LEAST = 0.05
"""What the view that contradicts all others keeps, so that it still serves where it is the only one."""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How far each view agrees with the others, 0 to 1, as lat-long charts (N, ROWS, 2·ROWS)."""

    charts: np.ndarray

    def of(self, view: int, directions: np.ndarray) -> np.ndarray:
        """Of one view, at directions (…, 3): (…)."""
        points = LatLong().image_points(directions)
        wide = np.concatenate([self.charts[view][:, -1:], self.charts[view], self.charts[view][:, :1]], axis=1)
        return bilinear(wide, points[..., 0] * 2 * ROWS + 1, points[..., 1] * ROWS)


def agreement(views: Sequence[BallView], nearness: float, gains: Sequence[float]) -> Agreement | None:
    """Compare the views, laid on one another; None for fewer than three, of which none is the odd one out.

    nearness, gains : as registration found them

    In each direction the views' ln luminance is compared with its median, every view counting as it is trusted there.
    """
    if len(views) < 3:
        return None
    directions = LatLong().directions(pixel_points(LatLong(), ROWS, 2))
    cells = (ROWS, 2, 2 * ROWS, 2)
    levels, shares = [], []
    for view, gain in zip(views, gains, strict=True):
        light = luminance(view.lookup(directions, nearness)[0]).reshape(cells).mean((1, 3)) / gain
        levels.append(np.log(gaussian_filter(light, 1.0, mode=EDGES) + 1e-9))
        shares.append(trust(view, directions, nearness).reshape(cells).mean((1, 3)))
    level, share = np.stack(levels), np.stack(shares)
    # The sharp power of the blending gives a view that samples badly no say; here it has little.
    off = np.abs(level - _weighted_median(level, share**2))
    agreed = LEAST + (1 - LEAST) / (1 + (off / TOLERANCE) ** 4)
    return Agreement(np.stack([gaussian_filter(each, 0.7, mode=EDGES) for each in agreed]))


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The value (…) that half the weight lies below, of values and weights (N, …)."""
    order = np.argsort(values, axis=0)
    values, weights = np.take_along_axis(values, order, 0), np.take_along_axis(weights, order, 0)
    middle = np.cumsum(weights, axis=0) - 0.5 * weights.sum(0)
    chosen = np.argmax(middle >= 0, axis=0)
    return np.take_along_axis(values, chosen[None], 0)[0]
