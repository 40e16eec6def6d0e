"""Recovering a camera's response from brackets, channel by channel (Debevec & Malik 1997, §2.1)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve

from relume.capture.bracket import Bracket
from relume.capture.sampling import LEVELS, observations
from relume.capture.weighting import hat
from relume.errors import NotABracket
from relume.image.response import Response

WEIGHT = hat(LEVELS)
MIDDLE = (LEVELS - 1) // 2
DOUBTFUL_MISFIT = 0.25
"""Misfit of ln exposure above which times or alignment are doubtful; good brackets show 0.02 to 0.1."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A response with the observations it was recovered from, for the plot and for judging it.

    response : the recovered curves
    samples : a channel each, (N, 2): ln(E Δt) and pixel value of every observation used
    residual : (3,) root mean square of the weighted misfit, natural logarithm of exposure
    """

    response: Response
    samples: tuple[np.ndarray, np.ndarray, np.ndarray]
    residual: np.ndarray


def recover_response(
    brackets: Bracket | Sequence[Bracket], *, smoothness: float = 100.0, power_law: bool = True
) -> Calibration:
    """Recover the response of the camera that took all `brackets`, minimising eq. 3 with the weights of eq. 4.

    brackets : 8-bit brackets of one camera; together they need two different exposures in at least one bracket
    smoothness : λ of eq. 3 per observed pixel; at 100 the noise of 8-bit values leaves no ripple and a camera's
        knee and toe are still followed (from 30 to 300 the curve moves by less than a hundredth)
    power_law : smooth the curve's departure from the power law that fits it best instead of the curve: encodings
        are nearly power laws, whose own bend is no noise, and the little-seen ends then go on as they should. False
        is the paper's own term. Values below about 10 are hardly observed either way: with the power law a camera's
        toe comes out too dark there, with the paper's term too light
    Raises NotABracket when the photographs say nothing of the curve.
    """
    brackets = [brackets] if isinstance(brackets, Bracket) else list(brackets)
    for bracket in brackets:
        if bracket.photographs[0].pixels.dtype != np.uint8:
            raise NotABracket(f"{bracket.name}: 16-bit photographs; the response is recovered from 8-bit ones")
    telling = [b for b in brackets if np.ptp(np.log(b.exposures)) > 0.1]
    if not telling:
        raise NotABracket(
            f"{brackets[0].name}: no two photographs differ in exposure, so the response cannot be recovered; "
            "add differently exposed ones"
        )
    channels = [_recover_channel(telling, channel, smoothness, power_law) for channel in range(3)]
    curves, noise, samples, residual = zip(*channels, strict=True)
    return Calibration(Response(np.stack(curves), np.array(noise)), tuple(samples), np.array(residual))


def _recover_channel(
    brackets: Sequence[Bracket], channel: int, smoothness: float, power_law: bool
) -> tuple[np.ndarray, float, np.ndarray, float]:
    observed = [observations(bracket, channel) for bracket in brackets]
    normal, right, pixels = np.zeros((LEVELS, LEVELS)), np.zeros(LEVELS), 0
    for values, log_times in observed:
        _add_data_term(normal, right, values, log_times)
        pixels += len(values)
    if pixels == 0:
        raise NotABracket(
            f"{brackets[0].name}: no pixel is well exposed in two photographs; photograph at smaller exposure steps"
        )
    if sum(int((WEIGHT[v] > 0).sum()) - len(v) for v, _ in observed) < LEVELS:
        warnings.warn(
            f"{brackets[0].name}: only {pixels} pixels tell of the {('red', 'green', 'blue')[channel]} response; it is "
            "uncertain, so use larger photographs or a response recovered before",
            stacklevel=3,
        )
    # λ counts once a pixel, so that it does not depend on how many there are.
    penalty = smoothness * pixels * _SECOND.T @ _SECOND
    curve = _solved(normal + penalty, right)
    logarithm = np.log(np.maximum(np.arange(LEVELS), 0.5))
    # The exponent and the curve depend on each other; three rounds settle them.
    for _ in range(3 if power_law else 0):
        exponent, _ = np.polyfit(logarithm, curve, 1, w=WEIGHT)
        curve = _solved(normal + penalty, right + penalty @ (exponent * (logarithm - logarithm[MIDDLE])))
    curve = _rising(curve)
    curve -= curve[MIDDLE]
    return curve, *_misfit(curve, observed)


def _solved(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The least squares curve with g(Z_mid) = 0, which fixes the scale that eq. 3 leaves free."""
    normal = normal.copy()
    normal[MIDDLE, MIDDLE] += np.trace(normal)
    curve = solve(normal, right, assume_a="pos")
    return curve - curve[MIDDLE]


