"""Intensities of a stage's lamps that light a subject as an environment map would (Light Stage 3).

"If the required lighting is known beforehand, live-action performance can be captured … with correct photometric
interactions" (course slides, section 10). Lamps stand at single directions, so the map cannot be had itself; what is
matched is what a subject shows of it: irradiance over all normals, highlights of a given width, or the pixels of a
subject whose reflectance field is known. Irradiance is in the map's unit times sr. Colours are linear Rec. 709 RGB, as
the subject's irradiance; an intensity is a factor on the irradiance of one of a lamp's primaries.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import warn
from relume.lightstage.driving.subjects import MeasuredSubject, SurfaceSubject
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import NearestLight
from relume.lightstage.relighting.stage_lighting import irradiances
from relume.sphere.environment_map import EnvironmentMap

_STEPS = 200
_CONVERGED = 1e-9
_FAINTEST = 0.01
"""The share of the mean intensity below which lamps are equally stiff."""
_WARNED = 0.01
"""A share of the light from which on a warning is due: nobody sees less."""


@dataclass(frozen=True, eq=False)
class LampPrimaries:
    """What every lamp of a stage is made of.

    names : of the primaries, unique, like ("red", "green", "blue", "white")
    irradiance : (P, 3) float64, linear RGB that a primary of intensity 1 gives a surface at the subject that faces the
        lamp. Its unit is that of the map that will be shown, times sr; a primary outside Rec. 709 has negative numbers
    maximum : the highest intensity; infinite where none is known
    """

    names: tuple[str, ...]
    irradiance: np.ndarray
    maximum: float = np.inf

    def __post_init__(self) -> None:
        count = len(self.names)
        if count == 0 or len(set(self.names)) != count or self.irradiance.shape != (count, 3):
            raise ValueError(
                f"primaries {', '.join(self.names) or 'without names'} with irradiance {self.irradiance.shape}; "
                "expected each its own name and (primaries, 3) numbers"
            )
        if not np.all(np.isfinite(self.irradiance)) or np.any(self.irradiance.sum(axis=1) <= 0):
            raise ValueError(
                f"irradiance of the primaries is {self.irradiance.tolist()}; expected that each gives light"
            )
        if not self.maximum > 0:
            raise ValueError(f"the highest intensity is {self.maximum}; expected a number above 0")

    def __len__(self) -> int:
        return len(self.names)

    @staticmethod
    def white(maximum: float = np.inf) -> LampPrimaries:
        """Lamps that can only be dimmed; intensity 1 is irradiance (1, 1, 1), and `maximum` the highest intensity."""
        return LampPrimaries(("white",), np.ones((1, 3)), maximum)

    @staticmethod
    def rgb(maximum: float = np.inf) -> LampPrimaries:
        """Lamps of any colour; intensities are the irradiance's own R, G and B, up to `maximum`."""
        return LampPrimaries(("red", "green", "blue"), np.eye(3), maximum)

    def nearest(self, colours: ArrayLike) -> np.ndarray:
        """Intensities (…, P), at least 0 and without a maximum, whose colour is nearest to linear RGB `colours` (…, 3).

        Nearest in the sum of squares, by non-negative least squares (Lawson & Hanson 1974, chapter 23).
        """
        from scipy.optimize import nnls

        wanted = np.asarray(colours, np.float64)
        flat = wanted.reshape(-1, 3)
        found = np.array([nnls(self.irradiance.T, colour)[0] for colour in flat]).reshape(len(flat), len(self))
        return found.reshape(*wanted.shape[:-1], len(self))

    def beyond_gamut(self, colours: ArrayLike, weights: ArrayLike) -> float:
        """The share of `colours` (…, 3) that no mix of the primaries makes, 0 where all can be made.

        The distance to the nearest mix over the length of the colour, both summed with weights (…).
        """
        wanted, weight = np.asarray(colours, np.float64), np.asarray(weights, np.float64)
        total = float((weight * np.linalg.norm(wanted, axis=-1)).sum())
        missed = np.linalg.norm(wanted - self.nearest(wanted) @ self.irradiance, axis=-1)
        return float((weight * missed).sum()) / total if total > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Drive:
    """What every lamp of a stage is set to.

    lights, primaries : of the stage
    intensities : (N, P) float64, from 0 to `primaries.maximum`
    residual : (3,), what remains of the subject's look in R, G and B: the root of the mean square over its normals,
        directions or pixels, as a share of that of its look under the map
    clipped : how many intensities are at the maximum
    headroom : by what the map could be multiplied with no lamp above the maximum; below 1 the stage cannot reach the
        map's level, and the map times this factor is the brightest that it shows faithfully
    beyond_gamut : the share of the subject's look whose colour no mix of the primaries makes
    """

    lights: StageLights
    primaries: LampPrimaries
    intensities: np.ndarray
    residual: np.ndarray
    clipped: int = 0
    headroom: float = np.inf
    beyond_gamut: float = 0.0

    @property
    def irradiances(self) -> np.ndarray:
        """What each lamp gives, (N, 3) float64: with a reflectance field of the same lights, what is then seen."""
        return self.intensities @ self.primaries.irradiance


