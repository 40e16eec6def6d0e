"""Exposures that the photographs contradict, corrected together with the response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.response.debevec_malik import KNOTS, MIDDLE, Equations, factored, roughness, smoothness_for
from relume.capture.response.sampling import Observations
from relume.errors import warn


@dataclass(frozen=True, eq=False)
class ExposureRatios:
    """What each photograph's exposure was found to be, beside what was stated.

    names : a bracket each, the photographs' names
    corrections : a bracket each, (P,) ln of the true exposure over the stated one; 0 where the stated one stands
    errors : a bracket each, (P,) their standard errors; NaN where nothing could be found of them
    """

    names: tuple[tuple[str, ...], ...]
    corrections: tuple[np.ndarray, ...]
    errors: tuple[np.ndarray, ...]

    def applied(self, observed: Sequence[Observations]) -> list[Observations]:
        """The observations with the corrected exposures, a bracket each as in `corrections`."""
        return _moved(observed, np.concatenate(self.corrections))

    def factors(self) -> dict[str, float]:
        """The factor on every photograph's stated exposure, by its name."""
        return {
            name: float(np.exp(delta))
            for names, deltas in zip(self.names, self.corrections, strict=True)
            for name, delta in zip(names, deltas, strict=True)
        }

    def in_stops(self) -> dict[str, tuple[float, float]]:
        """The correction of every photograph that was corrected and its standard error, in stops, by its name."""
        return {
            name: (float(delta / np.log(2)), float(error / np.log(2)))
            for names, deltas, errors in zip(self.names, self.corrections, self.errors, strict=True)
            for name, delta, error in zip(names, deltas, errors, strict=True)
            if delta != 0
        }


@dataclass(frozen=True)
class Ratios:
    """Finds the photographs whose exposure is not what was stated, and by how much.

    The curve and a correction of every photograph are solved for together, in all channels. A curve bent by any
    exponent fits exposures stretched by the same one, and each bracket's are free by a factor. The stated exposures
    settle both: most of them must be right (least absolute deviations). What then stands out is corrected.

    significance : standard errors a correction must exceed
    least : least correction, ln of exposure; 1 % is what a good shutter repeats to
    """

    significance: float = 5.0
    least: float = 0.01

    def estimate(
        self, observed: Sequence[Sequence[Observations]], names: Sequence[Sequence[str]], levels: int
    ) -> ExposureRatios:
        """The corrections of all photographs.

        observed : for each channel the observations of every bracket
        names : a bracket each, the photographs' names
        levels : how many pixel values there are, 256 or 65536
        A bracket of fewer than four telling exposures says nothing: with three, any one may be the wrong one. Where
        more than a third of the exposures stand out, which are right is not known: a warning, and none is corrected.
        """
        stated = np.concatenate([o.log_exposures for o in observed[0]])
        owner = np.repeat(np.arange(len(names)), [len(each) for each in names])
        usable = _usable(observed, stated, owner)
        if not usable.any():
            warn(
                f"{names[0][0]} … {names[-1][-1]}: exposures are refined from four different ones on; of fewer, which "
                "is wrong cannot be decided"
            )
        corrections = np.zeros(len(stated))
        errors = np.full(len(stated), np.nan)
        doubted = np.zeros(len(stated), bool)
        # A photograph that is far off distorts the others' corrections through the smoothing: three rounds settle it.
        for _ in range(3 if usable.any() else 0):
            curvature, gradient, scatter = _reduced(observed, corrections, levels)
            free = _complement(stated + corrections, owner, usable)
            step, covariance = _solved(curvature, gradient, scatter, free)
            found, stretch = _agreed(stated, stated + corrections + step, owner, usable)
            errors = np.where(usable, np.sqrt(np.diag(covariance)) * stretch, np.nan)
            doubted = usable & (np.abs(found) > np.maximum(self.significance * np.nan_to_num(errors), self.least))
            if doubted.sum() > usable.sum() / 3:
                warn(
                    f"{names[0][0]} … {names[-1][-1]}: {doubted.sum()} of {usable.sum()} exposures disagree with the "
                    "photographs, so which are right cannot be decided and all are taken as stated; check the times"
                )
                return self._split(np.zeros(len(stated)), errors, names)
            corrections = np.where(doubted, found, 0.0)
            if not doubted.any():
                break
            # With the others as stated, nothing is left free but the doubted ones.
            curvature, gradient, scatter = _reduced(observed, corrections, levels)
            step, covariance = _solved(curvature, gradient, scatter, np.eye(len(stated))[:, doubted])
            corrections = corrections + step
            errors = np.where(doubted, np.sqrt(np.diag(covariance)), errors)
        return self._split(corrections, errors, names)

    @staticmethod
    def _split(corrections: np.ndarray, errors: np.ndarray, names: Sequence[Sequence[str]]) -> ExposureRatios:
        ends = np.cumsum([len(each) for each in names])[:-1]
        return ExposureRatios(
            tuple(tuple(each) for each in names),
            tuple(np.split(corrections, ends)),
            tuple(np.split(errors, ends)),
        )


