"""How a photograph uses its code values: what is crushed at 0, clipped at the top, and where the rest lies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relume.image.photograph import Photograph
from relume.image.statistics import PERCENTS

_BAND = 2**18  # pixels counted at a time, which stay in the cache


@dataclass(frozen=True)
class CodeValues:
    """The code values of a photograph's pixels, but for those outside the picture; None and 0 where there are none.

    top : the largest code there is, 255 or 65535
    pixels : how many were counted
    black, white : the share of pixels at 0 and at `top`, of R, G and B
    minimum, maximum, mean : of all three channels
    percentiles : percent → code, of all three channels, for `PERCENTS`
    """

    top: int
    pixels: int
    black: tuple[float, float, float]
    white: tuple[float, float, float]
    minimum: int | None
    maximum: int | None
    mean: float | None
    percentiles: Mapping[float, int]


def code_values(photograph: Photograph) -> CodeValues:
    """What codes a photograph holds, and how often those at either end."""
    pixels, top = photograph.pixels, int(np.iinfo(photograph.pixels.dtype).max)
    counts = np.zeros((3, top + 1), np.int64)
    step = max(1, _BAND // pixels.shape[1])
    for start in range(0, pixels.shape[0], step):
        band = pixels[start : start + step].reshape(-1, 3)
        if photograph.outside is not None:
            band = band[~photograph.outside[start : start + step].reshape(-1)]
        for channel in range(3):
            counts[channel] += np.bincount(band[:, channel], minlength=top + 1)
    number = int(counts[0].sum())
    black, white = (counts[:, code] / max(number, 1) for code in (0, top))
    every = counts.sum(0)
    used = np.flatnonzero(every)
    return CodeValues(
        top=top,
        pixels=number,
        black=(float(black[0]), float(black[1]), float(black[2])),
        white=(float(white[0]), float(white[1]), float(white[2])),
        minimum=int(used[0]) if number else None,
        maximum=int(used[-1]) if number else None,
        mean=float(every @ np.arange(top + 1.0) / every.sum()) if number else None,
        percentiles=code_percentiles(every) if number else {},
    )


def code_percentiles(counts: np.ndarray) -> dict[float, int]:
    """For each of `PERCENTS` the least code that so many percent of the values do not exceed.

    counts : (codes,), how often each occurs; not all 0
    """
    below = np.cumsum(counts)
    return {
        percent: int(np.searchsorted(below, max(int(np.ceil(below[-1] * percent / 100)), 1))) for percent in PERCENTS
    }
