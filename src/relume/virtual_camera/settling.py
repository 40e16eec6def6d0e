"""What an eye or a light meter has settled on over the frames of a sequence, so that nothing flickers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.view import View


@dataclass(frozen=True, eq=False)
class Settled:
    """What is settled on after some frames. Each frame that is not black takes it a share of the way to its own light.

    share : of the way to a new light that is gone in a frame, 0 to 1
    eye : ln cd/m² of the eye before the lens, by whose luminance glare goes; None before any light
    adaptation : of the tone operator behind the lens; None before any light
    """

    share: float
    eye: float | None = None
    adaptation: Adaptation | None = None

    @classmethod
    def before(cls, frames_per_second: float, settling: float) -> Settled:
        """Before the first frame.

        settling : seconds after which 63 % of the way to a new light are gone; 0 takes each frame alone
        Raises ValueError for a rate that is not above 0, and a negative settling.
        """
        if not frames_per_second > 0 or not settling >= 0:
            raise ValueError(
                f"frames_per_second {frames_per_second} and settling {settling}; expected above 0, and 0 or more"
            )
        return cls(1.0 if settling == 0 else 1 - float(np.exp(-1 / (frames_per_second * settling))))

    def seeing(self, seen: float | None) -> Settled:
        """After the eye saw a frame of that ln cd/m²; None where it was black."""
        if seen is None:
            return self
        eye = seen if self.eye is None else (1 - self.share) * self.eye + self.share * seen
        return replace(self, eye=eye)

    def adapting(self, own: Adaptation, lit: bool) -> Settled:
        """After the tone operator met a frame that alone it would adapt to by `own`."""
        if not lit:
            return self
        return replace(self, adaptation=own if self.adaptation is None else self.adaptation.mixed(own, self.share))

    def view(self, view: View, index: int) -> View:
        """The view of the frame of that index, with its own grain, once the eye has seen it."""
        return replace(view, frame=view.frame + index, settled=None if self.eye is None else float(np.exp(self.eye)))
