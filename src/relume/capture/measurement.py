"""From brackets to radiance maps with all that is known of them: the steps in their order."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from relume.capture.alignment.alignment import Aligned, align
from relume.capture.clipping_report import Extent, extent
from relume.capture.exposure.bracket import Bracket, FrameFacts
from relume.capture.exposure.consistency import NOTHING_TO_DO, Doubt, check
from relume.capture.ghosts.deghosting import Consistency, Deghosted, deghost
from relume.capture.lens.glare import Glare, diminish_glare
from relume.capture.lens.vignetting import Vignetting
from relume.capture.lens.vignetting import corrected as without_vignetting
from relume.capture.merging import merge
from relume.capture.provenance import provenance
from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import (
    DOUBTFUL_MISFIT,
    Calibration,
    ResponseMethod,
    corrected,
    recover_response,
)
from relume.capture.response.debevec_malik import DebevecMalik
from relume.capture.response.ratios import Ratios
from relume.capture.scale.absolute import Scale, calibrated
from relume.capture.scale.luminaire import Balance, balanced
from relume.capture.step_timing import Steps
from relume.capture.weighting import InverseVariance, Weighting
from relume.errors import NotABracket
from relume.image.photograph import Exposure
from relume.image.radiance import RadianceMap
from relume.image.response import Response

Read = TypeVar("Read")
ODD = 0.02
"""Share of the picture in which one frame contradicts all the others for it to be told."""
OBSERVED = 0.7
"""Share of white up to which every curve must have been observed for the channels to be tied at white; beyond its
observations a curve is a guess: sixteen scans of film, whose blue is hardly seen above the middle, came out yellow."""


@dataclass(frozen=True)
class MergeSettings:
    """What is done to photographs on their way to radiance.

    method : that recovers the response
    weighting : of the merge
    refine : how exposures that the photographs contradict are corrected; None takes them as told
    aligned : whether frames are brought onto one another
    consistency : what may differ between frames before it is left out as a ghost; None leaves everything in
    neutral : the pixel value at which equal channels are achromatic (see `Response.balanced_at`); unless given it is
        white, or the highest value that was observed in every channel
    glare : given the merged map, the lens's glare, taken out first, for the veil lies over the vignetted light
    vignetting : of the lens, at one aperture or several
    balance : given the map, the gains that show a luminaire in its known colour (§2.6)
    scale : given the map, its bracket and the response, the scale to cd/m²
    focal_length : pixels, where the photographs tell none
    """

    method: ResponseMethod = DebevecMalik()
    weighting: Weighting = InverseVariance()
    refine: Ratios | None = None
    aligned: bool = True
    consistency: Consistency | None = Consistency()
    neutral: int | None = None
    glare: Callable[[RadianceMap], Glare] | None = None
    vignetting: Sequence[Vignetting] = ()
    balance: Callable[[RadianceMap], Balance] | None = None
    scale: Callable[[RadianceMap, Bracket, Response], Scale] | None = None
    focal_length: float | None = None

    def read_once(self) -> MergeSettings:
        """The same, but what is read in one map, glare, balance or scale, is taken for all: they share one scale."""
        return replace(
            self,
            glare=None if self.glare is None else _once(self.glare),
            balance=None if self.balance is None else _once(self.balance),
            scale=None if self.scale is None else _once(self.scale),
        )


def _once(read: Callable[..., Read]) -> Callable[..., Read]:
    """`read`, asked the first time only."""
    told: list[Read] = []

    def again(*given: object) -> Read:
        if not told:
            told.append(read(*given))
        return told[0]

    return again


@dataclass(frozen=True, eq=False)
class Measured:
    """One bracket's radiance map, with what it was made from.

    picture : the radiance map
    name : of the bracket, for messages
    frames : what is known of each exposure, from the least to the most exposed
    doubts : what the photographs themselves say against the result
    aligned, deghosted : what was moved and left out; None where that was switched off
    extent : what was measured of the scene
    scale : to cd/m²; None for relative radiance
    balance : of the channels; None where nothing told one
    corrections : by how many stops the exposure of a photograph was corrected, and the standard error, by its name
    """

    picture: RadianceMap
    name: str
    frames: tuple[FrameFacts, ...]
    doubts: tuple[Doubt, ...]
    aligned: Aligned | None
    deghosted: Deghosted | None
    extent: Extent
    scale: Scale | None
    balance: Balance | None = None
    corrections: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Measurement:
    """The brackets of one camera, on one scale.

    camera : make and model, "" where unknown
    measured : in the brackets' order
    response : that all were merged with; None for camera raws
    calibration : what it was recovered from; None where it was given
    seconds : of each step
    warnings : what the steps had to say, a line each
    sensor : that camera raws showed; None for photographs
    """

    camera: str
    measured: tuple[Measured, ...]
    response: Response | None
    calibration: Calibration | None
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    sensor: Sensor | None = None

    def objections(self) -> tuple[str, ...]:
        """Why the result should not be used unseen, a line each; none where all is well."""
        found = [doubt.line for one in self.measured for doubt in one.doubts if doubt.degraded]
        if self.calibration is not None and self.calibration.residual.max() > DOUBTFUL_MISFIT:
            found.append(
                f"the response fits badly (misfit {self.calibration.residual.max():.2f} of ln exposure); "
                "are the exposure times right, and did nothing move?"
            )
        return tuple(found)

    def notes(self) -> tuple[str, ...]:
        """What a photographer should know and need not act on, a line each."""
        doubts = [
            doubt.line
            for one in self.measured
            for doubt in one.doubts
            if not doubt.degraded and doubt.remedy != NOTHING_TO_DO
        ]
        return (*self.warnings, *doubts)


def measure(
    brackets: Bracket | Sequence[Bracket],
    *,
    response: Response | None = None,
    treatment: MergeSettings = MergeSettings(),
    told: Callable[[str], None] = lambda step: None,
) -> Measurement:
    """Check, align, recover the response, take out ghosts, merge, and take out what the lens added.

    brackets : of one camera; they share one response, and their maps one scale. What is read in a map, as a spot
        meter's reading, is read in that of the first
    response : of that camera, where it is known; recovered from the brackets unless given
    told : called with the name of each step as it begins
    Raises NotABracket, ValueError. Warnings of the steps are kept in the result and not given out.
    """
    taken = [brackets] if isinstance(brackets, Bracket) else list(brackets)
    if not taken:
        raise ValueError("no brackets were given; give one at least")
    treatment = treatment.read_once()
    steps = Steps(told)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        with steps.step("check"):
            doubts = [check(bracket, response) for bracket in taken]
        aligned: list[Aligned | None] = [None] * len(taken)
        if treatment.aligned:
            with steps.step("align"):
                aligned = [align(bracket) for bracket in taken]
        placed = [one.bracket if one else bracket for one, bracket in zip(aligned, taken, strict=True)]
        calibration = None
        if response is None:
            with steps.step("response"):
                calibration = _recovered(placed, doubts, treatment)
                response = calibration.response
            mended = [_mended(bracket, calibration) for bracket in placed]
            with steps.step("check"):
                # What was corrected need not be doubted any more.
                doubts = [
                    was if now is bracket else check(now)
                    for was, bracket, now in zip(doubts, placed, mended, strict=True)
                ]
            placed = mended
        ratios = None if calibration is None else calibration.ratios
        stops = {} if ratios is None else ratios.in_stops()
        measured = []
        for bracket, moved, doubt in zip(placed, aligned, doubts, strict=True):
            found = _measured(bracket, response, moved, doubt, treatment, steps)
            names = [p.name for p in bracket.photographs if p.name in stops]
            measured.append(replace(found, corrections={name: stops[name] for name in names}))
    lines = dict.fromkeys(str(w.message) for w in caught)
    return Measurement(
        taken[0].photographs[0].camera, tuple(measured), response, calibration, steps.seconds, tuple(lines)
    )


def _recovered(brackets: Sequence[Bracket], doubts: Sequence[Sequence[Doubt]], treatment: MergeSettings) -> Calibration:
    """The calibration, balanced; where there is none, the doubt that tells why stands in for the mere fact."""
    try:
        calibration = recover_response(brackets, method=treatment.method, refine=treatment.refine)
    except NotABracket as error:
        grave = [doubt.line for each in doubts for doubt in each if doubt.degraded]
        if not grave:
            raise
        raise NotABracket(grave[0]) from error
    white = calibration.response.levels - 1
    neutral = _neutral(calibration) if treatment.neutral is None else treatment.neutral
    if not 0 <= neutral <= white:
        raise ValueError(f"neutral is {neutral}; the photographs' pixel values are 0 to {white}")
    return calibration.balanced_at(neutral)


def _neutral(calibration: Calibration) -> int:
    """White, or where some channel's curve was not observed so high, the highest value at which all were."""
    white = calibration.response.levels - 1
    seen = min(float(np.percentile(samples[:, 1], 99.5)) for samples in calibration.samples)
    return white if seen > OBSERVED * white else int(seen)


