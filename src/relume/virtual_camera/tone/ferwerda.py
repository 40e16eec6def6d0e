"""What an eye adapted to the scene can just distinguish (Ferwerda, Pattanaik, Shirley & Greenberg 1996)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.primaries import REC709
from relume.virtual_camera.protocols import Absolute, Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.histogram.eye import blurred_by_acuity
from relume.virtual_camera.tone.luminance_curve import without_overflow
from relume.virtual_camera.tone.luminance_kernels import see
from relume.virtual_camera.tone.luminance_statistics import light_sum, percentiles
from relume.virtual_camera.tone.vision import (
    BRIGHTEST_MESOPIC,
    DARKEST_MESOPIC,
    cone_threshold,
    rod_threshold,
    scotopic_luminance,
)
from relume.virtual_camera.view import View

INTO_LIGHT = (0.08, 0.15)
"""Seconds in which cones and rods come 63 % of the way to a brighter light (Pattanaik et al. 2000, "Time-dependent
visual adaptation for fast realistic image display")."""
INTO_DARKNESS = (110.0, 400.0)
"""Seconds to a darker one, in which pigments regenerate (ibid.): after five of them, 9 minutes for cones and 33 for
rods, little is left to gain, as is measured of eyes that come out of bright light."""
_DARKEST = 1e-9
"""cd/m² to which an eye adapts at least: below it nothing is seen."""


@dataclass(frozen=True)
class Ferwerda(Absolute):
    """What is just visible in the scene is just visible on the screen: a factor for cones and one for rods.

    screen : what the picture is shown on; the eye in front of it is adapted to half its white, and sees by its cones.
        One in a dark room unless given: the light of a lit room, 1 cd/m², would lie over two thirds of a church whose
        windows saturate
    percentile : of the channels' values above 0, %; half of it is the luminance that the eye in the scene is adapted
        to. The paper takes half the highest visible luminance, of a grey scene 100; the default lets lamps and the sun
        saturate, beside which the rest would be black
    acuity : whether detail is lost that the eye does not resolve in that light
    colour : whether the rods see greys, as they do; or else everything keeps the colour that cones see

    Source: Ferwerda, Pattanaik, Shirley & Greenberg 1996. Cones and rods are added (§4.1): nothing here depends on a
    pixel's place, and daylight is plain exposure but for the screen's black, which is taken off. For pictures in cd/m²,
    or with `View.luminance_scale`.

    Adaptation: (2,), natural logarithms of what cones and rods are adapted to, cd/m², photopic and scotopic.
    """

    screen: DisplayRange = DisplayRange(100.0, 0.01)
    percentile: float = 99.0
    acuity: bool = True
    colour: bool = True

    def __post_init__(self) -> None:
        if not 0 < self.percentile <= 100:
            raise ValueError(f"percentile is {self.percentile}; expected more than 0 and at most 100")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """What cones and rods before `radiance` (H, W, 3), of that `view`, are adapted to in the end."""
        bright = percentiles(radiance, self.percentile)[0] * view.luminance_scale
        mean = REC709.to_xyz() @ light_sum(radiance)[0]
        rods_per_cones = float(scotopic_luminance(mean)) / mean[1] if mean[1] > 0 else 1.0
        cones = max(bright / 2, _DARKEST)
        return Adaptation(np.log([cones, max(cones * rods_per_cones, _DARKEST)]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Display values (H, W, 3): `DisplayRange.values_of` what an eye would see, its channels in cd/m² of white.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        contrast = self.screen.white - self.screen.black
        cones, rods = (multipliers(adaptation, self.screen) * view.luminance_scale / contrast).astype(np.float32)
        black = np.float32(self.screen.black / contrast)
        radiance = without_overflow(radiance, view.luminance_scale)
        if self.acuity:
            radiance = blurred_by_acuity(radiance, view, float(np.exp(adaptation.values[0])))
            pixels = result = np.ascontiguousarray(radiance).reshape(-1, 3)
        else:
            pixels = np.ascontiguousarray(radiance, dtype=np.float32).reshape(-1, 3)
            result = np.empty_like(pixels)
        matrix = REC709.to_xyz().astype(np.float32)

        def work(begin: int, end: int) -> None:
            see(pixels, matrix, cones, rods, black, self.colour, begin, end, result)

        in_threads(work, len(pixels))
        return result.reshape(radiance.shape)


def multipliers(adaptation: Adaptation, screen: DisplayRange) -> np.ndarray:
    """(2,) cd/m² on the screen per cd/m² seen by cones, and per scotopic cd/m² seen by rods, their share included.

    Tp(Lda) / Tp(Lwa) and k · Tp(Lda) / Ts(Lwa) (Ferwerda et al. 1996, §4.1): a difference at the scene's threshold is
    brought to the screen's, which is that of cones. The share k falls from 1 at the bottom of the mesopic range to 0 at
    its top; the paper gives only the ends, and between them it is linear in the logarithm, as thresholds nearly are.
    """
    cones, rods = np.exp(adaptation.values)
    low, high = np.log(DARKEST_MESOPIC), np.log(BRIGHTEST_MESOPIC)
    share = np.clip((high - adaptation.values[1]) / (high - low), 0, 1)
    seen = float(cone_threshold(np.array(screen.white / 2)))
    return np.array([seen / float(cone_threshold(cones)), share * seen / float(rod_threshold(rods))])


def adaptation_after(now: Adaptation, later: Adaptation, seconds: float) -> Adaptation:
    """What an eye adapted to `now` has come to, that many seconds after the light changed to what `later` is for.

    The time course of a `Ferwerda` adaptation: cones before rods, and both sooner into light than into darkness, each
    coming nearer by the same share in every second. Raises ValueError for a time below 0.
    """
    if not seconds >= 0:
        raise ValueError(f"seconds is {seconds}; expected 0 or more after the light has changed")
    brighter = later.values > now.values
    left = np.exp(-seconds / np.where(brighter, INTO_LIGHT, INTO_DARKNESS))
    return Adaptation(later.values + (now.values - later.values) * left)