def _weighted_second_differences() -> np.ndarray:
    """The matrix of w(z) g″(z), g″ = g(z−1) − 2g(z) + g(z+1)."""
    inner = np.arange(1, LEVELS - 1)
    second = np.zeros((LEVELS - 2, LEVELS))
    second[inner - 1, inner - 1], second[inner - 1, inner], second[inner - 1, inner + 1] = 1, -2, 1
    return second * WEIGHT[inner][:, None]


_SECOND = _weighted_second_differences()


def _add_data_term(normal: np.ndarray, right: np.ndarray, values: np.ndarray, log_times: np.ndarray) -> None:
    """Add Σ {w [g(Z) − ln E − ln Δt]}² with each ln E replaced by its own best value, a weighted mean."""
    weights = WEIGHT[values] ** 2
    total = weights.sum(1)
    mean_time = (weights * log_times).sum(1) / total
    right += np.bincount(values.ravel(), (weights * (log_times - mean_time[:, None])).ravel(), LEVELS)
    normal[np.diag_indices(LEVELS)] += np.bincount(values.ravel(), weights.ravel(), LEVELS)
    for first in range(values.shape[1]):
        for second in range(values.shape[1]):
            product = weights[:, first] * weights[:, second] / total
            pairs = np.bincount(values[:, first] * LEVELS + values[:, second], product, LEVELS**2)
            normal -= pairs.reshape(LEVELS, LEVELS)


def _rising(curve: np.ndarray) -> np.ndarray:
    """The curve made to rise everywhere: where noise makes it fall it stays level but for a hair."""
    return np.maximum.accumulate(curve) + 1e-9 * np.arange(len(curve))


def _misfit(curve: np.ndarray, observed: list[tuple[np.ndarray, np.ndarray]]) -> tuple[float, np.ndarray, float]:
    """Noise in pixel values, the observations (ln exposure, value), and the weighted misfit."""
    slope = np.gradient(curve)
    noise, points, squares, weight_sum = [], [], 0.0, 0.0
    for values, log_times in observed:
        log_radiance = curve[values] - log_times
        weights = np.where(WEIGHT[values] > 0, slope[values] ** -2.0, 0)
        share = weights / weights.sum(1, keepdims=True)
        mean = (share * log_radiance).sum(1, keepdims=True)
        difference = log_radiance - mean
        squares += float((WEIGHT[values] ** 2 * difference**2).sum())
        weight_sum += float((WEIGHT[values] ** 2).sum())
        # A value pulls the mean it is compared with towards itself: its residual has 1 − share of its variance.
        well = (WEIGHT[values] > LEVELS / 16) & (share < 0.9)
        noise.append((difference / (slope[values] * np.sqrt(np.maximum(1 - share, 1e-3))))[well])
        seen = WEIGHT[values] > 0
        points.append(np.stack([(mean + log_times)[seen], values[seen]], axis=1))
    residuals = np.concatenate(noise)
    spread = 1.4826 * float(np.median(np.abs(residuals))) if len(residuals) else 1.0
    # Rounding alone scatters a pixel value by 1/√12.
    return max(spread, 12**-0.5), np.concatenate(points), float(np.sqrt(squares / weight_sum))
