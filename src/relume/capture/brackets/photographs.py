"""The steps from the brackets of one camera to radiance maps: check, align, response, ghosts, merge, lens."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.capture.alignment.alignment import Aligned, align
from relume.capture.brackets.lens_steps import LensSteps, Steps
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import Doubt, check
from relume.capture.ghosts.deghosting import Deghosted, deghost
from relume.capture.merging import merge
from relume.capture.response.calibration import Calibration, corrected, recover_response
from relume.capture.response.ratios import Ratios
from relume.errors import NotABracket
from relume.image.response import Response

ODD = 0.02
"""Share of the picture in which one frame contradicts all the others before a warning is given."""
OBSERVED = 0.7
"""Share of white up to which every curve must have been observed for the channels to be tied at white; beyond its
observations a curve is a guess: sixteen scans of film, whose blue is hardly seen above the middle, came out yellow."""


def merge_photographs(
    brackets: Sequence[Bracket], response: Response | None, settings: MergeSettings, steps: Steps
) -> tuple[list[MergedBracket], MergedCamera]:
    """Radiance maps of the brackets of one camera, all by one response and on one scale.

    response : recovered from the brackets where None
    Raises NotABracket, ValueError; warns.
    """
    with steps.step("check"):
        doubts = [check(bracket, response) for bracket in brackets]
    aligned: list[Aligned | None] = [None] * len(brackets)
    if settings.align:
        with steps.step("align"):
            aligned = [align(bracket) for bracket in brackets]
    placed = [one.bracket if one else bracket for one, bracket in zip(aligned, brackets, strict=True)]

    # The response, and the exposures that it corrects.
    calibration = None
    if response is None:
        with steps.step("response"):
            calibration = _recovered(placed, doubts, settings)
            response = calibration.response
        refined = [_refined(bracket, calibration) for bracket in placed]
        with steps.step("check"):
            # An exposure that was corrected is no longer in doubt.
            doubts = [
                was if now is bracket else check(now) for was, bracket, now in zip(doubts, placed, refined, strict=True)
            ]
        placed = refined
    ratios = None if calibration is None else calibration.ratios
    stops = {} if ratios is None else ratios.in_stops()

    # Bracket by bracket: ghosts, merge, lens.
    lens, merged = LensSteps(settings, steps), []
    for bracket, moved, doubt in zip(placed, aligned, doubts, strict=True):
        deghosted = None
        if settings.deghost and len(bracket.photographs) > 1:
            with steps.step("deghost"):
                deghosted = deghost(bracket, response)
            _warn_of_an_odd_frame(deghosted)
        with steps.step("merge"):
            picture = merge(deghosted.bracket if deghosted else bracket, response, weighting=settings.weighting)
        found = lens.applied(picture, bracket, response, doubt)
        corrections = {p.name: stops[p.name] for p in bracket.photographs if p.name in stops}
        merged.append(replace(found, aligned=moved, deghosted=deghosted, corrections=corrections))
    return merged, MergedCamera(merged[0].camera, response, calibration)


def _recovered(brackets: Sequence[Bracket], doubts: Sequence[Sequence[Doubt]], settings: MergeSettings) -> Calibration:
    """The calibration, balanced; a grave doubt about the photographs explains best why there is none."""
    try:
        refine = Ratios() if settings.refine else None
        calibration = recover_response(brackets, method=settings.method, refine=refine)
    except NotABracket as error:
        grave = [doubt.line for each in doubts for doubt in each if doubt.degraded]
        if not grave:
            raise
        raise NotABracket(grave[0]) from error
    white = calibration.response.levels - 1
    neutral = _neutral(calibration) if settings.neutral is None else settings.neutral
    if not 0 <= neutral <= white:
        raise ValueError(f"neutral is {neutral}; the photographs' pixel values are 0 to {white}")
    return calibration.balanced_at(neutral)


def _neutral(calibration: Calibration) -> int:
    """White, or where some channel's curve was not observed so high, the highest value at which all were."""
    white = calibration.response.levels - 1
    seen = min(float(np.percentile(samples[:, 1], 99.5)) for samples in calibration.samples)
    return white if seen > OBSERVED * white else int(seen)


def _refined(bracket: Bracket, calibration: Calibration) -> Bracket:
    """The bracket with its exposures corrected; a bracket that the response was not recovered from stays as it is."""
    seen = set() if calibration.ratios is None else set(calibration.ratios.factors())
    return corrected(bracket, calibration) if seen.issuperset(p.name for p in bracket.photographs) else bracket


def _warn_of_an_odd_frame(deghosted: Deghosted) -> None:
    """Warn where the reference frame contradicts all others: it may be the one that does not belong."""
    shares, names = deghosted.shares, [p.name for p in deghosted.bracket.photographs]
    others = np.delete(shares, deghosted.reference)
    if len(others) >= 3 and shares[deghosted.reference] == 0 and others.min() > ODD:
        warnings.warn(
            f"{names[deghosted.reference]}: in {100 * others.min():.2g} % of the picture it differs from all others, "
            "and it is what they were measured against; if it does not belong to them, leave it out",
            stacklevel=2,
        )
