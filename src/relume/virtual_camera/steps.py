"""The steps between radiance and a picture: what each kind is given and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from relume.virtual_camera.view import View


class Optics(Protocol):
    """Something that light passes on its way to the sensor or the retina: a part of a lens, or of an eye."""

    def applied(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it arrives, in its unit; the input stays as it was."""
        ...


@runtime_checkable
class Undoable(Protocol):
    """Optics whose effect can be taken out of a photograph's radiance again."""

    def undone(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it was before; NaN where the picture does not show it."""
        ...


@dataclass(frozen=True, eq=False)
class Adaptation:
    """What an eye or a light meter has settled on: numbers that may be mixed over time, as logarithms are.

    values : (N,) float64, whose meaning is the operator's own
    """

    values: np.ndarray

    def mixed(self, later: Adaptation, share: float) -> Adaptation:
        """On the way to `later`: share 0 stays, 1 has arrived."""
        return Adaptation((1 - share) * self.values + share * later.values)


class Tone(Protocol):
    """What makes radiance of any range fit for a display: a film, or a model of the eye."""

    def adapted(self, radiance: np.ndarray, view: View) -> Adaptation:
        """What the operator settles on in front of radiance (H, W, 3) float32 for as long as it likes."""
        ...

    def displayed(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values (H, W, 3) float32, Rec. 709: 1 is the screen's white; finite, and not clipped."""
        ...


@dataclass(frozen=True)
class Screen:
    """The display that an operator makes a picture for.

    white : luminance of its white, cd/m²; 100 is the reference of IEC 61966-2-1 (80) rounded up, and `pcond`'s
    black : luminance of its black, cd/m², the room's light on it included
    """

    white: float = 100.0
    black: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.white) and 0 < self.black < self.white):
            raise ValueError(f"a screen of white {self.white} and black {self.black} cd/m²; expected 0 < black < white")

    def values_of(self, luminance: np.ndarray) -> np.ndarray:
        """Linear display values that show luminances in cd/m²: (L − black) / (white − black).

        The screen and the room add the black by themselves, whatever is shown. What is darker is below 0, where a
        display clips it and tells how much there was.
        """
        return (luminance - self.black) / (self.white - self.black)