def drive(
    lights: StageLights,
    light: EnvironmentMap,
    primaries: LampPrimaries | None = None,
    subject: SurfaceSubject | MeasuredSubject = SurfaceSubject(),
    *,
    closeness: float = 0.1,
) -> Drive:
    """The intensities under which a subject looks most as under an environment map, by bounded least squares.

    Two terms together are least: the sum over the subject of (seen under the lamps − seen under the map)², and
    `closeness` times how far each lamp is from what its cell of the map holds, as a share of that. On a matte subject
    many settings look alike; of these it is the one nearest to the map. Convex, so there is one answer.

    lights : the stage's lamps
    light : the map that they shall light like
    primaries : of each lamp; RGB without a maximum unless given
    subject : matte unless given, as a face nearly is
    closeness : its weight, in units of the mean square with which a lamp is seen. The default costs a matte ball
        little. At a hundredth of it lamps go out to make up for the sun's, which shows where a face is in shadow
    Warns where the stage cannot reach the map's level or colours.
    """
    lamps = LampPrimaries.rgb() if primaries is None else primaries
    result = driven(lights, light, lamps, seen_of(lights, lamps, subject), subject, closeness)
    _warn(result)
    return result


@dataclass(frozen=True, eq=False)
class Seen:
    """What is the same for every map that a stage shows.

    values : (M, N) or (M, N, 3), what is seen of the subject per unit irradiance of each light
    weights : (M,) how much each counts
    gram : (NP, NP) the quadratic form of all intensities
    """

    values: np.ndarray
    weights: np.ndarray
    gram: np.ndarray


def seen_of(lights: StageLights, primaries: LampPrimaries, subject: SurfaceSubject | MeasuredSubject) -> Seen:
    """What a stage's lights show of a subject; it takes longer than one map's solve."""
    values, weights = subject.lit_by(lights), subject.weights
    return Seen(values, weights, _gram(values, weights, primaries.irradiance))


def driven(
    lights: StageLights,
    light: EnvironmentMap,
    lamps: LampPrimaries,
    seen: Seen,
    subject: SurfaceSubject | MeasuredSubject,
    closeness: float,
) -> Drive:
    """As `drive`, of what is seen already, and without its warnings."""
    if not 0 < closeness < np.inf:
        raise ValueError(f"closeness is {closeness}; expected a number above 0, like 0.1")
    wanted = subject.under(light)
    start = lamps.nearest(irradiances(lights, light, NearestLight()))
    # A change counts less where there is much, so that a sun's lamps give way first.
    mean = float(start.mean())
    stiffness = mean / (start.ravel() + _FAINTEST * mean) if mean > 0 else np.ones(start.size)
    held = closeness * float(np.trace(seen.gram)) / len(seen.gram) * stiffness
    gram = seen.gram + np.diag(held)
    rhs = _right_side(seen.values, wanted, seen.weights, lamps.irradiance) + held * start.ravel()
    free = bounded_least_squares(gram, rhs, np.inf, start.ravel())
    highest = float(free.max())
    headroom = lamps.maximum / highest if highest > 0 else np.inf
    found = free if headroom >= 1 else bounded_least_squares(gram, rhs, lamps.maximum, free)
    intensities = found.reshape(len(lights), len(lamps))
    return Drive(
        lights,
        lamps,
        intensities,
        _residual(seen.values, wanted, seen.weights, intensities @ lamps.irradiance),
        int((intensities >= lamps.maximum * (1 - 1e-9)).sum()) if headroom < 1 else 0,
        headroom,
        lamps.beyond_gamut(wanted, seen.weights),
    )


