"""Recovering a camera's response from brackets, channel by channel (Debevec & Malik 1997, §2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import hat
from relume.capture.noise import Noise, fit_noise
from relume.capture.response.debevec_malik import DebevecMalik
from relume.capture.response.ratios import ExposureRatios, Ratios
from relume.capture.response.sampling import Observations, levels_of, observations, still_values
from relume.errors import NotABracket, warn
from relume.image.response import Response

CHANNELS = ("red", "green", "blue")
DOUBTFUL_MISFIT = 0.28
"""Misfit of ln exposure above which times or alignment are doubtful. Good brackets show 0.02 to 0.16, sixteen scans of
film 0.27; a hand-held one that was not aligned 0.29, swapped times 0.6 and more."""
FEWEST_LEVELS = 8
"""Range of pixel values, in 256ths, that says anything of a curve."""


class ResponseMethod(Protocol):
    """A way to recover one channel's response: `DebevecMalik`, `MitsunagaNayar`, `Robertson`."""

    def curve(self, observed: Sequence[Observations], levels: int) -> tuple[np.ndarray, np.ndarray]:
        """g (levels,), rising, 0 at the middle value; and its standard error (levels,), NaN where none is known."""
        ...


@dataclass(frozen=True, eq=False)
class Calibration:
    """A response with the observations it was recovered from, for the plot and for judging it.

    response : the recovered curves
    samples : a channel each, (N, 2): ln(E Δt) and pixel value of every observation used
    residual : (3,) root mean square of the weighted misfit, natural logarithm of exposure
    error : (3, levels) standard error of ln exposure at every pixel value, about the middle value, where it is 0;
        None where none was estimated
    ratios : what the exposures were found to be, beside what was stated; None where they were taken as stated
    noise : the sensor's, fitted to the pixels that stayed the same; None where too few did
    pixels : (3,) how many places were observed
    """

    response: Response
    samples: tuple[np.ndarray, np.ndarray, np.ndarray]
    residual: np.ndarray
    error: np.ndarray | None = None
    ratios: ExposureRatios | None = None
    noise: Noise | None = None
    pixels: np.ndarray = field(default_factory=lambda: np.zeros(3, int))

    def balanced_at(self, value: int) -> Calibration:
        """The calibration with its curves and observations shifted alike, so that a pixel `value` is achromatic.

        See `Response.balanced_at`.
        """
        return self.balanced_where(self.response.log_exposure[:, value])

    def balanced_where(self, log_exposures: np.ndarray) -> Calibration:
        """The calibration with its curves shifted so that these exposures, one a channel, are achromatic.

        log_exposures : (3,) ln E Δt of red, green and blue
        """
        shift = log_exposures - log_exposures.mean()
        balanced = replace(self.response, log_exposure=self.response.log_exposure - shift[:, None])
        red, green, blue = (np.column_stack([s[:, 0] - d, s[:, 1]]) for s, d in zip(self.samples, shift, strict=True))
        return replace(self, response=balanced, samples=(red, green, blue))


def recover_response(
    brackets: Bracket | Sequence[Bracket],
    *,
    method: ResponseMethod = DebevecMalik(),
    refine: Ratios | None = None,
) -> Calibration:
    """Recover the response of the camera that took all `brackets`.

    brackets : 8-bit or 16-bit brackets of one camera; together they need two different exposures in one bracket
    method : how; Debevec & Malik's least squares unless given: of the three the most accurate on virtual cameras
    refine : also correct the exposures that the photographs contradict, `Ratios()`; None takes them as stated. Not the
        default: it doubles the time, right times gain nothing, and light that changes between the photographs, fog
        and misalignment look like wrong times (three of five real brackets contradict too many of theirs to decide)
    Raises NotABracket when the photographs say nothing of the curve. Source: Debevec & Malik 1997, §2.1.
    """
    brackets = [brackets] if isinstance(brackets, Bracket) else list(brackets)
    depths = {levels_of(b) for b in brackets}
    if len(depths) > 1:
        raise NotABracket(
            f"{brackets[0].name}: 8-bit and 16-bit brackets together; recover a response from those of one depth"
        )
    levels = depths.pop()
    telling = [b for b in brackets if np.ptp(np.log(b.exposures)) > 0.1]
    if not telling:
        alone = len(brackets) == 1 and len(brackets[0].photographs) == 1
        found = "one photograph" if alone else "no two photographs differ in exposure"
        raise NotABracket(
            f"{brackets[0].name}: {found}, so the camera's response cannot be recovered; add differently exposed ones, "
            "or give the camera's profile"
        )
    # What the pixels of each channel show, with exposures refined where asked for.
    with ThreadPoolExecutor(3) as pool:
        observed = list(pool.map(lambda channel: [observations(b, channel) for b in telling], range(3)))
        for channel, each in enumerate(observed):
            _require_enough(telling, each, channel)
        ratios = None
        if refine is not None:
            ratios = refine.estimate(observed, [[p.name for p in b.photographs] for b in telling], levels)
            observed = [ratios.applied(each) for each in observed]
        still = list(pool.map(lambda channel: [still_values(b, channel) for b in telling], range(3)))
        if ratios is not None:
            still = [ratios.applied(each) for each in still]
    # One after the other: the solvers bring their own threads, which would wait for each other.
    curves = [method.curve(each, levels) for each in observed]
    log_exposure = np.stack([curve for curve, _ in curves])
    noise, table = fit_noise(log_exposure, still)
    # How well the curves fit.
    samples, residual = zip(*(_misfit(*each) for each in zip(log_exposure, table, observed, strict=True)), strict=True)
    return Calibration(
        Response(log_exposure, table),
        (samples[0], samples[1], samples[2]),
        np.array(residual),
        np.stack([error for _, error in curves]),
        ratios,
        noise,
        np.array([sum(len(o.values) for o in each) for each in observed]),
    )


