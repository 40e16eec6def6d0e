"""The response that makes all photographs agree, as one linear least squares problem (Debevec & Malik 1997, §2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from relume.capture.merging import hat
from relume.capture.response.sampling import Observations

if TYPE_CHECKING:
    from scipy.sparse import csr_array

KNOTS = 256
"""Unknowns of the curve: every 8-bit value; photographs of 16 bits are interpolated between as many."""
MIDDLE = (KNOTS - 1) // 2
WEIGHT = hat(KNOTS)
LOGARITHM = np.log(np.maximum(np.arange(KNOTS), 0.5))
"""ln of a knot's place; half a knot at black, so that a power law stays a line."""
LEAST_RISE = 1e-9
"""Least step of a curve from one pixel value to the next: none to speak of, but it can be inverted."""


@dataclass(frozen=True)
class DebevecMalik:
    """Minimises eq. 3 of Debevec & Malik 1997 with the weights of eq. 4, each ln E replaced by its own best value.

    smoothness : λ of eq. 3, per observed pixel. None takes what suits the photographs' exposures
    power_law : smooth the curve's departure from the power law that fits it best, and not the curve itself. Encodings
        are nearly power laws, whose own bend is no noise; and the ends, which are little seen, then go on as they
        should. False is the paper's own term
    difference : which difference of g is kept small; 2 is the paper's g″. Curves bend slowly over their whole range.
        Exposures one step apart cannot see a ripple of that step (g + p(g), p periodic), which bends within the step.
        The third difference separates the two better: of 201 curves the worst twentieth is 0.48 % off, not 0.57 %,
        though the median is 0.07 %, not 0.06 %. Of five real brackets two ripple half as much, one a little more
    steepness : once the curve is known, weigh a value less where the curve is steeper than a power law. Film's base fog
        and a camera's toe give the same few values whatever the exposure, and eq. 4 knows of neither
    monotone : where the curve does not rise by itself, solve again for increments that are not negative, as §2.1
        proposes; False raises it to the greatest value before instead
    """

    smoothness: float | None = None
    power_law: bool = True
    difference: int = 3
    steepness: bool = True
    monotone: bool = True

    def __post_init__(self) -> None:
        if self.difference not in (1, 2, 3, 4):
            raise ValueError(f"difference is {self.difference}; expected 1 to 4, and 2 is the paper's")
        if self.smoothness is not None and not (np.isfinite(self.smoothness) and self.smoothness > 0):
            raise ValueError(f"smoothness is {self.smoothness}; expected a positive number or None")

    def curve(self, observed: Sequence[Observations], levels: int) -> tuple[np.ndarray, np.ndarray]:
        """The curve g (levels,), rising, 0 at the middle value, and its standard error (levels,).

        observed : at least one bracket's, of one channel
        levels : how many pixel values there are, 256 or 65536
        The error is what noise alone does to the curve: from the scatter of the pixels' own equations about the
        solution (White 1980), so that neither equal nor known noise is assumed; what smoothing takes is not in it.
        """
        curve, equations, factor = self._solved(observed, levels, WEIGHT)
        if self.steepness:
            curve, equations, factor = self._solved(observed, levels, WEIGHT * _relevance(curve))
        return interpolated(curve, levels), interpolated(equations.standard_error(curve, factor), levels)

    def _solved(
        self, observed: Sequence[Observations], levels: int, weight: np.ndarray
    ) -> tuple[np.ndarray, Equations, tuple[np.ndarray, bool]]:
        """The curve of the knots, the equations it solves, and their matrix factored."""
        from scipy.linalg import cho_solve

        equations = Equations.of(observed, levels, weight)
        smoothness = self.smoothness
        if smoothness is None:
            smoothness = smoothness_for(observed, equations, self.difference)
        # λ counts once a pixel, so that it does not depend on how many there are.
        penalty = smoothness * equations.pixels * roughness(self.difference, self.power_law)
        matrix = equations.normal + penalty
        # g(Z_mid) = 0 fixes the scale that eq. 3 leaves free.
        matrix[MIDDLE, MIDDLE] += np.trace(matrix)
        factor = factored(matrix)
        curve = cho_solve(factor, equations.right)
        if np.any(np.diff(curve) < LEAST_RISE):
            curve = _rising(_not_negative(matrix, equations.right) if self.monotone else curve)
        return curve - curve[MIDDLE], equations, factor


def _relevance(curve: np.ndarray) -> np.ndarray:
    """(K,) how much less a dark value says than a power law's: the root of their slopes' ratio; 1 above the middle.

    The root lies half way between eq. 4 and inverse variance; the whole ratio leaves the dark end of a film's curve
    to the smoothing. A film's shoulder is as steep as its fog, but there nothing is the same whatever the exposure.
    """
    exponent = float(np.polyfit(LOGARITHM, curve, 1, w=WEIGHT)[0])
    straight = exponent * np.gradient(LOGARITHM)
    ratio = np.minimum(1.0, straight / np.maximum(np.gradient(curve), 1e-9))
    return np.where(np.arange(KNOTS) < MIDDLE, np.sqrt(ratio / ratio[MIDDLE - 1]), 1.0).clip(0.0, 1.0)


