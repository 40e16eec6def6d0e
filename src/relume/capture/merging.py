"""Merging a bracket into one radiance map (Debevec & Malik 1997, §2.2), and how much each pixel value counts in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn, Protocol

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.errors import NotABracket
from relume.image.bands import in_threads
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response

STRETCH = 12000
"""Pixels merged at a time: small enough for the caches, large enough that calling the kernel costs nothing. Of a power
of two all photographs' values would lie at the same places of a cache and push each other out: a twentieth of the time.
"""
DEVIATIONS = 2.0
"""Of noise between a clipped value and its bound: 2 % of the bounds may be crossed, as a single value can be."""
FULL = 0.999
"""Share of its full weight below which a value is doubtful: near white or near black."""
NOISE = 3.0
"""Deviations of noise by which a doubtful value may look like one that is not."""
BELOW = 0.5
"""ln exposure below the first doubtful value down to which a prediction decides; lower ones are of something else."""

RINGING = 2.0
"""Standard deviation, pixel values, that JPEG leaves near white beside the sensor's noise."""


class Weighting(Protocol):
    """A weight for every pixel value of every channel."""

    @property
    def predicted(self) -> bool:
        """Whether doubtful values, near white or near black, are weighed as the value that the others predict."""
        ...

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

    @property
    def predicted(self) -> bool:
        """Never: the paper weighs every value as it is."""
        return False

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels) for the pixel values of a camera of that `response`."""
        return np.tile(hat(response.levels), (3, 1))


@dataclass(frozen=True)
class InverseVariance:
    """The weights that leave the least noise: 1 / var(ln exposure), fading to 0 before the ends of the curve.

    guard : values at either end of 256 that never count; in saturated patches JPEG leaves 250 to 254 where 255 was, and
        a value near white is the least noisy of all, so that it would decide. Of 65536 values, which are no JPEG's,
        only the top 0.5 % and what is not five deviations of noise above nothing
    fade : the values over which the weight then rises, so that nothing jumps where a photograph begins to count
    predicted : weigh a value near white as the value that the shorter exposures predict, and one that is dark in the
        longest exposure as the others and the pixels beside predict it. A weight that a noisy value gives to itself
        favours half of the noise. In saturated patches JPEG leaves 240 where 255 was, which would be believed; in the
        dark only what noise has brightened would count
    """

    guard: float = 6.0
    fade: float = 16.0
    predicted: bool = True

    def table(self, response: Response) -> np.ndarray:
        """Weights (3, levels) for the pixel values of a camera of that `response`."""
        deviation = log_deviation(response)
        if response.levels == 256:
            counted = np.clip((hat(256) - self.guard) / self.fade, 0.0, 1.0)
        else:
            below_white = 1 - np.arange(response.levels) / (response.levels - 1)
            counted = np.clip((1 / np.maximum(deviation, 1e-6) - 5) / 10, 0, 1) * np.clip(below_white / 0.005 - 1, 0, 1)
        return counted / np.maximum(deviation, 1e-6) ** 2


def merge(
    bracket: Bracket,
    response: Response,
    *,
    weighting: Weighting = InverseVariance(),
    believed: np.ndarray | None = None,
) -> RadianceMap:
    """Average all photographs into relative radiance: a weighted mean of ln E over them (Debevec & Malik 1997, eq. 6).

    bracket : photographs of one view in register, of two exposures at least
    response : of the camera, of the photographs' depth
    weighting : w of eq. 6; the least noisy weights unless given, `Hat()` for the paper's own (eq. 4)
    believed : (H, W, 3) bool, where the shortest photograph is known to be below white, whatever its value; nowhere
        unless given

    The variance plane carries the response's noise through the average. A channel that no photograph measured keeps a
    bound, has infinite variance, and marks its pixel in the `clipped` mask; nothing is invented there. The bound of
    white is what its value shows in the shortest exposure that shows it white, less two deviations of its noise; that
    of black what it shows in the longest that shows it black, and as much more. A pixel outside every photograph has
    radiance 0, infinite variance and its own mark.
    Raises NotABracket when hardly any pixel is measured.
    """
    from relume.capture.merge_kernel import BESIDE, finish, merge_stretch

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
    bounds, log_times = clipping_bounds(response), np.log(bracket.exposures)
    table, curve, limits, bright, dark = _tables(response, weighting)
    radiance = np.empty((height * width, 3), np.float32)
    variance, clipped = np.empty_like(radiance), np.empty(height * width, np.uint8)

    def work(begin: int, end: int) -> int:
        part = slice(begin, end)
        values = np.stack([frame[part] for frame in frames])
        outside = np.stack([mask[part] for mask in masks]) if masked else np.zeros((0, 0), bool)
        logarithm = np.empty((end - begin, 3))
        relative = np.empty((end - begin, 3), np.float32)
        clipped[part] = 0
        left = merge_stretch(values, outside, table, curve, limits, bright, log_times, logarithm, relative)
        unmeasured = 0
        if left:
            # The pixels before and after the stretch; those beyond the picture's ends are never asked for.
            places = np.concatenate([np.arange(begin - BESIDE, begin), end + np.arange(BESIDE)])
            near = np.clip(places, 0, height * width - 1)
            edges = np.stack([frame[near] for frame in frames])
            beside = (edges, np.stack([mask[near] for mask in masks]), (begin, width))
            unmeasured = finish(
                values, outside, *beside, bounds, table, curve, limits, dark, log_times, logarithm, relative,
                clipped[part],
            )  # fmt: skip
        np.exp(logarithm, out=logarithm)
        radiance[part] = logarithm
        with np.errstate(invalid="ignore"):  # 0 · ∞ where no photograph shows the pixel
            # In this order neither very dark nor very bright light leaves the range of single precision.
            np.multiply(radiance[part], relative, out=variance[part])
            np.multiply(variance[part], radiance[part], out=variance[part])
        if masked:
            variance[part][clipped[part] == OUTSIDE] = np.inf
        return relative.size - unmeasured

    # Eq. 6, stretch by stretch.
    measured = sum(in_threads(work, height * width, chunk=STRETCH))
    # Less than one pixel value in a thousand is no measurement.
    if measured / radiance.size < 1e-3:
        refuse_unlit(bracket.name, (clipped == SATURATED).sum() > (clipped == BLACK).sum())
    if believed is not None:
        _believe(believed.reshape(-1, 3), frames[0], response, log_times[0], radiance, variance, clipped)
    shape = (height, width, 3)
    return RadianceMap(radiance.reshape(shape), variance.reshape(shape), clipped.reshape(height, width))


def _believe(
    believed: np.ndarray,
    values: np.ndarray,
    response: Response,
    log_time: float,
    radiance: np.ndarray,
    variance: np.ndarray,
    clipped: np.ndarray,
) -> None:
    """What no photograph measured but the shortest nearly: its own value, as uncertain as JPEG leaves it. All (N, …).

    Writes into the last three.
    """
    pixels, channels = np.nonzero(believed & ~np.isfinite(variance))
    z = values[pixels, channels]
    slope = np.gradient(response.log_exposure, axis=1)[channels, z]
    deviation = np.maximum(response.deviation[channels, z], RINGING)
    light = np.exp(response.log_exposure[channels, z] - log_time)
    radiance[pixels, channels] = light
    variance[pixels, channels] = (light * slope * deviation) ** 2
    whole = np.unique(pixels)
    clipped[whole[np.isfinite(variance[whole]).all(1)]] = 0


def clipping_bounds(response: Response) -> np.ndarray:
    """(3, levels) ln exposure that a white value is hardly below, and a black one hardly above."""
    values = np.arange(response.levels)
    side = np.where(values > response.levels // 2, -DEVIATIONS, DEVIATIONS)
    # At the very ends the noise of a value is not known: it is taken from where it is.
    inner = np.clip(values, response.levels // 32, response.levels - 1 - response.levels // 32)
    moved = values + side * response.deviation[:, inner]
    return np.stack([np.interp(at, values, curve) for at, curve in zip(moved, response.log_exposure, strict=True)])


def _tables(response: Response, weighting: Weighting) -> tuple[np.ndarray, ...]:
    """What `merge_stretch` and `finish` take as their tables, curve, limits, bright and dark."""
    from relume.capture.merge_kernel import STEPS

    levels, curve, deviation = response.levels, response.log_exposure, log_deviation(response)
    weights = weighting.table(response)
    values, spread = np.arange(levels), (weights * deviation) ** 2
    bright, dark = np.zeros((3, 2 + 2 * STEPS)), np.zeros((3, 1 + 2 * STEPS))
    limits = np.tile(np.array([levels, -1, -1]), (3, 1))
    # How far a value counts beside one that is neither near white nor near black.
    counted = weights * deviation**2
    counted = counted / np.maximum(counted.max(axis=1, keepdims=True), 1e-300)
    half, middle = levels // 2, np.arange(STEPS) + 0.5
    for c in range(3) if weighting.predicted else ():
        doubtful, believed = np.flatnonzero(counted[c] < FULL), np.flatnonzero(weights[c] > 0)
        low, high = doubtful[doubtful < half], doubtful[doubtful >= half]
        if len(high) and len(believed):
            # Noise carries a value that is doubtful to three deviations below.
            near = max(high[0] - int(NOISE * response.deviation[c, high[0]]), half)
            least, white = curve[c, near] - BELOW, curve[c, believed[-1]]
            limits[c, 0], bright[c, :2] = near, (least, STEPS / (white - least))
            predicted = np.interp(least + middle * (white - least) / STEPS, curve[c], values)
            bright[c, 2 : 2 + STEPS] = np.interp(predicted, values, weights[c])
            bright[c, 2 + STEPS :] = np.interp(predicted, values, spread[c])
        if len(low):
            limit = min(low[-1] + 1 + NOISE * response.deviation[c, low[-1]], half)
            end = np.exp(curve[c, min(int(2 * limit), levels - 1)])
            exposure = (middle / STEPS) ** 2 * end
            predicted = np.interp(np.log(exposure), curve[c], values)
            # w of a mean of exposures: 1 / var(E Δt).
            precision = (exposure * np.interp(predicted, values, deviation[c])) ** -2.0
            share = np.interp(predicted, values, counted[c])
            black = np.flatnonzero(weights[c, :half] == 0)
            limits[c, 1:], dark[c, 0] = (np.ceil(limit), black[-1] if len(black) else -1), 1 / end
            dark[c, 1 : 1 + STEPS], dark[c, 1 + STEPS :] = share * precision, share**2 * precision
    return np.stack([weights * curve, weights, spread], axis=-1), curve, limits, bright, dark


def refuse_unlit(name: str, saturated: bool) -> NoReturn:
    """Refuse a bracket in which hardly anything is measured."""
    if saturated:
        raise NotABracket(f"{name}: saturated in every photograph; add shorter exposures")
    raise NotABracket(f"{name}: black in every photograph; add longer exposures (was the lens cap on?)")