def _mended(bracket: Bracket, calibration: Calibration) -> Bracket:
    """The bracket with its exposures corrected; one that told nothing of the response has nothing corrected."""
    seen = set() if calibration.ratios is None else set(calibration.ratios.factors())
    return corrected(bracket, calibration) if seen.issuperset(p.name for p in bracket.photographs) else bracket


def _measured(
    bracket: Bracket,
    response: Response,
    aligned: Aligned | None,
    doubts: tuple[Doubt, ...],
    treatment: MergeSettings,
    steps: Steps,
) -> Measured:
    deghosted = None
    if treatment.consistency is not None and len(bracket.photographs) > 1:
        with steps.step("deghost"):
            deghosted = deghost(bracket, response, method=treatment.consistency)
        _warn_of_an_odd_frame(deghosted)
    with steps.step("merge"):
        picture = merge(deghosted.bracket if deghosted else bracket, response, weighting=treatment.weighting)
    exposures = [p.exposure for p in bracket.photographs if p.exposure]
    picture, balance = without_lens(picture, exposures, treatment, steps)
    scale = None
    if treatment.scale is not None:
        scale = treatment.scale(picture, bracket, response)
        picture = calibrated(picture, scale)
    picture = replace(picture, attributes={**picture.attributes, **provenance(bracket.photographs)})
    focal_length = treatment.focal_length or bracket.focal_length
    found = extent(picture, focal_length=focal_length)
    return Measured(picture, bracket.name, bracket.exposure_table, doubts, aligned, deghosted, found, scale, balance)