def corrected(bracket: Bracket, calibration: Calibration) -> Bracket:
    """The bracket with the exposures that `calibration` found; itself where none was corrected.

    bracket : one of those the calibration was made from; its photographs are known by their names
    Raises ValueError for a bracket whose photographs the calibration has not seen.
    """
    if calibration.ratios is None:
        return bracket
    known = calibration.ratios.factors()
    missing = [p.name for p in bracket.photographs if p.name not in known]
    if missing:
        raise ValueError(
            f"{missing[0]} is not one of the photographs of this calibration; recover the response with it"
        )
    photographs = []
    for photograph in bracket.photographs:
        exposure, factor = photograph.exposure, known[photograph.name]
        if exposure is not None and factor != 1.0:
            exposure = replace(exposure, seconds=exposure.seconds * factor)
        photographs.append(replace(photograph, exposure=exposure))
    return Bracket(tuple(photographs))


def _require_enough(brackets: Sequence[Bracket], observed: list[Observations], channel: int) -> None:
    pixels = sum(len(o.values) for o in observed)
    if pixels == 0:
        raise NotABracket(
            f"{brackets[0].name}: no pixel is well exposed in two photographs; photograph at smaller exposure steps"
        )
    values = np.concatenate([o.values[o.values > 0] for o in observed])
    if np.ptp(values) < FEWEST_LEVELS * levels_of(brackets[0]) / 256:
        raise NotABracket(
            f"{brackets[0].name}: pixel values from {values.min()} to {values.max()} only, too few grey levels to "
            "recover a response from; photograph a scene of many, or use a response recovered before"
        )
    if all(_identical(o.values) for o in observed):
        stops = max(float(np.ptp(o.log_exposures)) for o in observed) / np.log(2)
        raise NotABracket(
            f"{brackets[0].name}: photographs whose exposures are said to be {stops:.1f} stops apart show identical "
            "values; give the times that they were taken with, or photograph at different ones"
        )
    # N(P − 1) > Z_max − Z_min (Debevec & Malik 1997, §2.1).
    if sum(int((o.values > 0).sum()) - len(o.values) for o in observed) < 256:
        warn(
            f"{brackets[0].name}: only {pixels} pixels show the {CHANNELS[channel]} response; it is "
            "uncertain, so use larger photographs or a response recovered before"
        )


def _identical(values: np.ndarray) -> bool:
    """Whether each place (N, P) has one value in all photographs that show it."""
    shown = values > 0
    lowest = np.where(shown, values, np.iinfo(values.dtype).max).min(1)
    return bool((np.where(shown, values, lowest[:, None]) == lowest[:, None]).all())


def _misfit(curve: np.ndarray, deviation: np.ndarray, observed: list[Observations]) -> tuple[np.ndarray, float]:
    """The observations (ln exposure, value) about each pixel's least noisy ln E, and the misfit of what counts.

    Weighed by eq. 4 and by how level the curve is beside a power law: where film's fog makes it steep, a grain is as
    much as a factor of ten, and says nothing of times or alignment.
    """
    weight = hat(len(curve))
    logarithm = np.log(np.maximum(np.arange(len(curve)), 0.5))
    straight = float(np.polyfit(logarithm, curve, 1, w=weight)[0]) * np.gradient(logarithm)
    weight = weight * np.minimum(1.0, straight / np.maximum(np.gradient(curve), 1e-9))
    precision = np.maximum(np.gradient(curve) * deviation, 1e-6) ** -2.0
    points, squares, weight_sum = [], 0.0, 0.0
    for values, log_exposures in observed:
        seen = values > 0
        log_radiance = curve[values] - log_exposures
        share = np.where(seen, precision[values], 0.0)
        mean = (share * log_radiance).sum(1, keepdims=True) / share.sum(1, keepdims=True)
        squares += float((weight[values] ** 2 * (log_radiance - mean) ** 2).sum())
        weight_sum += float((weight[values] ** 2).sum())
        points.append(np.stack([(mean + log_exposures)[seen], values[seen]], axis=1))
    return np.concatenate(points), float(np.sqrt(squares / weight_sum))
