"""Results of a merge: each bracket's radiance map, and what is known of each camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from relume.capture.alignment.alignment import Aligned
from relume.capture.clipping_report import ClippingReport
from relume.capture.exposure.bracket import FrameFacts
from relume.capture.exposure.consistency import NOTHING_TO_DO, Doubt
from relume.capture.ghosts.deghosting import Deghosted
from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import DOUBTFUL_MISFIT, Calibration
from relume.capture.scale.absolute import Scale
from relume.capture.scale.luminaire import ChannelGains
from relume.image.radiance import RadianceMap
from relume.image.response import Response


@dataclass(frozen=True, eq=False)
class MergedBracket:
    """One bracket's radiance map, with what it was made from.

    picture : the radiance map
    name : of the bracket, for messages
    camera : make and model, "" where unknown
    frames : the exposures, from the least to the most exposed
    doubts : what the photographs themselves say against the result
    aligned, deghosted : what was moved and left out; None where that was switched off
    clipping : what was measured of the scene, and what was not
    focal_length : pixels; None where unknown
    scale : to cd/m²; None for relative radiance
    balance : of the channels; None where there was nothing to balance them by
    corrections : by how many stops the exposure of a photograph was corrected, and the standard error, by its name
    """

    picture: RadianceMap
    name: str
    camera: str
    frames: tuple[FrameFacts, ...]
    doubts: tuple[Doubt, ...]
    aligned: Aligned | None
    deghosted: Deghosted | None
    clipping: ClippingReport
    focal_length: float | None = None
    scale: Scale | None = None
    balance: ChannelGains | None = None
    corrections: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MergedCamera:
    """What all brackets of one camera share.

    name : make and model, "" where unknown
    response : that its brackets were merged with; None for camera raws
    calibration : what the response was recovered from; None where it was given
    sensor : that camera raws showed; None for photographs
    """

    name: str
    response: Response | None
    calibration: Calibration | None = None
    sensor: Sensor | None = None


@dataclass(frozen=True, eq=False)
class MergeResult:
    """The radiance maps of brackets; those of one camera are on one scale.

    brackets : in the order given
    cameras : by name, in the order of their first brackets
    seconds : of each step
    messages : warnings of the steps, a line each
    """

    brackets: tuple[MergedBracket, ...]
    cameras: Mapping[str, MergedCamera]
    seconds: Mapping[str, float] = field(default_factory=dict)
    messages: tuple[str, ...] = ()

    @property
    def picture(self) -> RadianceMap:
        """The radiance map of the only bracket."""
        return self.bracket.picture

    @property
    def bracket(self) -> MergedBracket:
        """The only bracket; raises ValueError where there are several."""
        if len(self.brackets) != 1:
            raise ValueError(f"{len(self.brackets)} brackets were merged; choose one of `brackets`")
        return self.brackets[0]

    @property
    def camera(self) -> MergedCamera:
        """The only camera; raises ValueError where there are several."""
        if len(self.cameras) != 1:
            raise ValueError(f"the brackets are of {len(self.cameras)} cameras; choose one of `cameras`")
        return next(iter(self.cameras.values()))

    @property
    def response(self) -> Response:
        """The response of the only camera; raises ValueError for camera raws, which need none."""
        if self.camera.response is None:
            raise ValueError("camera raws are linear and have no response")
        return self.camera.response

    @property
    def warnings(self) -> tuple[str, ...]:
        """Why the result should not be used without looking at it, a line each; empty where all is well."""
        found = [doubt.line for bracket in self.brackets for doubt in bracket.doubts if doubt.degraded]
        for camera in self.cameras.values():
            if camera.calibration is not None and camera.calibration.residual.max() > DOUBTFUL_MISFIT:
                found.append(
                    f"the response fits badly (misfit {camera.calibration.residual.max():.2f} of ln exposure); "
                    "are the exposure times right, and did nothing move?"
                )
        return tuple(found)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a photographer should know and need not act on, a line each."""
        doubts = [doubt for bracket in self.brackets for doubt in bracket.doubts]
        minor = (doubt.line for doubt in doubts if not doubt.degraded and doubt.remedy != NOTHING_TO_DO)
        return (*self.messages, *minor)
