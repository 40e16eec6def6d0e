"""Whether the exposures stated of a bracket are those its pixels show, and which photograph's is not.

One curve is fitted to all pairs of neighbouring photographs, g(b) − g(a) = ln ratio of their exposures (Debevec & Malik
1997, eq. 2) for pixel values a and b that show the same light, together with a correction of every exposure. As few
corrections as can be are made (their sum of absolute values is kept small): the curve and the scale of all exposures
follow the majority, and a photograph that departs from it stands out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.capture.exposure.comparison import Reduced, matched
from relume.image.colour import decode_srgb
from relume.image.response import Response

_USUAL = np.array([0.7, 0.0, -0.2, 0.3, 0.8])
"""The curve of cameras' pictures in the terms of `_terms`; scanned film has (1.1, 0, −0.7, −0.1, 0.8)."""
_HELD = np.array([0.4, 0.003, 0.01, 0.01, 0.01])
"""How hard the curve is held to that, in squares of ln exposure per pair: just so hard that of three photographs, one
stated two stops wrong, not the one in the middle is blamed and the contrast halved."""
_SPARSE = 0.07
"""How dear a correction is: at 0.05 too few errors of three photographs are found, at 0.2 none of end ones."""
_SMALL = 0.01  # corrections, ln exposure, that are counted as none
_MOVED = 0.1  # ln exposure; a correction beyond it is found again without its price, which makes it too small
_TOE = 0.06  # pixel value over which the toe falls off
_ROUNDS = 25
_LIT = 0.1  # share of a picture in values that its neighbour shows too, from which on a pair counts in full


@dataclass(frozen=True, eq=False)
class ExposureCorrections:
    """How the stated exposures of some photographs depart from their pixels.

    corrections : (P,) ln exposure to add to each stated one
    shared : (P − 1,) share of each picture's values that the one after it shows well exposed too, 0 to 1
    casts : (P − 1, 3) ln exposure by which each channel of a photograph departs from what the three have in common,
        beyond the photograph before it; nan where unseen
    curve : (256,) ln exposure of pixel values from 0 to 1, rising, as it was fitted to all channels together
    """

    corrections: np.ndarray
    shared: np.ndarray
    casts: np.ndarray
    curve: np.ndarray

    @property
    def evidence(self) -> np.ndarray:
        """(P,) share of the better of each picture's two pairs: what its correction rests on."""
        shared = np.array([0.0, *self.shared, 0.0])
        return np.maximum(shared[1:], shared[:-1])


def compare(pictures: Sequence[Reduced], stated: np.ndarray, response: Response | None = None) -> ExposureCorrections:
    """Compare exposures with pixels.

    pictures : at least two, in the order of their brightness
    stated : (P,) ln exposure of each
    response : of the camera; fitted from the pictures where None, and then the scale of all exposures is the stated one
    """
    pairs = [_Pair.of(first, second, response) for first, second in pairwise(pictures)]
    steps = np.diff(stated)
    coefficients, corrections = _fitted(pairs, steps, fixed=response is not None)
    casts = np.full((len(pairs), 3), np.nan)
    for index, pair in enumerate(pairs):
        left = pair.left_over(coefficients, steps[index] + corrections[index + 1] - corrections[index])
        channels = [
            float(np.median(left[pair.channel == c])) if (pair.channel == c).any() else np.nan for c in range(3)
        ]
        casts[index] = np.array(channels) - np.nanmedian(channels) if np.isfinite(channels).any() else np.nan
    values = np.linspace(0, 1, 256)
    curve = _terms(np.maximum(values, 0.25 / 255)) @ coefficients
    if response is not None:
        own = response.log_exposure.mean(0)
        curve = curve + np.interp(values, np.linspace(0, 1, len(own)), own)
    curve = np.maximum.accumulate(curve) + 1e-6 * np.arange(256)
    return ExposureCorrections(corrections, np.array([pair.lit for pair in pairs]), casts, curve)