def _warn_of_an_odd_frame(deghosted: Deghosted) -> None:
    """Tell where one frame shows what no other does, and is believed: it may be the one that does not belong."""
    shares, names = deghosted.shares, [p.name for p in deghosted.bracket.photographs]
    others = np.delete(shares, deghosted.reference)
    if len(others) >= 3 and shares[deghosted.reference] == 0 and others.min() > ODD:
        warnings.warn(
            f"{names[deghosted.reference]}: in {100 * others.min():.2g} % of the picture it differs from all others, "
            "and it is what they were measured against; if it does not belong to them, leave it out",
            stacklevel=2,
        )


def without_lens(
    picture: RadianceMap, exposures: Sequence[Exposure], treatment: MergeSettings, steps: Steps
) -> tuple[RadianceMap, Balance | None]:
    """The map without the glare and the vignetting of its lens, in balance, as far as `treatment` tells of them.

    Its attributes tell its aperture, so that a map of an even wall knows at which one the vignetting it shows was.
    The second is the balance that it was brought into; None where `treatment` tells of none.
    """
    apertures = {exposure.f_number for exposure in exposures}
    f_number = apertures.pop() if len(apertures) == 1 else None
    if f_number is not None:
        picture = replace(picture, attributes={**picture.attributes, "f_number": f"{f_number:g}"})
    if treatment.glare is not None:
        with steps.step("glare"):
            picture = diminish_glare(picture, treatment.glare(picture)).picture
    if treatment.vignetting:
        picture = without_vignetting(picture, treatment.vignetting, f_number=f_number)
    if treatment.balance is None:
        return picture, None
    balance = treatment.balance(picture)
    return balanced(picture, balance), balance
