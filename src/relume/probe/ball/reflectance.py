"""What a mirrored ball keeps of the light: its reflectance, and how that rises towards grazing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BallReflectance:
    """The share of light that a ball gives back, by channel and by angle of incidence.

    normal : at normal incidence, 0 to 1, one value for each channel
    rising : whether it rises to 1 at grazing as R + (1 − R)(1 − cos θ)⁵ (Schlick 1994), which metals and coatings do;
        False is one value for all angles, as a matte lacquer or a given mean has it

    Raises ValueError unless every value is above 0 and at most 1.
    """

    normal: tuple[float, float, float] = (1.0, 1.0, 1.0)
    rising: bool = True

    def __post_init__(self) -> None:
        if len(self.normal) != 3 or not all(0 < value <= 1 for value in self.normal):
            raise ValueError(f"normal is {self.normal}; a reflectance is three values above 0 and at most 1")

    def at(self, cosine: np.ndarray) -> np.ndarray:
        """The reflectance (…, 3) where the angle of incidence has the `cosine` (…)."""
        normal = np.array(self.normal)
        if not self.rising:
            return np.broadcast_to(normal, (*np.shape(cosine), 3))
        grazing = (1 - np.clip(np.asarray(cosine, np.float64), 0, 1)) ** 5
        return normal + (1 - normal) * grazing[..., None]


CHROME_STEEL = BallReflectance((0.550, 0.556, 0.554))
"""Chromium, as Unity's Metal Reflectance Node lists it among the metals; iron, which the steel under a worn coat mostly
is, has (0.560, 0.570, 0.580). Balls differ by more than that: measure where a few percent count."""


def measured_reflectance(mirrored: np.ndarray, direct: np.ndarray, *, rising: bool = True) -> BallReflectance:
    """The reflectance from one photograph that shows a card beside the ball and in it (Debevec 1998, §5.1's ball).

    mirrored : (…, 3) linear radiance of the card's image in the ball, near the middle of the ball, where light falls
        in steeply
    direct : (…, 3) linear radiance of the card itself, lit alike and seen from the same side
    rising : as in `BallReflectance`

    The median over the pixels is taken, so that an edge of the card does not count.
    Raises ValueError where the ball comes out brighter than the card, or black.
    """
    seen, true = (np.median(np.asarray(each, np.float64).reshape(-1, 3), axis=0) for each in (mirrored, direct))
    if not np.all(true > 0):
        raise ValueError(f"the card's radiance is {true.tolist()}; choose pixels where it is lit")
    ratio = seen / true
    if not np.all((ratio > 0) & (ratio <= 1)):
        raise ValueError(
            f"the card in the ball is {np.round(ratio, 3).tolist()} times as bright as the card itself; a ball "
            "reflects a share between 0 and 1: check that both are lit alike"
        )
    red, green, blue = ratio.tolist()
    return BallReflectance((red, green, blue), rising)
