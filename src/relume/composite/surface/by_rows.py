"""Pictures of a large plate's size, computed some rows at a time, so that what that takes in between stays small."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from relume.composite.surface.clean_pixels import Enlarged
from relume.image.bands import BAND, in_bands


def of_rows(work: Callable[..., np.ndarray], first: np.ndarray, *others: np.ndarray | Enlarged) -> np.ndarray:
    """What is computed of each pixel of pictures (H, W, …), (H, W, 3) float32."""
    height, width = first.shape[:2]
    result = np.empty((height, width, 3), np.float32)

    def fill(rows: slice) -> None:
        result[rows] = work(first[rows], *(picture[rows] for picture in others))

    in_bands(height, width, fill)
    return result


def within(chosen: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Light where it is chosen, 0 elsewhere; for `of_rows`."""
    return np.where(chosen, light, 0)


def change_as_share(after: np.ndarray, before: np.ndarray, chosen: np.ndarray) -> float:
    """The mean change of float32 light (H, W, 3) over chosen pixels, as a share of it; of the colour most changed.

    Its bits are those of sums in float32 over all rows at once.
    """
    moved, there, step = np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32), max(1, BAND // chosen.shape[1])
    for top in range(0, len(chosen), step):
        rows = slice(top, top + step)
        own = before[rows][chosen[rows]]
        moved = np.concatenate([moved, np.abs(after[rows][chosen[rows]] - own)]).sum(0)[None]
        there = np.concatenate([there, own]).sum(0)[None]
    count = np.float64(np.count_nonzero(chosen))
    moved, there = ((each[0] / count).astype(np.float32) for each in (moved, there))
    return float((moved / np.maximum(there, 1e-30)).max())


def among(parts: np.ndarray, numbers: Iterable[int]) -> np.ndarray:
    """Where parts (H, W) are one of few numbers; `isin` looks them up in tables of several times the parts' size."""
    found = np.zeros(parts.shape, bool)
    for number in numbers:
        found |= parts == number
    return found
