"""Brightness as an eye adapted to the scene would see it (Tumblin & Rushmeier 1993, corrected as in 1999)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.virtual_camera.protocols import Absolute, Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.view import View

NEAR_BLACK = 2.3e-5
"""cd/m², the limit of vision; the authors add it to every luminance before its logarithm."""


@dataclass(frozen=True)
class TumblinRushmeier(Absolute):
    """What the scene's brightness is by Stevens' law, the screen's brightness becomes: dark scenes look flat and dim.

    screen : whose white and black are the paper's Ldmax and contrast Cmax = white / black. The eye in front of it is
        adapted to the log mean of both, 10 cd/m² of the usual screen (the authors' had 10 to 30); in the scene to the
        log mean of the picture

    The operator of Tumblin & Rushmeier 1993 as its author restated it in Tumblin, Hodgins & Guenter 1999, "Two methods
    for display of high contrast images", appendix. For pictures in cd/m², or with `View.luminance_scale`.

    Adaptation: (1,), natural logarithm of the scene's log average, cd/m².
    """

    screen: DisplayRange = DisplayRange()

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """What an eye before `radiance` (H, W, 3), of that `view`, is adapted to: exp mean ln(L + 2.3e-5), cd/m²."""
        from relume.virtual_camera.tone.luminance_statistics import log_average

        scale = view.luminance_scale
        return Adaptation(np.log([log_average(radiance, NEAR_BLACK / scale) * scale]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Display values (H, W, 3) whose luminances, with the screen's black, are those that the operator gives.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        from relume.virtual_camera.tone.luminance_curve import curved

        adapted = float(np.exp(adaptation.values[0]))
        return curved(
            radiance,
            lambda light: self.screen.values_of(screen_luminance(light * view.luminance_scale, adapted, self.screen)),
            lowest=float(self.screen.values_of(np.zeros(()))),
        )


def screen_luminance(luminance: np.ndarray, adapted: float, screen: DisplayRange) -> np.ndarray:
    """cd/m² on the screen for cd/m² in the scene: m · Lda · (Lw / Lwa) ^ (γw / γd), m = √Cmax ^ (γw / γd − 1).

    adapted : Lwa, cd/m²

    The exponent of m is written with a bare "log", and some programs take the natural one there; by the decimal
    one, that of γ, a scene to which an eye is adapted as to the screen comes out as it is.
    """
    display = float(np.sqrt(screen.white * screen.black))
    ratio = brightness_exponent(adapted) / brightness_exponent(display)
    contrast = np.sqrt(screen.white / screen.black) ** (ratio - 1)
    return contrast * display * (np.asarray(luminance, dtype=np.float64) / adapted) ** ratio


def brightness_exponent(adapted: float) -> float:
    """γ(La): Stevens' sensitivity to contrast of an eye adapted to cd/m² (Tumblin et al. 1999, appendix).

    2.655 above 100 cd/m², 1.855 + 0.4 log₁₀(La + 2.3e-5) below.
    """
    return 2.655 if adapted > 100 else max(1.855 + 0.4 * float(np.log10(adapted + NEAR_BLACK)), 0.0)
