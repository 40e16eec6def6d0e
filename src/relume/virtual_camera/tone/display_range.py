"""The luminances of the display that a tone operator makes a picture for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class DisplayRange:
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
        """Linear display values that show a `luminance` in cd/m²: (L − black) / (white − black).

        The screen and the room add the black by themselves, whatever is shown. What is darker is below 0, where a
        display clips it and reports how much there was.
        """
        return (luminance - self.black) / (self.white - self.black)
