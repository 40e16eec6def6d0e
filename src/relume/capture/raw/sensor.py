"""What is known of a camera's sensor, of one model as much as of one body: its levels and its noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.capture.raw.noise import SensorNoise

APART = 1e-3
"""Of the range from black to white, by which levels may differ unheeded: a scale to cd/m² moves by no more, and cameras
that measure their black anew in every frame stay well below."""


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
