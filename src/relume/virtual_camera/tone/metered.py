"""Plain exposure: light in proportion, as bright as a light meter or a camera's settings say."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from relume.image.colour import decode_srgb
from relume.image.photograph import Exposure
from relume.virtual_camera.protocols import Absolute, Adaptation, Relative
from relume.virtual_camera.view import View

SPEED_FACTOR = 0.65
"""q of ISO 12232: (π/4) · transmittance 0.9 · vignetting 0.98 · cos⁴ 10°, what a usual lens leaves of the light."""
SATURATING = 78.0
"""lx·s at ISO 1 that just saturate a sensor by ISO 12232: grey cards are then at 12.7 % of it, white ones at 71 %."""
STANDARD_OUTPUT = 10.0
"""lx·s at ISO 1 that make 118 of 255 in sRGB by ISO 12232's standard output sensitivity."""
_GREY = float(decode_srgb(np.array(118 / 255)))
_DARKEST = 1e-30
"""Luminance that is brought to white at most: gains beyond it leave the range of float32."""


class LinearExposure(ABC):
    """A tone that is one factor on all light, so that it may be applied together with the display's curve."""

    @abstractmethod
    def gain(self, adaptation: Adaptation, view: View) -> float:
        """Display values per unit of radiance.

        adaptation, view : what `adapt` returned, and the picture's view (`VirtualCamera.view`)
        """

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Nothing: (0,)."""
        return Adaptation(np.zeros(0))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Radiance (H, W, 3) times the gain."""
        from relume.virtual_camera.tone.luminance_curve import scaled

        return scaled(radiance, self.gain(adaptation, view))


@dataclass(frozen=True)
class MeteredExposure(LinearExposure, Relative):
    """Exposed so that the picture's own light comes out right: by two rules, of which the brighter exposure is taken.

    percentile : of the channels' values above 0, %; it becomes 1, the screen's white. 99 leaves lamps and their
        reflections, the brightest hundredth, to saturate, as photographers do. Channels and not luminances, or in warm
        light the reds would saturate everywhere. None for the other rule alone
    grey : the display value that the log mean of the luminances becomes; 0.18 is a grey card's. None for the other rule
        alone

    The first rule suits an evenly lit place; before windows at noon it leaves the room black, where the second exposes
    for the room. Adaptation: (1,), the natural logarithm of the display values per unit of radiance; 0 of a black
    picture. Raises ValueError where both are None.
    """

    percentile: float | None = 99.0
    grey: float | None = 0.18

    def __post_init__(self) -> None:
        if self.percentile is None and self.grey is None:
            raise ValueError("percentile and grey are both None; a meter needs one of them")
        if self.percentile is not None and not 0 < self.percentile <= 100:
            raise ValueError(f"percentile is {self.percentile}; expected more than 0 and at most 100, or None")
        if self.grey is not None and not (np.isfinite(self.grey) and self.grey > 0):
            raise ValueError(f"grey is {self.grey}; expected a display value above 0, or None")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """The exposure that a meter asks for in front of `radiance` (H, W, 3), a picture of that `view`."""
        from relume.virtual_camera.tone.luminance_statistics import light_sum, log_average, percentiles

        # The percentile is of what is above 0: it is 0 where nothing is.
        bright = light_sum(radiance)[1] if self.percentile is None else percentiles(radiance, self.percentile)[0]
        if bright == 0:
            return Adaptation(np.zeros(1))
        gains = [] if self.percentile is None else [1 / max(bright, _DARKEST)]
        if self.grey is not None:
            gains.append(self.grey / max(log_average(radiance), _DARKEST))
        return Adaptation(np.log([max(gains)]))

    def gain(self, adaptation: Adaptation, view: View) -> float:
        """Display values per unit of radiance.

        adaptation, view : what `adapt` returned, and the picture's view (`VirtualCamera.view`)
        """
        return float(np.exp(adaptation.values[0]))


@dataclass(frozen=True)
class FixedExposure(LinearExposure, Relative):
    """A fixed exposure, whatever the picture shows.

    display_per_radiance : display values per unit of radiance; 1 shows radiance as it is
    """

    display_per_radiance: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.display_per_radiance) and self.display_per_radiance > 0):
            raise ValueError(f"display_per_radiance is {self.display_per_radiance}; expected a positive number")

    def gain(self, adaptation: Adaptation, view: View) -> float:
        """Display values per unit of radiance.

        adaptation, view : what `adapt` returned, and the picture's view (`VirtualCamera.view`)
        """
        return self.display_per_radiance


@dataclass(frozen=True)
class CameraExposure(LinearExposure, Absolute):
    """Exposed by shutter, aperture and ISO, as a camera whose ISO number keeps what ISO 12232 promises.

    exposure : with f-number and ISO
    saturating : whether the number is a saturation-based speed, so that the luminance which saturates becomes 1, half a
        stop darker. Else it is a standard output sensitivity, by which 10 / S lx·s make 118 of 255, as cameras' own
        pictures and relume's absolute scale have it (`rl.capture.scale_from_exposure`)

    For pictures in cd/m², or with `View.luminance_scale`. Raises ValueError for an exposure without f-number or ISO.
    """

    exposure: Exposure
    saturating: bool = False

    def __post_init__(self) -> None:
        saturation_luminance(self.exposure)

    def gain(self, adaptation: Adaptation, view: View) -> float:
        """Display values per unit of radiance.

        adaptation, view : what `adapt` returned, and the picture's view (`VirtualCamera.view`)
        """
        white = saturation_luminance(self.exposure)
        if not self.saturating:
            white *= STANDARD_OUTPUT / SATURATING / _GREY
        return view.luminance_scale / white


def saturation_luminance(exposure: Exposure) -> float:
    """The luminance, cd/m², that just saturates a camera: 78 N² / (0.65 S t) (ISO 12232, saturation-based speed).

    exposure : seconds t, f-number N, ISO S; each stop more halves the luminance. Raises ValueError without N or S
    """
    for name, value in (("f-number", exposure.f_number), ("ISO", exposure.iso)):
        if value is None:
            raise ValueError(f"the exposure has no {name}; absolute exposure needs seconds, f-number and ISO")
    assert exposure.f_number is not None and exposure.iso is not None
    return SATURATING * exposure.f_number**2 / (SPEED_FACTOR * exposure.iso * exposure.seconds)