def smoothness_for(observed: Sequence[Observations], equations: Equations, difference: int) -> float:
    """λ per pixel for exposures as far apart as those of `observed`.

    The ripple that the photographs cannot see is as long as the step between them, so λ grows with its square.
    Virtual cameras would be measured best by a quarter of this λ (0.06 % for 0.08 % at the median of 30 curves, one
    stop), but dark pixels of real JPEGs, which no light made, then bend the curves into visible ripples.
    Three such steps either way of the best double the error of few curves.
    """
    steps = [np.diff(np.unique(np.round(o.log_exposures, 3))) for o in observed]
    smallest = [float(np.median(each)) for each in steps if len(each)]
    stops = (min(smallest) if smallest else np.log(2)) / np.log(2)
    share = _ONE_STOP[difference] * float(np.clip(stops, 0.5, 4.0)) ** 2
    return share * float(np.trace(equations.normal[:KNOTS, :KNOTS])) / equations.pixels


_ONE_STOP = {1: 4e-6, 2: 1.2e-3, 3: 0.72, 4: 33.0}
"""λ for steps of one stop over the mean weight of an observation, by the difference it multiplies."""


@dataclass(frozen=True, eq=False)
class Equations:
    """The normal equations of eq. 3's first term, the pixels' ln E eliminated.

    normal, right : (K, K), (K,) of the K unknowns: the knots of g, then a correction of every photograph where asked
    pixels, freedom : how many pixels, and observations that are left when each has its ln E
    rows : a bracket each, for every observation (N·P) its row of unknowns, its weight, its ln Δt, and P
    """

    normal: np.ndarray
    right: np.ndarray
    pixels: int
    freedom: int
    rows: tuple[tuple[csr_array, np.ndarray, np.ndarray, int], ...]

    @staticmethod
    def of(
        observed: Sequence[Observations], levels: int, weight: np.ndarray = WEIGHT, *, corrections: bool = False
    ) -> Equations:
        """From the weights w (K,) of the knots.

        Each observation is g(Z) − ln E − ln Δt = 0, or g(Z) − ln E − δ = ln Δt with the `corrections` δ.
        """
        photographs = sum(len(o.log_exposures) for o in observed)
        unknowns = KNOTS + (photographs if corrections else 0)
        normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
        pixels = freedom = 0
        rows, before = [], KNOTS
        for values, log_exposures in observed:
            count, frames = values.shape
            row = _design(values, levels, unknowns, before if corrections else None)
            before += frames
            weights = _weight(values, levels, weight) ** 2
            total = np.maximum(weights.sum(1), 1e-9)
            mean = (weights * log_exposures).sum(1) / total
            target = (log_exposures - mean[:, None]).ravel()
            weighted = _scaled(row, weights.ravel())
            per_pixel = _summed(weighted, frames, unknowns)
            normal += (row.T @ weighted).toarray()
            normal -= (per_pixel.T @ _scaled(per_pixel, 1 / total)).toarray()
            right += weighted.T @ target
            pixels += count
            freedom += int((weights > 0).sum()) - count
            rows.append((row, weights.ravel(), np.tile(log_exposures, count), frames))
        return Equations(normal, right, pixels, freedom, tuple(rows))

    def residuals(self, solution: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """A bracket each: misfit (N, P) of ln exposure about each pixel's own ln E, and the weights of eq. 4."""
        found = []
        for row, weights, log_exposures, frames in self.rows:
            misfit = (row @ solution - log_exposures).reshape(-1, frames)
            share = weights.reshape(-1, frames)
            misfit = misfit - ((share * misfit).sum(1) / np.maximum(share.sum(1), 1e-9))[:, None]
            found.append((misfit, share))
        return found

    def scatter(self, solution: np.ndarray) -> np.ndarray:
        """(K, K) Σ sᵢ sᵢᵀ, sᵢ the gradient of pixel i's own term: the covariance of `right` as the data show it."""
        total = np.zeros_like(self.normal)
        for (row, _, _, frames), (misfit, share) in zip(self.rows, self.residuals(solution), strict=True):
            gradient = _summed(_scaled(row, (share * misfit).ravel()), frames, len(total))
            total += (gradient.T @ gradient).toarray()
        return total

    def standard_error(self, solution: np.ndarray, factor: tuple[np.ndarray, bool]) -> np.ndarray:
        """(K,) standard error of the solution about its middle: H⁻¹ scatter H⁻¹, H factored by `cho_factor`."""
        from scipy.linalg import cho_solve

        half = cho_solve(factor, self.scatter(solution))
        covariance = cho_solve(factor, half.T)
        middle = covariance[MIDDLE]
        return np.sqrt(np.maximum(np.diag(covariance) - 2 * middle + middle[MIDDLE], 0.0))


@cache
def roughness(difference: int, power_law: bool) -> np.ndarray:
    """(K, K) matrix of Σ [w(z) g⁽ⁿ⁾(z)]²; with `power_law` of g less its own best b ln z."""
    step = np.eye(KNOTS)
    for _ in range(difference):
        step = np.diff(step, axis=0)
    first = difference // 2
    weight = (WEIGHT[first : first + len(step)] + WEIGHT[KNOTS - first - len(step) : KNOTS - first]) / 2
    step = step * weight[:, None]
    if power_law:
        own = step @ LOGARITHM
        own /= np.linalg.norm(own)
        step = step - np.outer(own, own @ step)
    matrix = step.T @ step
    matrix.flags.writeable = False  # it is everyone's
    return matrix


def interpolated(knots: np.ndarray, levels: int) -> np.ndarray:
    """A curve over all `levels` from its knots, straight between them in ln z; itself where there are as many."""
    if levels == KNOTS:
        return knots
    places = np.arange(levels) * ((KNOTS - 1) / (levels - 1))
    below = np.log(np.maximum(places, 0.5 * (KNOTS - 1) / (levels - 1)))
    curve = np.interp(below, LOGARITHM, knots)
    dark = below < LOGARITHM[0]
    slope = (knots[1] - knots[0]) / (LOGARITHM[1] - LOGARITHM[0])
    return np.where(dark, knots[0] + slope * (below - LOGARITHM[0]), curve)


def _design(values: np.ndarray, levels: int, unknowns: int, first_correction: int | None) -> csr_array:
    """(N·P, unknowns): g(Z) as a mean of the knots about Z, less the photograph's correction where one is asked."""
    from scipy.sparse import csr_array

    count = values.size
    place = values.ravel() * ((KNOTS - 1) / (levels - 1))
    if levels == KNOTS:
        columns, shares = values.ravel()[:, None], np.ones((count, 1))
    else:
        logarithm = np.log(np.maximum(place, 0.5))
        below = np.clip(np.floor(place).astype(int), 0, KNOTS - 2)
        share = (logarithm - LOGARITHM[below]) / (LOGARITHM[below + 1] - LOGARITHM[below])
        columns, shares = np.stack([below, below + 1], 1), np.stack([1 - share, share], 1)
    if first_correction is not None:
        frame = first_correction + np.tile(np.arange(values.shape[1]), len(values))
        columns = np.column_stack([columns, frame])
        shares = np.column_stack([shares, -np.ones(count)])
    each = columns.shape[1]
    starts = np.arange(0, count * each + 1, each)
    return csr_array((shares.ravel(), columns.ravel(), starts), shape=(count, unknowns))


def _weight(values: np.ndarray, levels: int, weight: np.ndarray) -> np.ndarray:
    """w of pixel values, from those of the knots; exactly 0 for the values that are not believed."""
    if levels == KNOTS:
        return weight[values]
    return np.where(values > 0, np.interp(values * ((KNOTS - 1) / (levels - 1)), np.arange(KNOTS), weight), 0.0)


def _scaled(rows: csr_array, factors: np.ndarray) -> csr_array:
    """The rows, each times its factor."""
    from scipy.sparse import csr_array

    data = rows.data * np.repeat(factors, np.diff(rows.indptr))
    return csr_array((data, rows.indices, rows.indptr), shape=rows.shape)


def _summed(rows: csr_array, frames: int, unknowns: int) -> csr_array:
    """(N, K) the sums of every `frames` rows."""
    from scipy.sparse import csr_array

    starts = rows.indptr[::frames]
    shape = (len(starts) - 1, unknowns)
    found = csr_array((rows.data.copy(), rows.indices.copy(), starts.copy()), shape=shape)
    found.sum_duplicates()
    return found


def factored(matrix: np.ndarray) -> tuple[np.ndarray, bool]:
    """Cholesky's factor; values that neither pixels nor smoothness reach are held near the middle by a hair."""
    from scipy.linalg import cho_factor

    try:
        return cho_factor(matrix, lower=True)
    except np.linalg.LinAlgError:
        return cho_factor(matrix + 1e-12 * np.trace(matrix) / len(matrix) * np.eye(len(matrix)), lower=True)


def _not_negative(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The least squares curve whose increments are not negative, by non-negative least squares."""
    from scipy.optimize import nnls

    # g = g₀ + Σ increments up to z; g₀ may have either sign, so it enters twice.
    steps = np.tril(np.ones((KNOTS, KNOTS)))
    # The square root of the quadratic form, without the directions that nothing is known of.
    values, vectors = np.linalg.eigh(normal)
    known = values > 1e-14 * values[-1]
    root = np.sqrt(values[known])[:, None] * vectors[:, known].T
    target = (vectors[:, known].T @ right) / np.sqrt(values[known])
    matrix = np.column_stack([root @ steps, -(root @ steps[:, 0])])
    increments, _ = nnls(matrix, target, maxiter=50 * KNOTS)
    return steps @ increments[:KNOTS] - increments[KNOTS]


def _rising(curve: np.ndarray) -> np.ndarray:
    """The curve made to rise everywhere: where it is level it rises by a hair."""
    return np.maximum.accumulate(curve) + LEAST_RISE * np.arange(len(curve))
