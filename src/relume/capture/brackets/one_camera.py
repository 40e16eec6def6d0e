"""The steps from the brackets of one camera to radiance maps.

Photographs: check, align, response, ghosts, merge, lens. Camera raws: exposures and noise, check, merge, lens.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from typing import TypeVar

import numpy as np

from relume.capture.alignment.alignment import Aligned, align
from relume.capture.brackets.hues import hue_doubts
from relume.capture.brackets.lens_steps import LensSteps, Steps
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import BracketDoubt, check
from relume.capture.exposure.white_balance import of_one_white
from relume.capture.ghosts.deghosting import Deghosted, deghost
from relume.capture.merging import merge
from relume.capture.raw.merging import RawCalibration, RawSource, calibrate_raw, merge_raw, opened
from relume.capture.raw.sensor import Sensor
from relume.capture.response.calibration import CHANNELS, Calibration, corrected, recover_response
from relume.capture.response.nearly_white import below_white
from relume.capture.response.neutral import tied
from relume.capture.response.ratios import Ratios
from relume.capture.response.saturation import White, whitened
from relume.capture.response.small_lamps import with_small_lamps
from relume.errors import NotABracket, warn
from relume.image.bands import side_by_side
from relume.image.colour_space import in_rec709
from relume.image.photograph import Photograph, RawPhotograph
from relume.image.radiance import SATURATED, RadianceMap
from relume.image.response import Response

Result = TypeVar("Result")

ODD = 0.02
"""Share of the picture in which one frame contradicts all the others before a warning is given."""
PREVIEW = 1600
"""Pixels, about, of a preview's longer side: enough to see a shift of half a pixel of the raw."""
LEVELS = 65536
MOVED = 0.5
"""Pixels of the raw by which a frame may lie off before it is doubted: sharp detail is smeared from there on."""
DEVELOP = "develop the raws to 16-bit TIFF with a known curve and merge those"


def merge_photographs(
    brackets: Sequence[Bracket], response: Response | None, settings: MergeSettings, steps: Steps
) -> tuple[list[MergedBracket], MergedCamera]:
    """Radiance maps of the brackets of one camera, all by one response and on one scale.

    response : recovered from the brackets where None
    Raises NotABracket, ValueError; warns.
    """
    with steps.step("check"):
        # What a camera did to its frames' white is undone before anything is measured by them.
        brackets = [of_one_white(bracket) for bracket in brackets]
        doubts = _each([partial(check, bracket, response) for bracket in brackets], brackets)
    aligned: Sequence[Aligned | None] = [None] * len(brackets)
    if settings.align:
        with steps.step("align"):
            aligned = _each([partial(align, bracket) for bracket in brackets], brackets)
    placed = [one.bracket if one else bracket for one, bracket in zip(aligned, brackets, strict=True)]
    placed, whites = _with_true_whites(placed)

    # The response, and the exposures that it corrects.
    calibration = None
    if response is None:
        with steps.step("response"):
            calibration = _recovered(placed, whites, doubts, settings)
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

    # Ghosts, merge, and bracket by bracket the lens, which is read in the first.
    deghosted: Sequence[Deghosted | None] = [None] * len(placed)
    if settings.deghost:
        with steps.step("deghost"):
            deghosted = _each([partial(_deghosted, bracket, response) for bracket in placed], placed)
        for one in deghosted:
            if one is not None:
                _warn_of_an_odd_frame(one)
    with steps.step("merge"):
        given = calibration is None
        works = [
            partial(_merged, bracket, one.bracket if one else bracket, response, settings, given)
            for bracket, one in zip(placed, deghosted, strict=True)
        ]
        pictures = _each(works, placed)
    lens, merged = LensSteps(settings, steps), []
    pictures.reverse()
    for bracket, moved, one, doubt in zip(placed, aligned, deghosted, doubts, strict=True):
        picture, hues = pictures.pop()  # so that a map goes when its lens has been corrected
        found = lens.applied(picture, bracket, response, (*doubt, *hues))
        if one is not None and one.ghosts.any():
            found = replace(found, clipping=replace(found.clipping, moved=_saturated_where_moved(picture, one)))
        corrections = {p.name: stops[p.name] for p in bracket.photographs if p.name in stops}
        merged.append(replace(found, aligned=moved, deghosted=one, corrections=corrections))
    return merged, MergedCamera(merged[0].camera, response, calibration)


