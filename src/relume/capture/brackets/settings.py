"""Settings of a merge: what is done to photographs on their way to radiance, as plain frozen values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.glare import Glare
from relume.capture.lens.lateral_colour import LateralColour
from relume.capture.lens.vignetting import Vignetting
from relume.capture.merging import InverseVariance, Weighting
from relume.capture.raw.merging import RawCalibration
from relume.capture.response.calibration import ResponseMethod
from relume.capture.response.debevec_malik import DebevecMalik
from relume.capture.response.other_methods import MitsunagaNayar, Robertson
from relume.capture.scale.absolute import Scale
from relume.capture.scale.readings import PLACED, ChannelGains
from relume.image.radiance import RadianceMap
from relume.image.response import Response

RESPONSE_METHODS: Mapping[str, ResponseMethod] = {
    "debevec-malik": DebevecMalik(),
    "mitsunaga-nayar": MitsunagaNayar(),
    "robertson": Robertson(),
}
"""The methods by the names that the command line and files use."""


@dataclass(frozen=True)
class MergeSettings:
    """What is done to photographs on their way to radiance.

    method : recovers the response; `RESPONSE_METHODS` has them by name
    weighting : of the merge
    refine : whether exposures that the photographs contradict are corrected; those of camera raws always are
    align : whether frames are brought onto one another
    deghost : whether what moved between frames is left out
    neutral : the pixel value at which equal channels are achromatic (see `Response.balanced_at`); unless given it is
        white, or the highest value that was observed in every channel
    glare : of the lens, or a `DarkPlace` that shows it; taken out first, for the veil lies over the vignetted light
    vignetting : of the lens, at one aperture or several; the profile's unless given
    lateral : lateral colour of the lens, or `recover_lateral_colour`, which finds it in the first map
    balance : of the channels, or a `WhiteCard` that shows it (§2.6); the profile's unless given
    scale : to cd/m², or a reading that gives it: `ExposureScale`, `SpotReading`, `LuxReading`, `LuminaireReading`; the
        profile's unless given
    focal_length : pixels, where the photographs hold none

    Functions of the merged map may stand for `glare`, `lateral`, `balance` and `scale`; each is called once, with the
    first map of a camera, and holds for all of that camera. Camera raws are linear, are weighted by
    their sensor's noise and are merged where they lie: method, weighting, refine, align, deghost and neutral have no
    effect on them.
    """

    method: ResponseMethod = DebevecMalik()
    weighting: Weighting = InverseVariance()
    refine: bool = False
    align: bool = True
    deghost: bool = True
    neutral: int | None = None
    glare: Glare | Callable[[RadianceMap], Glare] | None = None
    vignetting: Sequence[Vignetting] = ()
    lateral: LateralColour | Callable[[RadianceMap], LateralColour] | None = None
    balance: ChannelGains | Callable[[RadianceMap], ChannelGains] | None = None
    scale: Scale | Callable[[RadianceMap, Bracket, Response | RawCalibration], Scale] | None = None
    focal_length: float | None = None

    def __post_init__(self) -> None:
        if self.neutral is not None and self.neutral < 0:
            raise ValueError(f"neutral: {self.neutral} is not a pixel value; pixel values begin at 0")
        if self.focal_length is not None and not 0 < self.focal_length < float("inf"):
            raise ValueError(f"focal_length: {self.focal_length:g} pixels; give a number above 0")

    @property
    def placed(self) -> tuple[str, ...]:
        """The names of the readings that point at a place of a picture."""
        readings = (self.scale, self.balance, self.glare)
        return tuple(reading.name for reading in readings if isinstance(reading, PLACED))
