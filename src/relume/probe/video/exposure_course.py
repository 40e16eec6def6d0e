"""The exposures of a film from frame to frame: one, or several that alternate, and where a camera changed them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from relume.errors import NotABracket
from relume.probe.video.exposure_ratios import ExposureRatio, ratio_of_quantiles
from relume.probe.video.light_tables import LightTables

LONGEST = 4
"""Frames of a period at most: cameras alternate between two or three exposures."""
ALTERNATING = 0.25
"""ln of exposure from which on frames alternate: a third of a stop."""
JUMP, UNIFORM = 0.06, 0.35
"""ln of exposure by which a frame may be off, 6 %, and the share of it that its pixels may be spread by, for it to be
the camera's doing: another lamp changes what it lights, and the rest little."""
SPREAD = 0.5
"""The middle share of the pixels by whose spread that is judged."""


@dataclass(frozen=True, eq=False)
class ExposureCourse:
    """How the exposure goes from frame to frame.

    period : frames after which the exposures repeat; 1 where all are alike
    ratios : of each phase, ln of its exposure over the brightest one's
    """

    period: int
    ratios: tuple[ExposureRatio, ...]


def exposure_course(
    small: Sequence[np.ndarray], period: int | None, stops: Sequence[float] | None, tables: LightTables, name: str,
    *, steady: bool,
) -> ExposureCourse:  # fmt: skip
    """The course of a film's exposures.

    small : exposures (N, 3) of each frame, of the same places, reduced by means
    period : given, or found: the least after which frames are as bright as before
    stops : of the exposures of a period, in their order from the film's first frame on; found unless given
    steady : whether a frame that is brighter all over than its course says is refused
    Raises NotABracket for exposures that cannot be found, and for those that jump.
    """
    known = len(stops) if stops is not None and len(stops) > 1 else period
    period = _period(small, tables) if known is None else known
    if period > len(small):
        raise NotABracket(f"{name}: {len(small)} frames, fewer than the {period} exposures that alternate; film longer")
    if steady:
        _require_steady(small, period, tables, name)
    if stops is not None and len(stops) == period:
        logarithms = -np.asarray(stops, np.float64) * np.log(2)
        found = [ExposureRatio(np.full(3, each - logarithms.max()), np.zeros(3)) for each in logarithms]
        return ExposureCourse(period, tuple(found))
    return ExposureCourse(period, _phase_ratios(small, period, tables, name))


def _step(first: np.ndarray, second: np.ndarray, tables: LightTables) -> tuple[float, float]:
    """ln of how much brighter the second frame is, and the spread of that over the places; NaN where none is seen."""
    low, high = tables.black / 2, tables.white
    shown = ((first > low) & (first < high) & (second > low) & (second < high)).all(axis=-1)
    if shown.sum() < 12:
        level = np.log(np.maximum(second.mean(), 1e-6) / np.maximum(first.mean(), 1e-6))
        return float(level), np.inf
    ratios = np.log(second[shown, 1] / first[shown, 1])
    below, middle, above = np.quantile(ratios, (0.5 - SPREAD / 2, 0.5, 0.5 + SPREAD / 2))
    return float(middle), float(above - below)


def _steps(small: Sequence[np.ndarray], period: int, tables: LightTables) -> np.ndarray:
    """`_step` (N, 2) from each frame to the one a period later."""
    return np.array([_step(a, b, tables) for a, b in zip(small, small[period:], strict=False)]).reshape(-1, 2)


def _period(small: Sequence[np.ndarray], tables: LightTables) -> int:
    """The least number of frames after which they are as bright as before; 1 where there is none."""
    for period in range(1, LONGEST + 1):
        changes = np.abs(_steps(small, period, tables)[:, 0])
        if len(changes) < max(period, 2) or np.median(changes) < ALTERNATING / 2:
            return period if len(changes) >= max(period, 2) else 1
    return 1


def _require_steady(small: Sequence[np.ndarray], period: int, tables: LightTables, name: str) -> None:
    """Refuse a film in which everything becomes brighter or darker at once, beyond its period."""
    off, spread = _steps(small, period, tables).T
    jumped = (np.abs(off) > JUMP) & (spread < UNIFORM * np.abs(off) + 0.02)
    if jumped.any():
        number = int(np.argmax(jumped))
        raise NotABracket(
            f"{name}: from frame {number + 1} to {number + 1 + period} everything becomes {np.exp(off[number]):.2f} "
            "times as bright at once, as when a camera changes its exposure; lock the exposure, or where the light "
            "itself changed say so with --light-changes"
        )


def _phase_ratios(
    small: Sequence[np.ndarray], period: int, tables: LightTables, name: str
) -> tuple[ExposureRatio, ...]:
    """The exposure of each phase over the brightest one's, over the frames on both sides so that drift cancels."""
    phases = [np.concatenate(list(small[phase::period])) for phase in range(period)]
    order = np.argsort([-float(np.median(phase)) for phase in phases], kind="stable")
    result = [ExposureRatio(np.zeros(3), np.zeros(3))] * period
    for before, number in pairwise(order):
        what = f"{name}, exposure {number + 1} of {period}"
        step = ratio_of_quantiles(phases[before], phases[number], tables, what)
        last = result[before]
        result[number] = ExposureRatio(last.logarithm + step.logarithm, np.hypot(last.error, step.error))
    return tuple(result)
