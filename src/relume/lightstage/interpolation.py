"""Reflectance between the lights: what share each light of a stage has in light from any direction.

R(ω) ≈ Σ_i w_i(ω) R_i with Σ_i w_i = 1, so that light of directions ω_m and irradiances E_m asks of light i
Σ_m w_i(ω_m) E_m. `NearestCell` is the paper's sum over cells (Debevec et al. 2000, eq. 4). `Smooth` is kriging:
the best guess where reflectance functions vary over `length` (Rasmussen & Williams 2006, "Gaussian Processes for
Machine Learning", section 2.7 and eq. 4.17).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial import KDTree

from relume.lightstage.lights import StageLights

_CHUNK = 16384
_NUGGET = 1e-9


class Interpolation(Protocol):
    """How what the lights did is carried over to other directions."""

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """The lights' shares (M, N) in light from unit directions (M, 3); each row sums to 1."""
        ...

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """Irradiances (N, C) float64 of the lights that stand for M directions with irradiances (M, C)."""
        ...


@dataclass(frozen=True)
class NearestCell:
    """Every direction counts for the light next to it."""

    def weights(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`: a single 1 in each row."""
        found = np.zeros((len(checked_directions(directions)), len(lights)))
        found[np.arange(len(found)), self._nearest(lights, directions)] = 1
        return found

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`."""
        power = checked_irradiances(irradiances, checked_directions(directions))
        nearest = self._nearest(lights, directions)
        return np.stack([np.bincount(nearest, channel, minlength=len(lights)) for channel in power.T], axis=1)

    def _nearest(self, lights: StageLights, directions: np.ndarray) -> np.ndarray:
        return np.asarray(KDTree(lights.directions).query(np.asarray(directions, np.float64))[1])


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
        return np.linalg.solve(self._system(lights), constrained.T)[:-1].T

    def gathered(self, lights: StageLights, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """As of every `Interpolation`; sums covariances first and solves once, so that M may be millions."""
        power = checked_irradiances(irradiances, checked_directions(directions))
        right = np.zeros((len(lights) + 1, power.shape[1]))
        for begin in range(0, len(power), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            right[:-1] += self._covariance(lights, directions[part]).T @ power[part]
        right[-1] = power.sum(axis=0)
        return np.linalg.solve(self._system(lights), right)[:-1]

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
        length = self.length or self.cells * float(np.sqrt(np.median(lights.solid_angles)))
        # Of the chord: of the angle along the sphere a Matérn-3/2 function is no covariance (Gneiting 2013), and with
        # few lights and a long reach weights would explode.
        chord = np.sqrt(np.clip(2 - 2 * directions @ lights.directions.T, 0, 4))
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
    """The irradiances (M, C), float64; raises ValueError unless there is one row for each direction, finite."""
    array = np.asarray(irradiances, np.float64)
    if array.ndim != 2 or len(array) != len(directions) or not np.all(np.isfinite(array)):
        raise ValueError(f"irradiances are {array.shape}; expected {len(directions)} rows of finite numbers")
    return array
