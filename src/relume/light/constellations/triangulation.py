"""Lamps that two probes see: their places from the rays that meet, their intensity from both (*Fiat Lux*, 1999)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import LampsNotMatched
from relume.image.colour import LUMINANCE_WEIGHTS
from relume.light.constellations.constellation import Constellation
from relume.light.constellations.placement import PlacedLights, chosen, point, radii_at

DEVIATIONS = 3.0
"""Standard deviations by which rays of one lamp may miss each other; of a thousand, three miss by more."""


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Lamps seen by two probes.

    points : the lamps that have a place, in the order of the first probe
    pairs : (N, 2) int, of each of them its number in the first and in the second probe
    misses : (N,) metres, how near its two rays come to each other
    uncertainty : (N,) metres, the standard deviation of its position, in the worst direction
    ratios : (N,) its intensity by the second probe over that by the first
    far : (F, 2) int, pairs of lamps that are too far to have a place
    unmatched : the numbers of lamps that only the first probe has, (U,), and only the second, (V,)
    distant : the first probe's lights that have no place: first the far, then its unmatched
    """

    points: PlacedLights
    pairs: np.ndarray
    misses: np.ndarray
    uncertainty: np.ndarray
    ratios: np.ndarray
    far: np.ndarray
    unmatched: tuple[np.ndarray, np.ndarray]
    distant: Constellation


def triangulated(
    first: Constellation,
    second: Constellation,
    at: ArrayLike,
    second_at: ArrayLike,
    *,
    uncertainty: float = np.radians(0.5),
    ratio: float = 1.5,
    tint: float = 0.1,
) -> Triangulated:
    """The places of lamps that two probes see, and their intensity.

    first, second : compact sources, as `extract_sun(light, count).lights()` finds them; both maps in the world's axes
    at, second_at : (3,), metres, where the probes stood
    uncertainty : radians, standard deviation of a direction. 0.5° is what balls are registered to, or a pixel of a map
        of 360 rows
    ratio : intensity E·d² by one probe over that by the other, at most. 1.5 lets lamps differ a little by direction
    tint : largest difference of the shares of red, green and blue. 0.1 is a few hundred kelvin between lamps

    Lamps are matched one to one so that rays miss least and intensities and tints agree best (Kuhn 1955). The place is
    where both rays are likeliest to meet, the intensity the geometric mean of both. Where a place were uncertain by
    more than a third of its distance, and irradiances agree, the lamp is far and stays distant.
    Raises LampsNotMatched where no lamp has a partner; ValueError for probes at one place and numbers that cannot be.
    """
    # Two places, apart from each other.
    starts = np.stack([point(at, "at"), point(second_at, "second_at")])
    if not (0 < uncertainty < 0.5 and ratio > 1 and tint > 0):
        raise ValueError(
            f"uncertainty {uncertainty} rad, ratio {ratio}, tint {tint}; expected 0 to 0.5 rad, above 1, above 0"
        )
    apart = float(np.linalg.norm(starts[1] - starts[0]))
    if apart < 1e-6:
        raise ValueError(f"both probes stood at {starts[0].tolist()}; lamps have a place only where the probes differ")
    # Which lamp of one map is which of the other; of these, far ones and near ones.
    meeting = _Meeting.of(first, second, starts, uncertainty)
    pairs = _matched(meeting.cost(ratio, tint))
    if not len(pairs):
        raise LampsNotMatched(_why_no_match(meeting, len(first.directions), len(second.directions)))
    rows, columns = pairs.T
    is_far = meeting.far[rows, columns]
    far, near = pairs[is_far], pairs[~is_far]
    i, j = near.T
    only = [np.setdiff1d(np.arange(number), taken) for number, taken in zip(meeting.far.shape, pairs.T, strict=True)]
    # Intensities and sizes of the near ones: geometric means of what both maps show.
    lamps = (chosen(first, i), chosen(second, j))
    distances = meeting.distances[:, i, j]
    intensities = [lamp.irradiance * reach[:, None] ** 2 for lamp, reach in zip(lamps, distances, strict=True)]
    sizes = [radii_at(lamp, reach) for lamp, reach in zip(lamps, distances, strict=True)]
    radii = None if sizes[0] is None or sizes[1] is None else np.sqrt(sizes[0] * sizes[1])
    return Triangulated(
        PlacedLights(meeting.places[i, j], np.sqrt(intensities[0] * intensities[1]), radii),
        near,
        meeting.misses[i, j],
        meeting.spread[i, j],
        meeting.ratios[i, j],
        far,
        (only[0], only[1]),
        chosen(first, np.concatenate([far[:, 0], only[0]])),
    )


