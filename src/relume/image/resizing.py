"""Cutting a part out of a radiance map, and making it smaller or larger without ringing and with its mean kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from relume.image.bands import BAND
from relume.image.filtering import Spread, require_finite, spread_through
from relume.image.radiance import RadianceMap

if TYPE_CHECKING:
    from scipy import sparse


def cropped(picture: RadianceMap, left: int, top: int, width: int, height: int) -> RadianceMap:
    """The rectangle of `width` columns from `left` and `height` rows from `top`, all planes, pixels untouched.

    Raises ValueError for a rectangle that is empty or reaches out of the picture.
    """
    across, down = picture.size
    if not (0 <= left < left + width <= across and 0 <= top < top + height <= down):
        raise ValueError(
            f"the rectangle {left},{top},{width},{height} is not in a picture of {across}×{down}; "
            "give left, top, width and height in pixels"
        )
    part = (slice(top, top + height), slice(left, left + width))
    return replace(
        picture,
        radiance=picture.radiance[part].copy(),
        variance=None if picture.variance is None else picture.variance[part].copy(),
        clipped=None if picture.clipped is None else picture.clipped[part].copy(),
    )


def resized(picture: RadianceMap, width: int, height: int) -> RadianceMap:
    """The map at another size, its mean kept exactly and nothing below its darkest or above its brightest pixel.

    Smaller: each new pixel is the mean over its own area. Larger: the pixels, as small squares, are smoothed by a box
    that grows from nothing at scale 1 to one pixel at scale 2, which is linear interpolation, and the mean over each
    new pixel's area is taken. No weight is negative, so that no dark ring surrounds a light (Lanczos makes one).

    width, height : pixels, each at least 1
    """
    if width < 1 or height < 1:
        raise ValueError(f"the size is {width}×{height}; expected at least 1×1 pixels")
    if (width, height) == picture.size:
        return picture
    across, down = (_weights(old, new) for old, new in zip(picture.size, (width, height), strict=True))
    return spread_through(picture, _separable(down, across), _separable(down.power(2), across.power(2)))


def resized_rows(rows: Callable[[slice], np.ndarray], size: tuple[int, int], width: int, height: int) -> np.ndarray:
    """A field as `resized` makes it of a picture's radiance, (height, width, C) float32, to the same bits.

    rows : gives its rows (n, W, C), any float, of which memory holds some at a time
    size : W and H
    Raises ValueError for values that are NaN or infinite, which would reach all round.
    """
    across, down = (_weights(old, new) for old, new in zip(size, (width, height), strict=True))
    bands, step = [], max(1, BAND * height // (size[0] * size[1]))
    for top in range(0, height, step):
        part = down[top : top + step]
        first, last = int(part.indices.min()), int(part.indices.max())
        field = rows(slice(first, last + 1)).astype(np.float64)
        require_finite(field)
        bands.append(_separable(part[:, first : last + 1], across)(field).astype(np.float32))
    return np.concatenate(bands)


def _separable(down: sparse.csr_array, across: sparse.csr_array) -> Spread:
    def spread(field: np.ndarray) -> np.ndarray:
        rows, columns, channels = field.shape
        tall = (down @ field.reshape(rows, -1)).reshape(-1, columns, channels)
        flat = np.moveaxis(tall, 1, 0).reshape(columns, -1)
        return np.moveaxis((across @ flat).reshape(-1, tall.shape[0], channels), 0, 1)

    return spread


def _weights(old: int, new: int) -> sparse.csr_array:
    """(new, old) weights along one axis: rows sum to 1, columns to new/old, the axis reflected at its ends."""
    from scipy import sparse

    pixel = old / new
    smoothing = min(1.0, max(0.0, 2 * (1 - pixel)))
    begin = np.arange(new) * pixel
    first = np.floor(begin - smoothing / 2).astype(int)
    reach = int(np.ceil(pixel + smoothing)) + 1
    sources = first[:, None] + np.arange(reach)
    # Place everything relative to the first pixel touched: differences of squares stay exact.
    start = (begin - first)[:, None] - np.arange(reach + 1)
    if smoothing < 1e-9:
        below = np.maximum(start + pixel, 0) - np.maximum(start, 0)
        weights = (below[:, :-1] - below[:, 1:]) / pixel
    else:
        half = smoothing / 2
        below = _square(start + pixel + half) - _square(start + half)
        below -= _square(start + pixel - half) - _square(start - half)
        weights = (below[:, :-1] - below[:, 1:]) / (pixel * smoothing)
    weights = np.maximum(weights, 0)
    weights /= weights.sum(1, keepdims=True)
    reflected = sources % (2 * old)
    reflected = np.minimum(reflected, 2 * old - 1 - reflected)
    rows = np.repeat(np.arange(new), reach)
    # `tocsr` adds up what is reflected onto the same pixel.
    return sparse.csr_array(sparse.coo_array((weights.ravel(), (rows, reflected.ravel())), (new, old)).tocsr())


def _square(x: np.ndarray) -> np.ndarray:
    """The integral of what of x lies above 0."""
    return np.maximum(x, 0) ** 2 / 2
