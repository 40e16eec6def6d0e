"""Merging a bracket into one radiance map (Debevec & Malik 1997, §2.2)."""

from __future__ import annotations

import numpy as np

from relume.capture.bracket import Bracket
from relume.capture.weighting import InverseVariance, Weighting
from relume.errors import NotABracket
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.image.response import Response


def merge(bracket: Bracket, response: Response, *, weighting: Weighting = InverseVariance()) -> RadianceMap:
    """Average all photographs into relative radiance by eq. 6: a weighted mean of ln E over the photographs.

    weighting : w of eq. 6; the least noisy weights unless given, `Hat()` for the paper's own (eq. 4)

    The variance plane carries the response's noise through the average. A channel that no photograph measured
    keeps its bound (what its own value tells in the shortest exposure that shows it white, else in the longest,
    where it is black), has infinite variance, and marks its pixel in the `clipped` mask; nothing is invented there.
    Raises NotABracket when hardly any pixel is measured.
    """
    photographs, log_times = bracket.photographs, np.log(bracket.exposures)
    shape = photographs[0].pixels.shape
    weighted, total, spread = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    bound, saturated = np.zeros(shape), np.zeros(shape, bool)
    slopes = np.gradient(response.log_exposure, axis=1)
    table, channels = weighting.table(response), np.arange(3)
    for photograph, log_time in zip(photographs, log_times, strict=True):
        values = _values(bracket, photograph.pixels, response)
        weights = table[channels, values]
        log_radiance = response.log_exposure[channels, values] - log_time
        # The shortest exposure that shows white sets a lower bound; until one does, the longest sets an upper one.
        bound = np.where(saturated, bound, log_radiance)
        saturated |= values > response.levels // 2
        weighted += weights * log_radiance
        total += weights
        spread += (weights * slopes[channels, values] * response.deviation[channels, values]) ** 2

    measured = total > 0
    saturated &= ~measured
    black = ~measured & ~saturated
    _require_light(bracket, measured, saturated)

    safe = np.where(measured, total, 1.0)
    radiance = np.exp(np.where(measured, weighted / safe, bound))
    variance = np.where(measured, radiance**2 * spread / safe**2, np.inf)
    clipped = np.where(saturated.any(-1), SATURATED, np.where(black.any(-1), BLACK, 0)).astype(np.uint8)
    return RadianceMap(radiance.astype(np.float32), variance.astype(np.float32), clipped)


def _values(bracket: Bracket, pixels: np.ndarray, response: Response) -> np.ndarray:
    if pixels.dtype != np.uint8 or response.levels != 256:
        raise NotABracket(
            f"{bracket.name}: {pixels.dtype} photographs and a response of {response.levels} values; "
            "merging needs 8-bit photographs and a response of 256 values"
        )
    return pixels.astype(np.intp)


def _require_light(bracket: Bracket, measured: np.ndarray, saturated: np.ndarray) -> None:
    """Refuse a bracket in which less than one pixel value in a thousand is measured."""
    if measured.mean() >= 1e-3:
        return
    if saturated.sum() > (~measured & ~saturated).sum():
        raise NotABracket(f"{bracket.name}: saturated in every photograph; add shorter exposures")
    raise NotABracket(f"{bracket.name}: black in every photograph; add longer exposures (was the lens cap on?)")
