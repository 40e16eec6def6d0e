"""Reflectance between the lights: what share each light of a stage has in light from any direction.

R(ω) ≈ Σ_i w_i(ω) R_i with Σ_i w_i = 1, so that light of directions ω_m and irradiances E_m asks of light i
Σ_m w_i(ω_m) E_m. `NearestLight` is the paper's sum over cells (Debevec et al. 2000, eq. 4). `Smooth` is kriging:
the best guess where reflectance functions vary over `length` (Rasmussen & Williams 2006, "Gaussian Processes for
Machine Learning", section 2.7 and eq. 4.17). Its shares may be below 0, and so may pictures of a mirror, whose
functions are spikes. `Barycentric` has none below 0: the three lights around a direction share it.

Where no light is near, as behind half a stage, nothing is known: both go over to the nearest light (`reached`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import cut

_CHUNK = 16384
_NUGGET = 1e-9
REACH = (1.0, 2.0)
"""Widths of the median cell from the nearest light: up to the first a direction is between the lights, from the second
on beyond them. In full stages, on grids or spirals, none is farther than 0.85."""

OPEN = 2.5
"""A cell is at most so many times as wide as the next light is away, in full stages: 2.1 where lights stand by chance,
1 to 1.5 on grids and spirals. The cells of a dozen lights on one side fill the sphere, and say nothing of how far apart
the lights stand."""


class Interpolation(Protocol):
    """How what the lights did is carried over to other directions."""

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """The lights' shares (M, N) in light from unit directions (M, 3); each row sums to 1."""
        ...

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """Irradiances (N, C) float64 of the lights that stand for M directions with irradiances (M, C)."""
        ...


