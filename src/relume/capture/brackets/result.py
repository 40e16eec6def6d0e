"""Results of a merge: each bracket's radiance map, what it does not hold, and what is known of each camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from relume import errors
from relume.capture.alignment.alignment import Aligned
from relume.capture.exposure.bracket import FrameFacts
from relume.capture.exposure.consistency import NOTHING_TO_DO, BracketDoubt
from relume.capture.ghosts.deghosting import Deghosted
from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import DOUBTFUL_MISFIT, Calibration
from relume.capture.scale.absolute import Scale
from relume.capture.scale.readings import ChannelGains
from relume.image.colour import luminance
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response


@dataclass(frozen=True)
class ClippingReport:
    """What was measured and what was not.

    saturated, black, outside : pixels saturated in every photograph, black in every one, and in none of them
    pixels : of the whole picture
    solid_angle : steradians that are saturated; None where the focal length is unknown
    brightest : the largest luminance among the saturated pixels' lower bounds, in the map's unit; 0 without any
    irradiance : (3,) what the saturated pixels bring at least through a plane that faces them, ∫ L dω of their lower
        bounds; None where the focal length is unknown. What they bring beyond it no photograph shows
    share : the same lower bounds as a share of all the light in the picture (luminance); the true share is larger
    orders : orders of magnitude between the 0.1st and the 99.99th percentile of measured luminance
    moved : how many of the saturated pixels lie where something moved, by the name of the photograph that counts there
    """

    saturated: int
    black: int
    outside: int
    pixels: int
    solid_angle: float | None
    brightest: float
    irradiance: tuple[float, float, float] | None
    share: float
    orders: float
    moved: Mapping[str, int] = field(default_factory=dict)

    def scaled(self, factor: tuple[float, float, float]) -> ClippingReport:
        """The same report of a map that was multiplied by a factor a channel; luminances by the factor's own."""
        red, green, blue = factor
        irradiance = self.irradiance and tuple(f * e for f, e in zip((red, green, blue), self.irradiance, strict=True))
        return replace(self, brightest=float(luminance(np.array(factor))) * self.brightest, irradiance=irradiance)


def solid_angles(width: int, height: int, focal_length: float) -> np.ndarray:
    """(H, W) steradians of each pixel of a distortion-free lens: f / (x² + y² + f²)^{3/2} a pixel.

    focal_length : pixels; the optical axis meets the picture in its middle
    """
    x = np.arange(width) + 0.5 - width / 2
    y = np.arange(height)[:, None] + 0.5 - height / 2
    return focal_length / (x * x + y * y + focal_length**2) ** 1.5


def clipping_report(picture: RadianceMap, *, focal_length: float | None = None) -> ClippingReport:
    """Count what `picture` does not hold.

    picture : a radiance map with its clipped mask
    focal_length : pixels; without it solid angles are not known and pixels count alike
    Raises ValueError for a map without a clipped mask.
    """
    if picture.clipped is None:
        raise ValueError("the radiance map has no clipped mask, so what it lacks is not known; merge a bracket")
    width, height = picture.size
    cells = solid_angles(width, height, focal_length) if focal_length else np.ones((height, width))
    saturated = picture.clipped == SATURATED
    light = luminance(picture.radiance)
    measured = light[(picture.clipped == 0) & (light > 0)]
    low, high = np.percentile(measured, (0.1, 99.99)) if measured.size else (1.0, 1.0)
    total = float((light * cells).sum(dtype=np.float64))
    bounds = picture.radiance[saturated].astype(np.float64)
    irradiance = (bounds * cells[saturated][:, None]).sum(0)
    return ClippingReport(
        saturated=int(saturated.sum()),
        black=int((picture.clipped == BLACK).sum()),
        outside=int((picture.clipped == OUTSIDE).sum()),
        pixels=width * height,
        solid_angle=float(cells[saturated].sum()) if focal_length else None,
        brightest=float(light[saturated].max(initial=0.0)),
        irradiance=(float(irradiance[0]), float(irradiance[1]), float(irradiance[2])) if focal_length else None,
        share=float((light * cells)[saturated].sum(dtype=np.float64)) / total if total > 0 else 0.0,
        orders=float(np.log10(high / low)),
    )


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
    doubts: tuple[BracketDoubt, ...]
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
        return tuple(doubt.line for doubt in self.doubts if doubt.wrong)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a photographer should know and need not act on, a line each."""
        return tuple(doubt.line for doubt in self.doubts if not doubt.wrong)

    @property
    def doubts(self) -> tuple[errors.Doubt, ...]:
        """All that a photographer should know, with its effect on the light: what the steps, then the brackets say."""
        found = [errors.Doubt(line) for line in self.messages]
        of_brackets = [doubt for bracket in self.brackets for doubt in bracket.doubts]
        found += [doubt.ranked for doubt in of_brackets if doubt.remedy != NOTHING_TO_DO]
        for camera in self.cameras.values():
            if camera.calibration is None or camera.calibration.residual.max() <= DOUBTFUL_MISFIT:
                continue
            misfit = float(camera.calibration.residual.max())
            line = (
                f"the response fits badly (misfit {misfit:.2f} of ln exposure); are the exposure times right, and did "
                "nothing move?"
            )
            found.append(errors.Doubt(line, max(errors.WRONG, float(np.expm1(misfit)))))
        return tuple(found)