@dataclass(frozen=True, eq=False)
class _Pair:
    """Values of two neighbouring photographs that show the same light, as the rows of a linear system.

    rows : (N, T) difference of the curve's terms between the two values; fixed : (N,) of its known part
    channel : (N,); lit : share of the darker picture in such values
    """

    rows: np.ndarray
    fixed: np.ndarray
    channel: np.ndarray
    lit: float

    @staticmethod
    def of(first: Reduced, second: Reduced, response: Response | None) -> _Pair:
        values, fixed = matched(first, second), []
        for channel, (a, b) in enumerate(values):
            # Without a response all of the curve is sought.
            curve = np.zeros(2) if response is None else response.log_exposure[channel]
            places = np.linspace(0.0, 1.0, len(curve))
            fixed.append(np.interp(b, places, curve) - np.interp(a, places, curve))
        rows = [_terms(b) - _terms(a) for a, b in values]
        lit = [
            np.ptp(np.interp(a[[0, -1]], first.steps, below)) if len(a) else 0.0
            for below, (a, _) in zip(first.below, values, strict=True)
        ]
        channel = np.repeat(np.arange(3), [len(a) for a, _ in values])
        return _Pair(np.concatenate(rows), np.concatenate(fixed), channel, float(np.median(lit)))

    @property
    def weight(self) -> float:
        """Of one row: a pair counts by how much of the picture it shows, not by how many levels."""
        return min(1.0, self.lit / _LIT) / max(1, len(self.fixed))

    def left_over(self, coefficients: np.ndarray, step: float) -> np.ndarray:
        return self.rows @ coefficients + self.fixed - step


def _terms(values: np.ndarray) -> np.ndarray:
    """The curve's terms: sRGB's own, a toe, and the three lowest powers for a shoulder or an S."""
    return np.stack([np.log(decode_srgb(values)), np.exp(-values / _TOE), values, values**2, values**3], axis=-1)


def _fitted(pairs: Sequence[_Pair], steps: np.ndarray, *, fixed: bool) -> tuple[np.ndarray, np.ndarray]:
    """The curve's coefficients, (T,), and the corrections, (P,), by least squares weighted anew in each round."""
    terms, count = len(_USUAL), len(steps) + 1
    wanted = np.zeros(terms + count)
    # A hair dearer each, so that of two photographs that disagree one is corrected and not both by half.
    dearness = _SPARSE * (1.0 + 0.1 * np.arange(count) / count)
    wanted[:terms] = 0.0 if fixed else _USUAL
    coefficients, corrections, moved = wanted[:terms].copy(), np.zeros(count), np.zeros(count, bool)
    for _ in range(2):
        for _ in range(_ROUNDS):
            price = np.where(moved, 1e-9, dearness / (np.abs(corrections) + _SMALL))
            hold = np.concatenate([np.full(terms, 1e9) if fixed else _HELD, price])
            normal, right = np.diag(hold), hold * wanted
            for index, pair in enumerate(pairs):
                if not len(pair.fixed):
                    continue
                # Odd levels count less, but never an odd pair: that is what is looked for.
                left = pair.left_over(coefficients, 0.0)
                departure = np.abs(left - np.median(left))
                weights = pair.weight / np.sqrt(1.0 + (departure / (3.0 * np.median(departure) + 0.04)) ** 2)
                _add(normal, right, pair, weights, steps[index], terms + index)
            solution = np.linalg.solve(normal, right)
            coefficients, corrections = solution[:terms], solution[terms:]
        moved = np.abs(corrections) > _MOVED
        if not moved.any():
            break
    return coefficients, corrections


def _add(normal: np.ndarray, right: np.ndarray, pair: _Pair, weights: np.ndarray, step: float, first: int) -> None:
    """Add Σ w (rows · coefficients + fixed − step − δ_second + δ_first)² to the normal equations."""
    terms, weighted = pair.rows.shape[1], pair.rows * weights[:, None]
    target = step - pair.fixed
    sums, total, pull = weighted.sum(0), weights.sum(), weights @ target
    normal[:terms, :terms] += np.einsum("ij,ik->jk", weighted, pair.rows)
    right[:terms] += target @ weighted
    for place, sign in ((first, 1.0), (first + 1, -1.0)):
        normal[:terms, place] += sign * sums
        normal[place, :terms] += sign * sums
        normal[place, place] += total
        right[place] += sign * pull
    normal[first, first + 1] -= total
    normal[first + 1, first] -= total