def _usable(observed: Sequence[Sequence[Observations]], stated: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """(F,) whether a photograph's exposure can be checked: it is well seen, and so are three others of its bracket."""
    counts = [
        np.concatenate([((o.values > 0) & ((o.values > 0).sum(1, keepdims=True) > 1)).sum(0) for o in each])
        for each in observed
    ]
    seen = np.max(counts, axis=0) >= 50
    for bracket in range(owner.max() + 1):
        here = seen & (owner == bracket)
        if len(np.unique(np.round(stated[here], 2))) < 4:
            seen &= owner != bracket
    return seen


def _moved(observed: Sequence[Observations], corrections: np.ndarray) -> list[Observations]:
    """The observations of brackets with ln exposures corrected, of all photographs in their order."""
    ends = np.cumsum([len(o.log_exposures) for o in observed])[:-1]
    return [
        Observations(o.values, o.log_exposures + delta)
        for o, delta in zip(observed, np.split(corrections, ends), strict=True)
    ]


def _reduced(
    observed: Sequence[Sequence[Observations]], corrections: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Curvature, gradient and the gradient's covariance of more corrections alone, the curves eliminated."""
    from scipy.linalg import cho_solve

    count = len(corrections)
    curvature, gradient, scatter = np.zeros((count, count)), np.zeros(count), np.zeros((count, count))
    for each in (_moved(channel, corrections) for channel in observed):
        equations = Equations.of(each, levels, corrections=True)
        smoothness = smoothness_for(each, equations, 3) * equations.pixels
        curve = equations.normal[:KNOTS, :KNOTS] + smoothness * roughness(3, power_law=True)
        curve[MIDDLE, MIDDLE] += np.trace(curve)
        factor = factored(curve)
        coupling = equations.normal[:KNOTS, KNOTS:]
        through = cho_solve(factor, coupling)
        own = equations.normal[KNOTS:, KNOTS:] - coupling.T @ through
        pull = equations.right[KNOTS:] - through.T @ equations.right[:KNOTS]
        solution = np.concatenate([cho_solve(factor, equations.right[:KNOTS]), np.zeros(count)])
        both = np.vstack([-through, np.eye(count)])
        # Channels count by their noise.
        misfit = equations.residuals(solution)
        variance = sum(float((w * m**2).sum()) for m, w in misfit) / max(equations.freedom, 1)
        curvature += own / variance
        gradient += pull / variance
        scatter += both.T @ equations.scatter(solution) @ both / variance**2
    return curvature, gradient, scatter


def _complement(exposures: np.ndarray, owner: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """(F, n) an orthonormal basis of the corrections of usable photographs that no exponent or factor makes."""
    within = np.stack([(owner == b) & usable for b in range(owner.max() + 1)], axis=1).astype(float)
    stretch = np.where(usable, exposures, 0.0)
    barred = np.column_stack([within, stretch, np.eye(len(owner))[:, ~usable]])
    left, values, _ = np.linalg.svd(barred, full_matrices=True)
    rank = int((values > 1e-9 * values[0]).sum())
    return left[:, rank:]


def _solved(
    curvature: np.ndarray, gradient: np.ndarray, scatter: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The best corrections within `basis`, and their covariance."""
    inverse = basis @ np.linalg.pinv(basis.T @ curvature @ basis, rcond=1e-12) @ basis.T
    return inverse @ gradient, inverse @ scatter @ inverse.T


def _agreed(stated: np.ndarray, found: np.ndarray, owner: np.ndarray, usable: np.ndarray) -> tuple[np.ndarray, float]:
    """Corrections (F,) of the stated exposures after `found` is stretched and shifted to agree with most of them."""
    from scipy.optimize import linprog

    places = np.flatnonzero(usable)
    brackets = np.unique(owner[places])
    shifts = (owner[places][:, None] == brackets).astype(float)
    count, size = len(places), 1 + len(brackets)
    model = np.column_stack([found[places], shifts])
    # min Σ e with −e ≤ model · x − stated ≤ e.
    objective = np.concatenate([np.zeros(size), np.ones(count)])
    above = np.block([[model, -np.eye(count)], [-model, -np.eye(count)]])
    limit = np.concatenate([stated[places], -stated[places]])
    bounds = [(0.1, 10.0), *[(None, None)] * len(brackets), *[(0.0, None)] * count]
    solution = linprog(objective, A_ub=above, b_ub=limit, bounds=bounds)
    if not solution.success:
        return np.zeros(len(stated)), 1.0
    fit = solution.x[:size]
    # The two photographs that an L1 fit passes through exactly should not decide alone.
    near = np.abs(model @ fit - stated[places]) < 0.03
    if near.sum() > size + 1:
        fit = np.linalg.lstsq(model[near], stated[places][near], rcond=None)[0]
    corrections = np.zeros(len(stated))
    corrections[places] = model @ fit - stated[places]
    return corrections, float(fit[0])