@dataclass(frozen=True, eq=False)
class _Meeting:
    """Every lamp of the first probe (N) with every one of the second (M).

    distances : (2, N, M), from both probes, not positive where rays part
    allowed : of the miss, in metres
    vague : the place is as uncertain as its distance
    """

    distances: np.ndarray
    misses: np.ndarray
    allowed: np.ndarray
    places: np.ndarray
    spread: np.ndarray
    vague: np.ndarray
    far: np.ndarray
    ratios: np.ndarray
    tints: np.ndarray

    @staticmethod
    def of(first: Constellation, second: Constellation, starts: np.ndarray, uncertainty: float) -> _Meeting:
        u, v = np.broadcast_arrays(first.directions[:, None], second.directions[None])
        across = starts[1] - starts[0]
        cosine = np.sum(u * v, axis=-1)
        normal = np.cross(u, v)
        # Parallel rays meet nowhere; the least sine keeps their distance finite, and far they are.
        square = np.maximum(np.sum(normal**2, axis=-1), 1e-18)
        along, back = u @ across, v @ across
        distances = np.stack([(along - cosine * back) / square, (cosine * along - back) / square])
        nearest = [starts[0] + distances[0][..., None] * u, starts[1] + distances[1][..., None] * v]
        reach = np.maximum(np.abs(distances), 1e-9)
        weights = 1 / reach**2
        places = weights[0][..., None] * nearest[0] + weights[1][..., None] * nearest[1]
        places /= weights.sum(axis=0)[..., None]
        # A ray constrains a place across it, the better the nearer it is.
        known = sum(
            (np.eye(3) - way[..., :, None] * way[..., None, :]) * weight[..., None, None]
            for way, weight in ((u, weights[0]), (v, weights[1]))
        )
        least = np.maximum(np.linalg.eigvalsh(known)[..., 0], 1e-30)
        spread = uncertainty / np.sqrt(least)
        given, taken = first.irradiance @ LUMINANCE_WEIGHTS, second.irradiance @ LUMINANCE_WEIGHTS
        given, taken = np.maximum(given, 1e-300)[:, None], np.maximum(taken, 1e-300)[None]
        # Rays that are parallel within chance come from far away, unless the lamp is known to be near all the same.
        parallel = (cosine > 0) & (square < 2 * (DEVIATIONS * uncertainty) ** 2)
        vague = spread * DEVIATIONS > reach.min(axis=0)
        far = parallel & (vague | np.any(distances <= 0, axis=0))
        ratios = np.where(far, taken / given, taken * distances[1] ** 2 / (given * distances[0] ** 2 + 1e-300))
        shares = [
            light.irradiance / np.maximum(light.irradiance.sum(axis=-1, keepdims=True), 1e-300)
            for light in (first, second)
        ]
        return _Meeting(
            distances,
            np.linalg.norm(nearest[1] - nearest[0], axis=-1),
            DEVIATIONS * uncertainty * np.sqrt(np.sum(reach**2, axis=0)),
            places,
            spread,
            vague,
            far,
            ratios,
            np.abs(shares[0][:, None] - shares[1][None]).max(axis=-1),
        )

    def cost(self, ratio: float, tint: float) -> np.ndarray:
        """Of each pair, from 0 to 3; infinite where it cannot be."""
        missed = np.where(self.far, 0.0, self.misses / self.allowed)
        differing = np.abs(np.log(np.maximum(self.ratios, 1e-300))) / np.log(ratio)
        tinted = self.tints / tint
        fits = (missed <= 1) & (differing <= 1) & (tinted <= 1) & (self.far | np.all(self.distances > 0, axis=0))
        # A lamp whose place is as uncertain as its distance is neither here nor far: on the line through both probes.
        fits &= self.far | ~self.vague
        return np.where(fits, missed**2 + differing**2 + tinted**2, np.inf)


def _matched(cost: np.ndarray) -> np.ndarray:
    """Pairs (K, 2) of least cost in all, in the order of the first; those that cannot be are left out."""
    from scipy.optimize import linear_sum_assignment

    # A pair that cannot be costs more than any that can; both of it stay alone.
    rows, columns = linear_sum_assignment(np.where(np.isfinite(cost), cost, 4.0))
    kept = np.isfinite(cost[rows, columns])
    return np.stack([rows[kept], columns[kept]], axis=-1)


def _why_no_match(meeting: _Meeting, number: int, other: int) -> str:
    if not number or not other:
        return f"the probes have {number} and {other} lamps; nothing can be matched"
    meet = np.all(meeting.distances > 0, axis=0) & ~meeting.far
    if not meet.any():
        return f"none of {number} and {other} lamps match: no two rays meet; check the places and the maps' turns"
    share = np.where(meet, meeting.misses / meeting.allowed, np.inf)
    i, j = np.unravel_index(np.argmin(share), share.shape)
    if share[i, j] > 1:
        return (
            f"none of {number} and {other} lamps match: the nearest rays miss by {meeting.misses[i, j]:.2g} m, where "
            f"{meeting.allowed[i, j]:.2g} m is allowed; check the places and the maps' turns"
        )
    if meeting.vague[i, j]:
        return (
            f"none of {number} and {other} lamps match: they lie about the line through both probes, where rays say "
            "no place; put one of the probes aside"
        )
    return (
        f"none of {number} and {other} lamps match: rays meet, but intensities or tints differ (by "
        f"{meeting.ratios[i, j]:.2g} times where the nearest meet); check the places and both maps' exposure"
    )
