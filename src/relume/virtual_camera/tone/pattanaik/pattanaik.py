"""The multiscale tone operator of Pattanaik, Ferwerda, Fairchild & Greenberg 1998: what an eye sees, shown on a screen.

Scene and screen go through one model of vision, the screen's way backwards: signals of cones and rods, their gains at
what each scale is adapted to, opponent colours, transducers of contrast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.primaries import REC709
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.overflow import without_overflow
from relume.virtual_camera.view import View

HUNT_POINTER_ESTEVEZ = np.array([[0.3897, 0.6890, -0.0787], [-0.2298, 1.1834, 0.0464], [0.0, 0.0, 1.0]])
"""CIE XYZ to cones for long, middle and short waves (Pattanaik et al. 1998, after Hunt 1995)."""
RODS_OF_XYZ = np.array([-0.702, 1.039, 0.433])
"""CIE XYZ to rods (Pattanaik et al. 1998)."""
ACHROMATIC = np.array([2.0, 1.0, 0.05]) / 3.05
"""Cones to the achromatic signal (Hunt 1995; CIECAM97s), which of grey is the cones' own."""
MEAN_OF_A_SCREEN = 0.18
"""Of its white: middle grey, where photographs are printed and shown."""
_BAND = 64


@dataclass(frozen=True)
class Pattanaik:
    """What a scene looks like to an eye adapted to each part of it, for an eye adapted to a screen.

    screen : what the picture is shown on
    screen_adaptation : luminance, cd/m², to which the eye in front of it is adapted; None for middle grey, 18 % of the
        screen's white, as the mean of most pictures is

    Everything is in cd/m² and degrees: a night scene comes out dark, grey and without fine detail, an unseen contrast
    of the scene unseen on the screen. Around lights much brighter than their surroundings the model makes dark halos.
    The eye's optics are left out: who looks at the screen brings them, and `EyeGlare` adds what a
    screen is too dim for.
    """

    screen: DisplayRange = DisplayRange()
    screen_adaptation: float | None = None

    @property
    def absolute(self) -> bool:
        return True

    def __post_init__(self) -> None:
        adapted = self.screen_adaptation
        if adapted is not None and not (np.isfinite(adapted) and adapted > 0):
            raise ValueError(f"screen_adaptation is {adapted}; expected a positive luminance in cd/m², or None")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """values (0,): every part of the model is adapted to its own surroundings in the picture, none to all of it."""
        return Adaptation(np.empty(0))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values (H, W, 3) float32: light is never negative, and what is darker than the
        screen's black is below 0 by that at most."""
        from relume._kernel import in_threads
        from relume.virtual_camera.tone.pattanaik.bands import Eye
        from relume.virtual_camera.tone.pattanaik.pyramid import levels

        adapted = self.screen_adaptation or MEAN_OF_A_SCREEN * self.screen.white
        eye = Eye(signals_of_rgb() * view.luminance_scale, ACHROMATIC, light_of_signals(adapted))
        radiance = np.ascontiguousarray(without_overflow(radiance, view.luminance_scale), np.float32)
        blurs = levels(radiance, view.degrees_per_pixel)
        picture = eye.small_bands(blurs)
        result = np.empty_like(radiance)

        def show(begin: int, end: int) -> None:
            result[begin:end] = self.screen.values_of(
                np.maximum(eye.full_bands(radiance, blurs, picture, begin, end), 0)
            )

        in_threads(show, len(result), chunk=_BAND)
        return result


def light_of_signals(adapted: float) -> np.ndarray:
    """(3, 3) from adapted signals of cones, what rods add among them, to linear Rec. 709 of a screen, cd/m².

    adapted : luminance, cd/m², that sets all gains in front of the screen: it is the paper's display model
    """
    from relume.virtual_camera.tone.pattanaik.transducers import ROD_SHARE, cone_gain, rod_gain

    *cones, rods = signals_of_rgb()
    grey = rods * ROD_SHARE * rod_gain(rods.sum() * adapted)
    return np.linalg.inv(np.array(cones) * cone_gain(adapted) + grey)


def signals_of_rgb() -> np.ndarray:
    """(4, 3) from linear Rec. 709 to the signals of long, middle and short cones and of rods.

    Each cone's signal of a grey is its luminance, so that greys stay grey: the eye is adapted to the screen's white.
    """
    to_xyz = REC709.to_xyz()
    cones = HUNT_POINTER_ESTEVEZ @ to_xyz
    return np.vstack([cones / cones.sum(1, keepdims=True), RODS_OF_XYZ @ to_xyz])
