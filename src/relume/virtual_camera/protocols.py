"""The steps between radiance and a picture: what each kind is given and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from relume.virtual_camera.view import View


class Relative:
    """What works in any unit of radiance."""

    @property
    def absolute(self) -> bool:
        return False


class Pixelwise:
    """A tone operator by which a pixel is shown by itself and the adaptation alone, so that rows may be shown apart."""


class Absolute:
    """What asks for luminances in cd/m²: pictures in that unit, or with `View.luminance_scale`."""

    @property
    def absolute(self) -> bool:
        return True


class Optics(Protocol):
    """Something that light passes on its way to the sensor or the retina: a part of a lens, or of an eye."""

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m², as for a model of the eye."""
        ...

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it arrives, in its unit; the input stays as it was."""
        ...


@runtime_checkable
class Undoable(Protocol):
    """Optics whose effect can be taken out of a photograph's radiance again."""

    def undo(self, radiance: np.ndarray, view: View) -> np.ndarray:
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


class ToneOperator(Protocol):
    """What makes radiance of any range fit for a display: a film, or a model of the eye."""

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m², as for a model of the eye."""
        ...

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """What the operator settles on in front of radiance (H, W, 3) float32 for as long as it likes."""
        ...

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values (H, W, 3) float32, Rec. 709: 1 is the screen's white; finite, and not clipped."""
        ...