def _each(works: Sequence[Callable[[], Result]], brackets: Sequence[Bracket]) -> list[Result]:
    """A step of every bracket, side by side where their photographs are small."""
    return side_by_side(works, max(one.photographs[0].pixels.size // 3 for one in brackets))


def _deghosted(bracket: Bracket, response: Response) -> Deghosted | None:
    return deghost(bracket, response) if len(bracket.photographs) > 1 else None


def _merged(
    bracket: Bracket, still: Bracket, response: Response, settings: MergeSettings, given: bool
) -> tuple[RadianceMap, tuple[BracketDoubt, ...]]:
    """A bracket's map before anything of the lens, and doubts about its hues.

    still : the bracket without what moved
    given : whether the response is that of a profile
    """
    picture = merge(still, response, weighting=settings.weighting, believed=below_white(still))
    picture = with_small_lamps(picture, still, response)
    # The response was that of the photographs' own channels, and so were these.
    return in_rec709(picture, bracket.photographs[0]), hue_doubts(bracket, picture, given=given)


def _recovered(
    brackets: Sequence[Bracket],
    whites: Sequence[White],
    doubts: Sequence[Sequence[BracketDoubt]],
    settings: MergeSettings,
) -> Calibration:
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
    if settings.neutral is None:
        return tied(calibration, whites)
    if not 0 <= settings.neutral <= white:
        raise ValueError(f"neutral is {settings.neutral}; the photographs' pixel values are 0 to {white}")
    return calibration.balanced_at(settings.neutral)


def _with_true_whites(brackets: Sequence[Bracket]) -> tuple[list[Bracket], list[White]]:
    """The brackets with each frame's white where shorter ones show it; a note names frames that end below white."""
    found, whites = [], []
    for true, ends in _each([partial(whitened, bracket) for bracket in brackets], brackets):
        found.append(true)
        whites += ends
        for name, each in groupby((end for end in ends if end.least is not None), key=lambda end: end.name):
            pressed = list(each)
            channels = ", ".join(f"{CHANNELS[end.channel]} at {end.value}" for end in pressed)
            warn(
                f"{name}: it ends below white ({channels}) where shorter exposures are white, as photographs do whose "
                f"bright parts were pressed together; values from {min(end.least or 0 for end in pressed)} on count "
                "as white"
            )
    return found, whites


def _refined(bracket: Bracket, calibration: Calibration) -> Bracket:
    """The bracket with its exposures corrected; a bracket that the response was not recovered from stays as it is."""
    seen = set() if calibration.ratios is None else set(calibration.ratios.factors())
    return corrected(bracket, calibration) if seen.issuperset(p.name for p in bracket.photographs) else bracket


def _saturated_where_moved(picture: RadianceMap, deghosted: Deghosted) -> dict[str, int]:
    """How many saturated pixels come from each photograph where something moved."""
    sources = deghosted.sources[(picture.clipped == SATURATED) & deghosted.ghosts]
    counts = np.bincount(sources[sources >= 0], minlength=1)
    return {deghosted.bracket.photographs[i].name: int(counts[i]) for i in np.flatnonzero(counts)}


def _warn_of_an_odd_frame(deghosted: Deghosted) -> None:
    """Warn where the reference frame contradicts all others: it may be the one that does not belong."""
    shares, names = deghosted.shares, [p.name for p in deghosted.bracket.photographs]
    others = np.delete(shares, deghosted.reference)
    if len(others) >= 3 and shares[deghosted.reference] == 0 and others.min() > ODD:
        warn(
            f"{names[deghosted.reference]}: in {100 * others.min():.2g} % of the picture it differs from all others, "
            "and it is what they were measured against; if it does not belong to them, leave it out"
        )


def merge_raws(
    brackets: Sequence[tuple[Sequence[RawSource], Sequence[float] | None]],
    sensor: Sensor | None,
    settings: MergeSettings,
    steps: Steps,
) -> tuple[list[MergedBracket], MergedCamera]:
    """Radiance maps of the raw brackets of one camera, merged photosite by photosite, on one scale.

    brackets : each its raws and, in place of the whole EXIF exposure, the time of each in seconds
    sensor : of the camera, where it was measured before; see `calibrate_raw`

    Frames that moved against each other, and things that moved in them, are found in small pictures of them and
    become doubts. The ratios of the exposures are always measured from the pixels: without a curve to recover,
    nothing else could explain the differences. Raises UnreadableFile, NotABracket; warns.
    """
    # Values as they are; a preview's noise is small beside 1 % of its value.
    values = np.arange(LEVELS) + 0.5
    response = Response(np.tile(np.log(values / LEVELS), (3, 1)), np.tile(8 + 0.01 * values, (3, 1)))
    lens, merged, sensors = LensSteps(settings, steps), [], []
    for sources, times in brackets:
        with steps.step("exposures and noise"):
            known = calibrate_raw(sources, times=times, sensor=sensor)
        with steps.step("check"):
            bracket, shrunk = _previews(sources, known)
            doubts = (*check(bracket, response), *_movement(bracket, response, shrunk))
        with steps.step("merge"):
            picture = merge_raw(sources, calibration=known)
        found = lens.applied(picture, bracket, known, doubts)
        merged.append(replace(found, corrections=known.corrections()))
        sensors.append(known.sensor)
    with_noise = [one for one in sensors if one.noise is not None] or sensors
    return merged, MergedCamera(merged[0].camera, None, None, with_noise[0])


def _previews(photographs: Sequence[RawSource], known: RawCalibration) -> tuple[Bracket, int]:
    """Small linear pictures of the raws, their focal length the raws' own, and how many raw pixels theirs are wide."""
    frames, shrunk = [], 2
    for raw, factor, exposure in zip(opened(photographs), known.factors, known.exposures, strict=True):
        shrunk = 2 * max(1, max(raw.size) // (2 * PREVIEW))
        refined = replace(exposure, seconds=exposure.seconds * float(factor) / exposure.factor)
        frames.append(replace(preview(raw, shrunk, known.saturation), exposure=refined, focal_length=raw.focal_length))
    return Bracket(tuple(frames)), shrunk


def preview(raw: RawPhotograph, shrunk: int, saturation: float = 1.0) -> Photograph:
    """The raw as a small linear picture of 16 bits in camera colours, black at 0 and saturation at 65535.

    shrunk : even; raw pixels along the side of one of its pixels. One that holds a saturated photosite is saturated
    saturation : as in `RawCalibration`; as white is written in the file unless given
    """
    width, height = (side // shrunk * shrunk for side in raw.size)
    pixels = np.empty((height // shrunk, width // shrunk, 3), np.uint16)
    for channel in range(3):
        planes, saturated = [], []
        for row, column in zip(*np.nonzero(raw.pattern == channel), strict=True):
            sites = raw.mosaic[row:height:2, column:width:2]
            blocks = sites.reshape(height // shrunk, shrunk // 2, width // shrunk, shrunk // 2)
            black = raw.black[row, column]
            planes.append((blocks.mean((1, 3), dtype=np.float32) - black) / (raw.white - black))
            saturated.append(blocks.max((1, 3)) > black + saturation * (raw.white - black) - 0.5)
        mean = np.where(np.any(saturated, axis=0), 1.0, np.mean(planes, axis=0))
        pixels[..., channel] = np.rint(np.clip(mean, 0, 1) * (LEVELS - 1))
    focal_length = raw.focal_length and raw.focal_length / shrunk
    return Photograph(pixels, raw.name, raw.exposure, raw.camera, focal_length, settings=raw.settings)


def _movement(bracket: Bracket, response: Response, shrunk: int) -> list[BracketDoubt]:
    if len(bracket.photographs) == 1:
        return []
    aligned = align(bracket)
    doubts = []
    for photograph, motion in zip(aligned.bracket.photographs, aligned.motions, strict=True):
        moved = motion.displacement(photograph.size) * shrunk
        if moved > MOVED:
            what = f"lies {moved:.1f} pixels off the others, and raws are merged as they lie"
            doubts.append(BracketDoubt(photograph.name, what, f"{DEVELOP}, or photograph from a tripod", True, 0.3))
    share = float(deghost(aligned.bracket, response).ghosts.mean())
    if share > 1e-3:
        what = f"something moved in {100 * share:.2g} % of the picture, and raws are merged without taking it out"
        doubts.append(BracketDoubt(bracket.name, what, f"{DEVELOP}, or leave out the frames it is in", True, 0.3))
    return doubts
