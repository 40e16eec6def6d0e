"""Any linear spreading of light over pixels, carried through all the planes of a radiance map.

A spread is a function from a field (H, W, C) float64 to another (H', W', C), a weighted mean for every pixel of the
new field. Its square has the squared weights: it carries variance. Masks are eroded here too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from relume.image.colour import luminance
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap

Spread = Callable[[np.ndarray], np.ndarray]

TAINTED = 0.01
"""Share of a pixel's light from saturated pixels above which its radiance is a lower bound too."""
MOSTLY = 0.5
"""Share of a pixel's weights from black or unseen pixels above which it is one of them."""


def spread_through(picture: RadianceMap, spread: Spread, square: Spread) -> RadianceMap:
    """The map with its light spread.

    spread : weights that are not negative and sum to 1 for every pixel of the result
    square : the same weights squared, for the variance; errors of neighbours are then no longer independent

    Raises ValueError for NaN or infinite radiance, which would reach all round.
    """
    require_finite(picture.radiance)
    light = picture.radiance.astype(np.float64)
    radiance = spread(light)
    if light.size and light.min() >= 0:
        # Transforms round; weights that are not negative make no negative light.
        radiance = np.maximum(radiance, 0)
    variance = None if picture.variance is None else _spread_variance(picture.variance, spread, square)
    clipped = None if picture.clipped is None else spread_clipped(picture.radiance, picture.clipped, spread)
    return replace(picture, radiance=radiance.astype(np.float32), variance=variance, clipped=clipped)


def spread_clipped(radiance: np.ndarray, clipped: np.ndarray, spread: Spread) -> np.ndarray:
    """Marks of spread light, (H', W') uint8 with the codes of RadianceMap.

    radiance : (H, W, 3) before
    clipped : (H, W) uint8 before

    A pixel is saturated that has more than TAINTED of its luminance from saturated pixels; black or outside where more
    than half of its weights fall on such pixels.
    """
    light = np.abs(luminance(radiance.astype(np.float64)))
    saturated = clipped == SATURATED
    fields = np.stack([light, light * saturated, clipped == BLACK, clipped == OUTSIDE], axis=-1).astype(np.float64)
    whole, tainted, black, outside = np.moveaxis(spread(fields), -1, 0)
    result = np.where(black > MOSTLY, BLACK, 0)
    result[tainted > TAINTED * whole] = SATURATED
    result[outside > MOSTLY] = OUTSIDE
    return result.astype(np.uint8)


def require_finite(radiance: np.ndarray) -> None:
    """Raise ValueError, with their number, for pixels (H, W, C) that are NaN or infinite."""
    odd = np.count_nonzero(~np.isfinite(radiance).all(-1))
    if odd:
        raise ValueError(f"{odd} pixels are NaN or infinite and would reach all round; paint over them first")


def _spread_variance(variance: np.ndarray, spread: Spread, square: Spread) -> np.ndarray:
    """Σ w² V; infinite wherever a pixel without a known variance has a part."""
    unknown = ~np.isfinite(variance)
    known = np.maximum(square(np.where(unknown, 0, variance).astype(np.float64)), 0)
    if unknown.any():
        known[spread(unknown.astype(np.float64)) > TAINTED] = np.inf
    return known.astype(np.float32)


def eroded(mask: np.ndarray, reach: int) -> np.ndarray:
    """Where all of a mask (H, W, …), bool, is set within `reach` pixels both ways, as far as it goes."""
    for axis in (0, 1):
        along = np.moveaxis(mask, axis, 0)
        mask = mask.copy()
        inside = np.moveaxis(mask, axis, 0)
        for away in range(1, reach + 1):
            inside[away:] &= along[:-away]
            inside[:-away] &= along[away:]
    return mask
