"""What is known of a camera's sensor: its levels and its noise, estimated from the photographs (photon transfer)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

_BINS = 24
_FEWEST = 200
"""Differences in a bin; its variance is then known to a tenth."""
APART = 1e-3
"""Of the range from black to white, by which levels may differ unheeded: a scale to cd/m² moves by no more, and cameras
that measure their black anew in every frame stay well below."""


@dataclass(frozen=True)
class SensorNoise:
    """What makes a photosite's signal scatter: the signal is 1 at white and its variance shot · signal + read².

    shot : the inverse of the electrons that a photosite holds at white
    read : standard deviation where there is no light, of the signal
    iso : the sensitivity at which they were measured
    """

    shot: float
    read: float
    iso: float = 100.0

    def __post_init__(self) -> None:
        if not (np.isfinite([self.shot, self.read]).all() and self.shot >= 0 and self.read >= 0 and self.iso > 0):
            raise ValueError(f"shot is {self.shot}, read {self.read}, iso {self.iso}; noise is not negative")

    def at(self, iso: float | None) -> SensorNoise:
        """The noise at another sensitivity: the gain raises both, as when all read noise arises before it."""
        gain = (iso or self.iso) / self.iso
        return SensorNoise(self.shot * gain, self.read * gain, iso or self.iso)


def noise_between(first: np.ndarray, second: np.ndarray, ratio: float, saturation: float) -> np.ndarray:
    """Rows (shot's factor, read²'s factor, variance, differences) of how two exposures of one scene differ.

    first, second : (N,) signals of the same photosites; `second` got `ratio` times the light
    saturation : signals above it say nothing

    Bins are of the sum of both, which does not depend on how it was shared out. A bin's variance is that of the
    differences within four deviations, so that what moved does not count.
    """
    total = first + second
    used = total < 0.8 * saturation
    return _binned(total[used], (second - ratio * first)[used], ratio, 1 + ratio**2)


def noise_within(signal: np.ndarray) -> np.ndarray:
    """The same of one exposure, from second differences between photosites of one colour.

    signal : (..., W), every second column of a row is of one colour

    What the scene itself bends is taken for noise, so this is an upper bound where all of it is textured.
    """
    before, here, after = signal[..., :-4], signal[..., 2:-2], signal[..., 4:]
    mean = (before + here + after) / 3
    used = mean < 0.8
    return _binned(mean[used], (before - 2 * here + after)[used], 6.0, 6.0)


def _binned(level: np.ndarray, difference: np.ndarray, shot: float, read: float) -> np.ndarray:
    """A row a bin of equally many levels; empty where there are too few."""
    bins = min(_BINS, len(level) // _FEWEST)
    rows = []
    for part in np.array_split(np.argsort(level, kind="stable"), bins) if bins else []:
        values = difference[part] - np.median(difference[part])
        width = 4 * 1.4826 * np.median(np.abs(values))
        inner = values[np.abs(values) <= width] if width > 0 else values
        rows.append((shot * level[part].mean(), read, inner.var(), len(part)))
    return np.array(rows).reshape(-1, 4)


def fitted_noise(rows: np.ndarray, iso: float) -> SensorNoise | None:
    """Least squares for shot and read² over bins of differences; None where they are too few or show no noise.

    Bins that stand out, by motion or texture, lose their weight round by round.
    """
    from scipy.optimize import nnls

    if len(rows) < 2 or not rows[:, 2].any():
        return None
    factors, variance = np.maximum(rows[:, :2], 0), rows[:, 2]
    expected = np.maximum(variance, np.median(variance) * 1e-6)
    trust = np.ones(len(rows))
    shot, square = 0.0, 0.0
    for _ in range(12):
        weight = trust * np.sqrt(rows[:, 3]) / expected
        # The weakest of wishes, that read noise be 0, decides where all levels are one and nothing else can.
        wish = [0.0, factors[:, 1].mean() / np.median(expected)]
        shot, square = nnls(np.vstack([factors * weight[:, None], wish]), np.append(variance * weight, 0.0))[0]
        expected = np.maximum(factors @ [shot, square], np.median(variance) * 1e-6)
        # A variance of n differences scatters by √(2/n) of itself.
        doubt = np.abs(variance / expected - 1) / (3 * np.sqrt(2 / rows[:, 3]))
        trust = 1 / np.sqrt(np.maximum(doubt, 1))
    return SensorNoise(float(shot), float(np.sqrt(square)), iso)


@dataclass(frozen=True)
class Sensor:
    """The levels and the noise of the raws of one camera.

    black : raw levels that no light gives: at even rows the even and the odd columns, then at odd rows
    white : the raw level at which its files say that photosites are saturated
    saturation : the signal, as a share of white above black, at which they are seen to be saturated
    noise : and the sensitivity at which it and the saturation were measured; None where the noise could not be measured
    """

    black: tuple[float, float, float, float]
    white: float
    saturation: float
    noise: SensorNoise | None

    def __post_init__(self) -> None:
        if len(self.black) != 4 or not np.isfinite([*self.black, self.white]).all() or max(self.black) >= self.white:
            raise ValueError(f"black is {self.black}, white {self.white}; expected four levels below white")
        if not 0 < self.saturation <= 1:
            raise ValueError(f"saturation is {self.saturation}; expected a share of white, above 0 and up to 1")

    def differs(self, other: Sensor) -> bool:
        """Whether black or white are others, so that a signal of one means another light in the other."""
        mine, theirs = np.array([*self.black, self.white]), np.array([*other.black, other.white])
        return bool(np.abs(mine - theirs).max() > APART * (self.white - min(self.black)))

    def to_dict(self) -> dict[str, Any]:
        """Plain values for a camera profile; `from_dict` reads them."""
        noise = None if self.noise is None else vars(self.noise)
        return {"black": list(self.black), "white": self.white, "saturation": self.saturation, "noise": noise}

    @staticmethod
    def from_dict(table: Mapping[str, Any]) -> Sensor:
        """The sensor that `to_dict` wrote; raises ValueError for anything else."""
        try:
            first, second, third, fourth = (float(level) for level in table["black"])
            stored = table["noise"]
            noise = None if stored is None else SensorNoise(*(float(stored[key]) for key in ("shot", "read", "iso")))
            return Sensor((first, second, third, fourth), float(table["white"]), float(table["saturation"]), noise)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"not a sensor of relume: {error}") from None