def bounded_least_squares(gram: np.ndarray, rhs: np.ndarray, maximum: float, start: np.ndarray) -> np.ndarray:
    """The x (n,) in [0, maximum] for which ½ xᵀGx − bᵀx is least; G (n, n) positive definite.

    Newton's step in what is free, shortened until the function falls on the way back into the box (projected Newton,
    Bertsekas 1982). Deterministic; ends where no free gradient is left, to rounding.
    """
    from scipy.linalg import cho_factor, cho_solve
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    count, part = connected_components(csr_array(gram != 0), directed=False)
    if count > 1:
        # Lamps of pure red, green and blue are three problems, each a ninth as large.
        x = np.empty_like(rhs)
        for number in range(count):
            own = np.flatnonzero(part == number)
            x[own] = bounded_least_squares(gram[np.ix_(own, own)], rhs[own], maximum, start[own])
        return x
    x = np.clip(start, 0, maximum)
    scale = max(float(np.abs(rhs).max()), 1e-300)
    for _ in range(_STEPS):
        gradient = gram @ x - rhs
        moved = np.clip(x - gradient / gram.diagonal(), 0, maximum) - x
        near = min(float(np.abs(moved).max()), 1e-3 * max(float(x.max()), 1e-300))
        if np.abs(moved * gram.diagonal()).max() <= _CONVERGED * scale:
            break
        # What is at a bound, or nearly, and pushed against it stays out of the Newton step.
        stays = ((x <= near) & (gradient > 0)) | ((x >= maximum - near) & (gradient < 0))
        step = -gradient / gram.diagonal()
        free = np.flatnonzero(~stays)
        if free.size:
            step[free] = -cho_solve(cho_factor(gram[np.ix_(free, free)]), gradient[free])
        x = _descended(gram, rhs, x, step, maximum)
    return x


def _descended(gram: np.ndarray, rhs: np.ndarray, x: np.ndarray, step: np.ndarray, maximum: float) -> np.ndarray:
    """The first of x + step, x + step/2, … cut off at the bounds, where the function is lower than at x."""
    gradient = gram @ x - rhs
    for halvings in range(60):
        there = np.clip(x + step * 0.5**halvings, 0, maximum)
        change = there - x
        if change @ gradient + 0.5 * change @ gram @ change <= 1e-4 * min(change @ gradient, 0):
            return there
    return x


def _gram(seen: np.ndarray, weights: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """G of all intensities, light · primaries + primary; the look is a sum over lights, primaries and channels."""
    lights, primaries = seen.shape[1], len(colours)
    gram = np.zeros((lights, primaries, lights, primaries))
    for channel in range(3):
        look = (seen if seen.ndim == 2 else seen[..., channel]).astype(np.float64)
        colour = colours[:, channel]
        if seen.ndim == 3 or channel == 0:
            product = (look * weights[:, None]).T @ look
        gram += np.einsum("ij,p,q->ipjq", product, colour, colour)
    return gram.reshape(lights * primaries, lights * primaries)


def _right_side(seen: np.ndarray, wanted: np.ndarray, weights: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """b of all intensities, in the order of `_gram`."""
    rhs = np.zeros((seen.shape[1], len(colours)))
    for channel in range(3):
        look = (seen if seen.ndim == 2 else seen[..., channel]).astype(np.float64)
        rhs += np.outer((look * weights[:, None]).T @ wanted[:, channel], colours[:, channel])
    return rhs.ravel()


def _residual(seen: np.ndarray, wanted: np.ndarray, weights: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
    shown = seen @ irradiances if seen.ndim == 2 else np.einsum("mnc,nc->mc", seen, irradiances)
    missed, whole = weights @ np.square(shown - wanted), weights @ np.square(wanted)
    return np.sqrt(np.where(whole > 0, missed / np.where(whole > 0, whole, 1), np.where(missed > 0, np.inf, 0)))


def _warn(result: Drive) -> None:
    if result.headroom < 1:
        warn(
            f"{result.clipped} intensities are at their maximum and the stage stays below the map's level; show the "
            f"map times {result.headroom:.3g}"
        )
    if result.beyond_gamut > _WARNED:
        warn(
            f"{result.beyond_gamut:.1%} of the light has colours that no mix of {', '.join(result.primaries.names)} "
            "makes; the nearest are shown"
        )
