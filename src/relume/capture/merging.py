"""Merging a bracket into one radiance map (Debevec & Malik 1997, §2.2), and how much each pixel value counts in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn, Protocol

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.errors import NotABracket
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response

STRETCH = 16384
"""Pixels merged at a time: small enough for the caches, large enough that calling the kernel costs nothing."""
DEVIATIONS = 2.0
"""Of noise between a clipped value and its bound: 2 % of the bounds may be crossed, as a single value can be."""


class Weighting(Protocol):
    """A weight for every pixel value of every channel."""

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels), not negative; 0 where a value says nothing of the exposure."""
        ...


def log_deviation(response: Response) -> np.ndarray:
    """(3, levels) standard deviation of the ln exposure that each pixel value says."""
    return np.gradient(response.log_exposure, axis=1) * response.deviation


def hat(levels: int) -> np.ndarray:
    """w(z) of every pixel value: 0 at the ends, rising linearly to the middle (Debevec & Malik 1997, eq. 4)."""
    values = np.arange(levels, dtype=np.float64)
    return np.minimum(values, levels - 1 - values)


@dataclass(frozen=True)
class Hat:
    """The paper's weights (Debevec & Malik 1997, eq. 4): 0 at the ends, rising linearly to the middle."""

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        return np.tile(hat(response.levels), (3, 1))


@dataclass(frozen=True)
class InverseVariance:
    """The weights that leave the least noise: 1 / var(ln exposure), fading to 0 before the ends of the curve.

    guard : values at either end of 256 that never count; in saturated patches JPEG leaves 250 to 254 where 255 was, and
        a value near white is the least noisy of all, so that it would decide. Of 65536 values, which are no JPEG's,
        only the top 0.5 % and what is not five deviations of noise above nothing
    fade : the values over which the weight then rises, so that nothing jumps where a photograph begins to count
    """

    guard: float = 6.0
    fade: float = 16.0

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels)."""
        deviation = log_deviation(response)
        if response.levels == 256:
            counted = np.clip((hat(256) - self.guard) / self.fade, 0.0, 1.0)
        else:
            below_white = 1 - np.arange(response.levels) / (response.levels - 1)
            counted = np.clip((1 / np.maximum(deviation, 1e-6) - 5) / 10, 0, 1) * np.clip(below_white / 0.005 - 1, 0, 1)
        return counted / np.maximum(deviation, 1e-6) ** 2


def merge(bracket: Bracket, response: Response, *, weighting: Weighting = InverseVariance()) -> RadianceMap:
    """Average all photographs into relative radiance by eq. 6: a weighted mean of ln E over the photographs.

    weighting : w of eq. 6; the least noisy weights unless given, `Hat()` for the paper's own (eq. 4)

    The variance plane carries the response's noise through the average. A channel that no photograph measured
    keeps its bound (what its own value shows in the shortest exposure that shows it white, less two deviations of its
    noise, else in the longest, where it is black, and as much more), has infinite variance, and marks its pixel in the
    `clipped` mask; nothing is invented there.
    A pixel outside every photograph has radiance 0, infinite variance and its own mark.
    Raises NotABracket when hardly any pixel is measured.
    """
    from relume._kernel import in_threads
    from relume.capture.merge_kernel import merge_stretch

    width, height = bracket.photographs[0].size
    frames = [p.pixels.reshape(-1, 3) for p in bracket.photographs]
    kind = bracket.photographs[0].pixels.dtype
    if np.iinfo(kind).max + 1 != response.levels:
        raise NotABracket(
            f"{bracket.name}: {kind} photographs and a response of {response.levels} values; "
            f"merging needs a response of {np.iinfo(kind).max + 1} values"
        )
    # What is not part of the picture.
    masked = any(p.outside is not None for p in bracket.photographs)
    inside = np.zeros(height * width, bool)
    masks = [inside if p.outside is None else p.outside.ravel() for p in bracket.photographs]
    bounds, tables, log_times = clipping_bounds(response), _tables(response, weighting), np.log(bracket.exposures)
    radiance = np.empty((height * width, 3), np.float32)
    variance, clipped = np.empty_like(radiance), np.empty(height * width, np.uint8)

    def work(begin: int, end: int) -> int:
        part = slice(begin, end)
        values = np.stack([frame[part] for frame in frames])
        outside = np.stack([mask[part] for mask in masks]) if masked else np.zeros((0, 0), bool)
        logarithm = np.empty((end - begin, 3))
        relative = np.empty_like(logarithm)
        measured = merge_stretch(values, outside, bounds, tables, log_times, logarithm, relative, clipped[part])
        np.exp(logarithm, out=logarithm)
        radiance[part] = logarithm
        np.square(logarithm, out=logarithm)
        with np.errstate(invalid="ignore"):  # 0 · ∞ where no photograph shows the pixel
            np.multiply(logarithm, relative, out=variance[part], casting="same_kind")
        if masked:
            variance[part][clipped[part] == OUTSIDE] = np.inf
        return measured

    # Eq. 6, stretch by stretch.
    measured = sum(in_threads(work, height * width, chunk=STRETCH))
    # Less than one pixel value in a thousand is no measurement.
    if measured / radiance.size < 1e-3:
        refuse_unlit(bracket.name, (clipped == SATURATED).sum() > (clipped == BLACK).sum())
    shape = (height, width, 3)
    return RadianceMap(radiance.reshape(shape), variance.reshape(shape), clipped.reshape(height, width))


def clipping_bounds(response: Response) -> np.ndarray:
    """(3, levels) ln exposure that a white value is hardly below, and a black one hardly above."""
    values = np.arange(response.levels)
    side = np.where(values > response.levels // 2, -DEVIATIONS, DEVIATIONS)
    # At the very ends the noise of a value is not known: it is taken from where it is.
    inner = np.clip(values, response.levels // 32, response.levels - 1 - response.levels // 32)
    moved = values + side * response.deviation[:, inner]
    return np.stack([np.interp(at, values, curve) for at, curve in zip(moved, response.log_exposure, strict=True)])


def _tables(response: Response, weighting: Weighting) -> np.ndarray:
    """(3, levels, 3): w g, w and w² var(ln E) of every pixel value."""
    weights = weighting.table(response)
    return np.stack([weights * response.log_exposure, weights, (weights * log_deviation(response)) ** 2], axis=-1)


def refuse_unlit(name: str, saturated: bool) -> NoReturn:
    """Refuse a bracket in which hardly anything is measured."""
    if saturated:
        raise NotABracket(f"{name}: saturated in every photograph; add shorter exposures")
    raise NotABracket(f"{name}: black in every photograph; add longer exposures (was the lens cap on?)")
