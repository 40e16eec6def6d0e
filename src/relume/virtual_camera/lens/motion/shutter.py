"""How a shutter opens and closes: the share of the exposure's light that each instant lets through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shutter:
    """A shutter that opens evenly, stands open and closes as evenly.

    opening : share of the exposure, from the first light to the last, that it takes to open, and again to close; 0,
        a box, unless given, for a focal-plane shutter's slit passes any one pixel in far less than the exposure; ½ is a
        triangle, a leaf shutter at its shortest time

    Raises ValueError for a share out of 0 to ½.
    """

    opening: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.opening <= 0.5:
            raise ValueError(f"opening is {self.opening}; expected a share of the exposure from 0 to 0.5")

    def light(self, times: np.ndarray) -> np.ndarray:
        """The light let through at times from −½ to ½ of the exposure; its integral over them is 1."""
        left = 0.5 - np.abs(times)
        return (np.ones_like(left) if self.opening == 0 else np.minimum(1, left / self.opening)) / (1 - self.opening)

    @property
    def bends(self) -> tuple[float, ...]:
        """The times between which `light` is straight, first and last of the exposure included."""
        return (-0.5, self.opening - 0.5, 0.5 - self.opening, 0.5)
