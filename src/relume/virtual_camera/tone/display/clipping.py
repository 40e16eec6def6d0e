"""How much of a picture its display cannot show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Three = tuple[float, float, float]


@dataclass(frozen=True)
class Clipping:
    """The share of pixels, 0 to 1, that came out as the nearest thing the display has; of R, G and B.

    above : brighter than its white, or its peak
    below : darker than its black; a colour outside its primaries is negative in a channel
    """

    above: Three
    below: Three

    @property
    def sentence(self) -> str:
        """For a warning or a caption: "1.2 % of the pixels are beyond white, 0 % below black", of the worst channel."""
        return f"{_percent(max(self.above))} of the pixels are beyond white, {_percent(max(self.below))} below black"


def clipping_of(above: np.ndarray, below: np.ndarray, pixels: int) -> Clipping:
    """From (3,) counts of each channel among so many pixels."""
    (red, green, blue), (dark_red, dark_green, dark_blue) = np.array([above, below]) / max(pixels, 1)
    return Clipping((float(red), float(green), float(blue)), (float(dark_red), float(dark_green), float(dark_blue)))


def _percent(share: float) -> str:
    # A single pixel of many is reported too: "0 %" would say that there is none.
    return f"{100 * share:.2g} %" if share >= 0.0001 or share == 0 else "less than 0.01 %"