@dataclass(frozen=True)
class NearestLight:
    """Every direction counts for the light next to it."""

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`: a single 1 in each row."""
        found = np.zeros((len(checked_directions(directions)), len(lights)))
        found[np.arange(len(found)), self._nearest(lights, directions)] = 1
        return found

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`."""
        power = checked_irradiances(irradiances, directions)
        return _totals(self._nearest(lights, directions), power, len(lights))

    def _nearest(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        return np.asarray(KDTree(lights.directions).query(np.asarray(directions, np.float64))[1])


@dataclass(frozen=True)
class Barycentric:
    """The three lights around a direction share it by where it crosses their triangle; no share is below 0.

    Exact in the lights' own directions, and without a jump between them. The triangles are the lights' convex hull, a
    Delaunay triangulation of the sphere; without one around a direction, the nearest light takes all of it.
    """

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`; at most four of a row are not 0."""
        found = np.zeros((len(checked_directions(directions)), len(lights)))
        for part, index, share in self._shares(lights, directions):
            rows = np.arange(part.start, part.start + len(index))
            for corner in range(index.shape[1]):
                found[rows, index[:, corner]] += share[:, corner]
        return found

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`."""
        power = checked_irradiances(irradiances, directions)
        total = np.zeros((len(lights), power.shape[1]))
        for part, index, share in self._shares(lights, directions):
            for corner in range(index.shape[1]):
                total += _totals(index[:, corner], power[part] * share[:, corner, None], len(lights))
        return total

    def _shares(self, lights: StageLights, directions: np.ndarray) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """For some directions at a time: which lights (M, 4), three around and the nearest, and their shares (M, 4)."""
        corners, inverse = _triangles(lights)
        around = _around(corners, len(lights))
        tree = KDTree(lights.directions)
        for part in cut(len(directions), _CHUNK):
            towards = np.asarray(directions[part], np.float64)
            chord, nearest = tree.query(towards)
            index, share = _crossed(corners, inverse, around, towards, np.asarray(nearest))
            known = _known(lights, np.asarray(chord)) * share.sum(axis=1)
            shares = np.concatenate([share * known[:, None], 1 - known[:, None]], axis=1)
            yield part, np.concatenate([index, np.asarray(nearest)[:, None]], axis=1), shares


def _triangles(lights: StageLights) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (T, 3) of lights around the sphere, and the matrices (T, 3, 3) that give a direction's shares."""
    try:
        hull = ConvexHull(lights.directions)
    except (QhullError, ValueError):  # fewer than four lights, or all on one circle
        return np.zeros((0, 3), np.int64), np.zeros((0, 3, 3))
    # A dome's hull has a floor, and slivers along its rim. The circle through a triangle's corners holds no light:
    # where it is wider than lights reach, the triangle is not among the lights but beyond them.
    widest = min(REACH[1] * lights_width(lights), np.pi / 2)
    corners = hull.simplices[hull.equations[:, 3] < -max(float(np.cos(widest)), 1e-6)]
    matrices = lights.directions[corners].transpose(0, 2, 1)
    sound = np.abs(np.linalg.det(matrices)) > 1e-12
    return corners[sound].astype(np.int64), np.linalg.inv(matrices[sound])


def _around(corners: np.ndarray, count: int) -> np.ndarray:
    """The triangles at each light, (count, most of them), filled up with −1."""
    order = np.argsort(corners.reshape(-1), kind="stable")
    owner = corners.reshape(-1)[order]
    degree = np.bincount(owner, minlength=count)
    found = np.full((count, degree.max(initial=0)), -1, np.int64)
    found[owner, np.arange(len(owner)) - (degree.cumsum() - degree)[owner]] = order // 3
    return found


def _crossed(
    corners: np.ndarray, inverse: np.ndarray, around: np.ndarray, towards: np.ndarray, nearest: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Corners (M, 3) of the triangle that each direction crosses and their shares (M, 3); all 0 where there is none."""
    index, share = np.repeat(nearest[:, None], 3, axis=1), np.zeros((len(towards), 3))
    waiting = np.arange(len(towards))

    def tried(rows: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """Which of the rows cross these triangles of theirs; what they found is kept."""
        parts = np.einsum("mij,mj->mi", inverse[triangles], towards[rows])
        inside = parts.min(axis=1) >= -1e-9
        hit = np.maximum(parts[inside], 0)
        index[rows[inside]] = corners[triangles[inside]]
        share[rows[inside]] = hit / hit.sum(axis=1, keepdims=True)
        return inside

    # Nearly always the nearest light is one of the three; the rest look at all triangles.
    for place in range(around.shape[1]):
        candidates = around[nearest[waiting], place]
        rows = waiting[candidates >= 0]
        waiting = np.setdiff1d(waiting, rows[tried(rows, candidates[candidates >= 0])], assume_unique=True)
    if len(corners):
        for rows in np.array_split(waiting, len(waiting) // 256 + 1):
            least = np.einsum("tij,mj->mti", inverse, towards[rows]).min(axis=2)
            tried(rows, least.argmax(axis=1))
    return index, share


def _known(lights: StageLights, chord: np.ndarray) -> np.ndarray:
    """1 (M,) for directions whose nearest light is so near that they are between lights, 0 beyond, smooth from one to
    the other."""
    away = 2 * np.arcsin(np.clip(chord / 2, 0, 1)) / lights_width(lights)
    part = np.clip((REACH[1] - away) / (REACH[1] - REACH[0]), 0, 1)
    return part**2 * (3 - 2 * part)


def lights_width(lights: StageLights) -> float:
    """Radians across the lights' median cell; where most cells are open to where there are no lights, `OPEN` times the
    median angle to the next light."""
    width = float(np.sqrt(np.median(lights.solid_angles)))
    return min(width, OPEN * next_light(lights))


def shares_of_what_is_known(lights: StageLights) -> np.ndarray:
    """The lights' cells (N,) as shares of all of them, none wider than `OPEN` times the way to the next light.

    In a full stage these are the cells' shares of the sphere. Of a dome the cells at the rim reach round all that it
    has no lights for, and would count for nearly everything.
    """
    widest = (OPEN * next_light(lights)) ** 2
    cells = np.minimum(lights.solid_angles, max(widest, float(lights.solid_angles.min())))
    return np.asarray(cells / cells.sum())


def next_light(lights: StageLights) -> float:
    """The median angle from a light to the one nearest to it, radians; π for a single light."""
    if len(lights) < 2:
        return np.pi
    chord = np.asarray(KDTree(lights.directions).query(lights.directions, 2)[0])[:, 1]
    return float(2 * np.arcsin(np.clip(np.median(chord) / 2, 0, 1)))


def _totals(index: np.ndarray, power: np.ndarray, count: int) -> np.ndarray:
    """Irradiances (count, C) from power (M, C) that belongs to the lights `index` (M,)."""
    return np.stack([np.bincount(index, channel, minlength=count) for channel in power.T], axis=1)


def reached(lights: StageLights, directions: np.ndarray) -> np.ndarray:
    """How much of light from unit directions (M, 3) the lights around it account for: (M,), 1 down to 0.

    The rest comes from where the stage has no lights, and is given to the nearest (`REACH`).
    """
    return _known(lights, np.asarray(KDTree(lights.directions).query(checked_directions(directions))[0]))


def unreached_share(lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> float:
    """The share, 0 … 1, of light (M, 3) from M directions that comes from where no light of the stage is near."""
    power = checked_irradiances(irradiances, directions).sum(axis=1)
    total = power.sum()
    return float(power @ (1 - reached(lights, directions)) / total) if total > 0 else 0.0


@dataclass(frozen=True)
class Smooth:
    """Kriging with a constant mean and a Matérn-3/2 covariance of the chord; exact in the lights' own directions.

    length : radians over which reflectance functions vary; `cells` widths of the lights' median cell for None
    cells : 2.3 was best on a rendered head under 288 lights, a length of 0.5 radians
    noise : variance of what a light of mean cell says, over that of the reflectance functions; smaller cells have more.
        Above 0 a light no longer speaks alone in its own direction
    """

    length: float | None = None
    cells: float = 2.3
    noise: float = 0.0

    def __post_init__(self) -> None:
        if self.length is not None and not 0 < self.length < np.inf:
            raise ValueError(f"length is {self.length}; expected radians, more than 0")
        if not 0 < self.cells < np.inf or not 0 <= self.noise < np.inf:
            raise ValueError(f"cells {self.cells}, noise {self.noise}; expected more than 0, and 0 or more")

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`; some are below 0."""
        near = self._covariance(lights, checked_directions(directions))
        constrained = np.concatenate([near, np.ones((len(near), 1))], axis=1)
        known = reached(lights, directions)[:, None]
        shares = np.linalg.solve(self._system(lights), constrained.T)[:-1].T * known
        if known.min(initial=1) == 1:
            return shares
        return shares + NearestLight().weights(lights, directions) * (1 - known)

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`; sums covariances first and solves once, so that M may be millions."""
        power = checked_irradiances(irradiances, directions)
        right = np.zeros((len(lights) + 1, power.shape[1]))
        beyond = np.zeros((len(lights), power.shape[1]))
        tree = KDTree(lights.directions)
        for part in cut(len(power), _CHUNK):
            chord, nearest = tree.query(directions[part])
            known = _known(lights, np.asarray(chord))[:, None]
            right[:-1] += self._covariance(lights, directions[part]).T @ (power[part] * known)
            right[-1] += (power[part] * known).sum(axis=0)
            beyond += _totals(np.asarray(nearest), power[part] * (1 - known), len(lights))
        return np.linalg.solve(self._system(lights), right)[:-1] + beyond

    def _system(self, lights: StageLights) -> np.ndarray:
        """The matrix (N + 1, N + 1) of kriging: covariances, bordered by the constraint that weights sum to 1."""
        count = len(lights)
        system = np.ones((count + 1, count + 1))
        noise = _NUGGET + self.noise * lights.solid_angles.mean() / lights.solid_angles
        system[:count, :count] = self._covariance(lights, lights.directions) + np.diag(noise)
        system[count, count] = 0
        return system

    def _covariance(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """(M, N) between these directions and the lights."""
        length = self.length or self.cells * lights_width(lights)
        return _matern(np.sqrt(np.clip(2 - 2 * directions @ lights.directions.T, 0, 4)), length)


@dataclass(frozen=True)
class Remainder:
    """Kriging with a known mean of 0, of what a fit leaves over: exact in the lights' own directions, 0 far from all.

    The covariance is of two Matérn-3/2 functions of the chord: what neighbouring lights share, and what each shows
    alone (a highlight, a shadow's edge), which they do not believe of each other (Rasmussen &
    Williams 2006, eq. 2.25).

    length : radians over which neighbours share what is left over; 0.3 … 0.7 are alike on real sets
    alone : how much of the variance a light shows alone, over what it shares. With 0 neighbours believe all that one
        light shows; 0.3 … 1 are alike on real sets, and likelihood or cross-validation set by set chooses no better
    alone_length : radians over which that goes, in median angles to the next light: half way, so that nothing jumps
    """

    length: float = 0.5
    alone: float = 0.3
    alone_length: float = 0.5

    def of_each_alone(self, lights: StageLights) -> Remainder:
        """Of what no light shares with its neighbours."""
        return Remainder(length=self.alone_length * next_light(lights), alone=0.0)

    def own_part(self, values: np.ndarray, lights: StageLights, alone: float) -> np.ndarray:
        """What of values (N, K), one row a light, neighbours do not share: white noise of `alone` times the variance
        of what they share, by the same covariance (Rasmussen & Williams 2006, eq. 2.36)."""
        shared = replace(self, alone=0.0)._covariance(lights, lights.directions)
        return np.asarray(alone * np.linalg.solve(shared + alone * np.eye(len(lights)), values))

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """The lights' shares (M, N) in light from unit directions (M, 3); they do not sum to 1, and may be below 0."""
        near = self._covariance(lights, checked_directions(directions))
        return np.linalg.solve(self._system(lights), near.T).T

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`, but for the sum of the weights."""
        power = checked_irradiances(irradiances, directions)
        right = np.zeros((len(lights), power.shape[1]))
        for part in cut(len(power), _CHUNK):
            right += self._covariance(lights, directions[part]).T @ power[part]
        return np.linalg.solve(self._system(lights), right)

    def _system(self, lights: StageLights) -> np.ndarray:
        return self._covariance(lights, lights.directions) + _NUGGET * np.eye(len(lights))

    def _covariance(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """(M, N) between these directions and the lights, 1 for one and the same."""
        chord = np.sqrt(np.clip(2 - 2 * directions @ lights.directions.T, 0, 4))
        shared = _matern(chord, self.length)
        alone = _matern(chord, self.alone_length * next_light(lights))
        return (shared + self.alone * alone) / (1 + self.alone)


def _matern(chord: np.ndarray, length: float) -> np.ndarray:
    """Matérn's covariance of order 3/2 of chords; of the angle along the sphere it is none (Gneiting 2013), and with
    few lights and a long reach weights would explode."""
    reach = np.sqrt(3) / length * chord
    return (1 + reach) * np.exp(-reach)


def checked_directions(directions: np.ndarray) -> np.ndarray:
    """The directions (M, 3) themselves; raises ValueError for another shape and for other than unit lengths."""
    shape = np.shape(directions)
    if len(shape) != 2 or shape[1] != 3:
        raise ValueError(f"directions are {shape}; expected (M, 3)")
    if not np.allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-5):
        raise ValueError("a direction is not a unit vector; normalise it")
    return directions


def checked_irradiances(irradiances: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The irradiances (M, C), float64; raises ValueError unless there is one row for each unit direction, finite."""
    checked_directions(directions)
    array = np.asarray(irradiances, np.float64)
    if array.ndim != 2 or len(array) != len(directions) or not np.all(np.isfinite(array)):
        raise ValueError(f"irradiances are {array.shape}; expected {len(directions)} rows of finite numbers")
    return array
