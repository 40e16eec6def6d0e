"""The time in which a frame is exposed, and the moments of it that a render's passes see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
