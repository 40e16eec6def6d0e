"""Values that change with time: keys, and what lies between them; and when the shutter is open.

Before the first key and after the last the ends hold.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Interpolation(Protocol):
    """A frozen value; what lies between two keys."""

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at a time from times[index] to times[index + 1]."""
        ...


@dataclass(frozen=True)
class Step:
    """The value of the key before."""

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at `time`."""
        return values[index + 1] if time >= times[index + 1] else values[index]


@dataclass(frozen=True)
class Linear:
    """A straight line from key to key."""

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at `time`."""
        share = (time - times[index]) / (times[index + 1] - times[index])
        return (1 - share) * values[index] + share * values[index + 1]


@dataclass(frozen=True)
class Smooth:
    """A cubic through all keys without corners; each key is passed with the speed from the key before to that after it.

    (Catmull & Rom 1974, for keys that need not be evenly spaced.) At the ends the speed is that of the straight line.
    """

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at `time`."""
        spans = [(max(key - 1, 0), min(key + 1, len(times) - 1)) for key in (index, index + 1)]
        slopes = [(values[last] - values[first]) / (times[last] - times[first]) for first, last in spans]
        return _hermite(times[index : index + 2], values[index : index + 2], slopes, time)


@dataclass(frozen=True, eq=False)
class Tangents:
    """A cubic whose slopes are given at each key (glTF 2.0, CUBICSPLINE).

    arriving, leaving : (N, …) like the values, per second
    """

    arriving: np.ndarray
    leaving: np.ndarray

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at `time`."""
        slopes = self.leaving[index], self.arriving[index + 1]
        return _hermite(times[index : index + 2], values[index : index + 2], slopes, time)


@dataclass(frozen=True)
class Slerp:
    """Unit quaternions (x, y, z, w): the shorter way round at an even speed (Shoemake 1985)."""

    def between(self, times: np.ndarray, values: np.ndarray, index: int, time: float) -> np.ndarray:
        """The value at `time`, a unit quaternion."""
        from scipy.spatial import transform

        ends = slice(index, index + 2)
        return transform.Slerp(times[ends], transform.Rotation.from_quat(values[ends]))(time).as_quat()


@dataclass(frozen=True, eq=False)
class Track:
    """A value that changes with time.

    times : (N,) rising, in frames or seconds
    values : (N, …), float64
    interpolation : what lies between the keys; straight lines unless given

    Raises ValueError for no keys, times that do not rise, or as many values as there are not times.
    """

    times: np.ndarray
    values: np.ndarray
    interpolation: Interpolation = Linear()

    def __post_init__(self) -> None:
        times, values = np.asarray(self.times, np.float64), np.asarray(self.values, np.float64)
        if times.ndim != 1 or not len(times) or len(values) != len(times):
            raise ValueError(f"{len(values)} values at times of shape {times.shape}; expected one each, and at least 1")
        if not np.all(np.isfinite(times)) or not np.all(np.diff(times) > 0):
            raise ValueError(f"times {times.tolist()}; expected each later than the one before")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    def at(self, time: float) -> np.ndarray:
        """The value at a time; the first key's before it, the last one's after it."""
        if time <= self.times[0]:
            return self.values[0]
        if time >= self.times[-1]:
            return self.values[-1]
        index = int(np.searchsorted(self.times, time, side="right")) - 1
        return self.interpolation.between(self.times, self.values, index, time)


@dataclass(frozen=True, eq=False)
class Turning:
    """A rotation given in degrees about x, then y, then z, that changes with time.

    times : (N,) rising
    degrees : (N, 3)
    interpolation : of a single angle between two keys that differ in it alone, so that 0 and 360 are a full turn;
        rotations that differ in more take the shorter way round: straight lines as `Slerp`, at an even speed

    Where a single angle changes by less than half a turn, both are the same.
    """

    times: np.ndarray
    degrees: np.ndarray
    interpolation: Interpolation = Linear()

    def at(self, time: float) -> np.ndarray:
        """The three angles at a time, degrees."""
        track = Track(self.times, self.degrees, self.interpolation)
        if not track.times[0] < time < track.times[-1]:
            return track.at(time)
        index = int(np.searchsorted(track.times, time, side="right")) - 1
        pair = track.values[index : index + 2]
        if np.count_nonzero(pair[0] != pair[1]) <= 1 or isinstance(self.interpolation, Step):
            return track.at(time)
        from scipy.spatial.transform import Rotation

        ends = _nearest_signs(Rotation.from_euler("xyz", track.values, degrees=True).as_quat())
        between = Slerp() if isinstance(self.interpolation, Linear) else self.interpolation
        turn = Rotation.from_quat(Track(track.times, ends, between).at(time))
        with warnings.catch_warnings():  # where y is a right angle, x and z turn about one axis: z is 0 then
            warnings.simplefilter("ignore", UserWarning)
            return turn.as_euler("xyz", degrees=True)


def _nearest_signs(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations, each with that of its two signs that is nearer to the one before."""
    result = quaternions.copy()
    for index in range(1, len(result)):
        if result[index] @ result[index - 1] < 0:
            result[index] = -result[index]
    return result


def _hermite(times: np.ndarray, ends: np.ndarray, slopes: Sequence[np.ndarray], time: float) -> np.ndarray:
    """The cubic between two times, with the given ends and slopes there."""
    (first, second), (leaving, arriving), span = ends, slopes, times[1] - times[0]
    t = (time - times[0]) / span
    return (
        (2 * t**3 - 3 * t**2 + 1) * first
        + (t**3 - 2 * t**2 + t) * span * leaving
        + (3 * t**2 - 2 * t**3) * second
        + (t**3 - t**2) * span * arriving
    )


@dataclass(frozen=True)
class Shutter:
    """When the shutter opens and closes, as shares of a frame's time after the frame's moment.

    open, close : −0.25 and 0.25, half of the frame's time about its moment as a film camera's half-turn shutter, unless
        given; alike for no blur
    """

    open: float = -0.25
    close: float = 0.25

    def __post_init__(self) -> None:
        if not -1 <= self.open <= self.close <= 1:
            raise ValueError(f"a shutter from {self.open} to {self.close}; expected shares from −1 to 1, in order")

    def times(self, passes: int, seed: int = 0) -> np.ndarray:
        """(passes,) shares of a frame's time, one a pass: one in each of as many equal parts, in a mixed order.

        Mixed, so that the first few passes, which a preview shows and a stop at a noise leaves it at, cover the whole
        time too. The same for every frame of a seed.
        """
        if passes < 1:
            raise ValueError(f"{passes} passes; expected 1 or more")
        rng = np.random.default_rng(np.random.SeedSequence([seed, 0x5107]))
        shift = rng.random(passes)
        # The radical inverse orders any first part of the passes evenly, whatever their number.
        order = np.argsort(np.argsort([_inverse(index) for index in range(passes)], kind="stable"))
        return self.open + (self.close - self.open) * (order + shift) / passes


def _inverse(index: int) -> float:
    """The bits of `index` mirrored about the point (van der Corput)."""
    result, part = 0.0, 0.5
    while index:
        result += part * (index & 1)
        index, part = index >> 1, part / 2
    return result
