"""Whether halves hold a layer, and what they lose of it."""

from __future__ import annotations

import os

import numpy as np

from relume.errors import warn
from relume.image.bands import in_bands

_LARGEST = 65504
_SMALLEST = 2**-14  # below, halves have fewer than eleven digits
_STEP = 2**-11  # the largest error of rounding to half, by the value
_DIM = 0.01  # the share of values that halves may lose; a photograph's darkest noise is less


def holds(path: str | os.PathLike[str], name: str, layer: np.ndarray) -> bool:
    """Whether a layer is to be stored as half; warns where it is not, and of the values that halves lose where it is.

    layer : (H, W) or (H, W, 3), any float; a value is lost where half differs from it by more than 1/2048 of it
    """
    counts = in_bands(layer.shape[0], layer.shape[1], lambda rows: _counts(layer[rows]))
    beyond, lit, lost, black = np.sum(counts, axis=0).tolist() if counts else (0, 0, 0, 0)
    if beyond:
        reason = f"{beyond} values are beyond {_LARGEST}, the largest half"
        warn(f"{path}: {name} is stored as float, not half: {reason}")
        return False
    if not lost:
        return True
    what = f"{lost} of its {lit} values other than 0 are so small that halves lose more than 1/2048 of them"
    if lost > _DIM * lit:
        warn(f"{path}: {name} is stored as float, not half: {what}")
        return False
    nothing = f", and {black} become 0" if black else ""
    warn(
        f"{path}: {name} is stored as half, though {what}{nothing}; float keeps them (leave out --half, in Python "
        "half=True)"
    )
    return True


def _counts(rows: np.ndarray) -> tuple[int, ...]:
    """How many finite values are beyond halves, are not 0, are too dim for halves, and become 0 in them."""
    sizes = np.abs(rows)
    if sizes.size and sizes.min() >= _SMALLEST and sizes.max() <= _LARGEST:  # of most rows; of none with a NaN
        return 0, sizes.size, 0, 0
    with np.errstate(over="ignore"):
        sizes = sizes[np.isfinite(sizes)].astype(np.float32, copy=False)
    dim = sizes[(sizes < _SMALLEST) & (sizes > 0)]
    stored = dim.astype(np.float16).astype(np.float32)
    lost = np.count_nonzero(np.abs(stored - dim) > dim * _STEP)
    counts = np.count_nonzero(sizes > _LARGEST), np.count_nonzero(sizes), lost, np.count_nonzero(stored == 0)
    return tuple(int(count) for count in counts)
