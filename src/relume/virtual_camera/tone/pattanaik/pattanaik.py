"""The multiscale tone operator of Pattanaik, Ferwerda, Fairchild & Greenberg 1998: what an eye sees, shown on a screen.

Scene and screen go through one model of vision, the screen's way backwards: signals of cones and rods, their gains at
what each scale is adapted to, opponent colours, transducers of contrast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.primaries import REC709
from relume.virtual_camera.protocols import Absolute, Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.luminance_curve import without_overflow
from relume.virtual_camera.tone.pattanaik.kernels import add_band, shown_base
from relume.virtual_camera.tone.pattanaik.pyramid import Level, levels
from relume.virtual_camera.tone.pattanaik.transducers import CONES, ROD_SHARE, RODS, cone_gain, rod_gain
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
class Pattanaik(Absolute):
    """What a scene looks like to an eye adapted to each part of it, for an eye adapted to a screen.

    screen : what the picture is shown on
    screen_adaptation : luminance, cd/m², to which the eye in front of it is adapted; None for middle grey, 18 % of the
        screen's white, as the mean of most pictures is

    Everything is in cd/m² and degrees: a night scene comes out dark, grey and without fine detail, an unseen contrast
    of the scene unseen on the screen. Around lights much brighter than their surroundings the model makes dark halos.
    Source: Pattanaik, Ferwerda, Fairchild & Greenberg 1998. The eye's optics are left out: who looks at the screen
    brings them, and `EyeGlare` adds what a screen is too dim for.
    """

    screen: DisplayRange = DisplayRange()
    screen_adaptation: float | None = None

    def __post_init__(self) -> None:
        adapted = self.screen_adaptation
        if adapted is not None and not (np.isfinite(adapted) and adapted > 0):
            raise ValueError(f"screen_adaptation is {adapted}; expected a positive luminance in cd/m², or None")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Values (0,): every part of the model is adapted to its own surroundings in the picture, none to all of it.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        return Adaptation(np.empty(0))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values (H, W, 3) float32: light is never negative, and what is darker than the
        screen's black is below 0 by that at most.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        adapted = self.screen_adaptation or MEAN_OF_A_SCREEN * self.screen.white
        eye = Eye(signals_of_rgb() * view.luminance_scale, light_of_signals(adapted))
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


@dataclass(frozen=True, eq=False)
class Eye:
    """From a scene's radiance to a screen's luminances, for whatever the gains are.

    seen : (4, 3) from radiance, linear Rec. 709, to signals of long, middle and short cones and of rods
    shown : (3, 3) from the cones' adapted signals to luminances of the screen, linear Rec. 709
    """

    seen: np.ndarray
    shown: np.ndarray

    def base(self, scene: np.ndarray) -> np.ndarray:
        """What the screen shows of the coarsest blur (h, w, 3)."""
        picture = np.empty_like(scene)
        shown_base(scene, self.seen, self.shown, picture)
        return picture

    def small_bands(self, blurs: list[Level]) -> np.ndarray | None:
        """What the screen shows up to the sharpest blur that is smaller than the picture; None where none is."""
        picture = None
        for index in reversed(range(len(blurs))):
            if blurs[index].size == 1:
                break
            if picture is None:
                picture = self.base(blurs[index].pixels)
            else:
                picture = self._small_band(index + 1, blurs[index], blurs[index + 1], picture)
        return picture

    def full_bands(
        self, radiance: np.ndarray, blurs: list[Level], picture: np.ndarray | None, begin: int, end: int
    ) -> np.ndarray:
        """Rows begin…end of what the screen shows, from what it shows up to the sharpest small blur."""
        full = [Level(radiance, 0.0, 1), *(blur for blur in blurs if blur.size == 1)]
        if picture is None:
            index, coarse, ratio, first = len(full) - 2, full[-1].rows(begin, end), 1, 0
            picture = self.base(coarse)
        else:
            index, ratio, first = len(full) - 1, blurs[len(full) - 1].size, begin
            coarse = blurs[index].pixels
        for band in range(index, -1, -1):
            fine = full[band].rows(begin, end)
            picture = self._with_band(band, fine, coarse, picture, ratio, first)
            coarse, ratio, first = fine, 1, 0
        return picture

    def _small_band(self, band: int, fine: Level, coarse: Level, picture: np.ndarray) -> np.ndarray:
        finer = np.empty_like(fine.pixels)

        def add(begin: int, end: int) -> None:
            rows, ratio = fine.pixels[begin:end], coarse.size // fine.size
            finer[begin:end] = self._with_band(band, rows, coarse.pixels, picture, ratio, begin)

        in_threads(add, len(finer), chunk=_BAND)
        return finer

    def _with_band(
        self, band: int, fine: np.ndarray, coarse: np.ndarray, picture: np.ndarray, ratio: int, first: int
    ) -> np.ndarray:
        bends = np.array([(t.threshold, t.meeting, t.exponent) for t in (CONES[band], RODS[band])])
        rods_see, finer = not RODS[band].is_blind, np.empty_like(fine)
        add_band(fine, coarse, picture, ratio, first, self.seen, ACHROMATIC, self.shown, bends, rods_see, finer)
        return finer
