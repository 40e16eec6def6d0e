"""A plate that is a single photograph: by which curve it is read, and what ties it to the scale of the light.

One photograph shows nothing of its camera's response. The response comes from the camera's profile, else from the
photographs of the ball if the same camera took them, else the values are taken for what the file says of them: mostly
sRGB. Every pixel value is read back exactly, so that developing gives the photograph again, its whites included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeGuard

import numpy as np

from relume.capture.brackets.merging import BracketSource, merge_brackets
from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.exposures import exposed
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import warn
from relume.image import files
from relume.image.colour_space import name_of, response_of
from relume.image.files.video import read_video_frame
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.image.response import Response, srgb_response
from relume.probe.clipped_light import WHITE
from relume.virtual_camera.film.grain import ROUNDING
from relume.virtual_camera.film.undeveloping import AllButEnds
from relume.virtual_camera.plate_matching.grain_measuring import photograph_grain

LOOKED_AT = 1600
"""Pixels across and down of the middle in which the noise of a photograph is measured: some 6000 flat patches."""
ASSUMED = 0.1
"""By what share a camera's own curve differs from sRGB where objects stand: a tone curve lifts the middle."""


def read_single(path: Path, times: Sequence[float] | None, frame: int | None = None) -> Bracket:
    """One encoded photograph as a bracket; without any exposure it counts as exposed for one second, "estimated".

    frame : of a video, 1 for its first; None for a photograph
    """
    read = files.read_photograph(path) if frame is None else read_video_frame(path, frame)
    (photograph,) = exposed([read], times=times)
    if photograph.exposure is None:
        photograph = replace(photograph, exposure=Exposure(1.0, source="estimated"))
    return Bracket((photograph,))


def is_single(source: BracketSource | RadianceMap) -> TypeGuard[Bracket]:
    """Whether the source is one encoded photograph."""
    return isinstance(source, Bracket) and len(source.photographs) == 1


def why_untied(plate: Photograph, others: Sequence[BracketSource]) -> str | None:
    """Why the exposures of a single photograph do not put it on the scale of the ball's; None where they do.

    others : the brackets of the ball
    """
    exposure = plate.exposure
    if exposure is None or exposure.source == "estimated":
        return f"{plate.name} holds no exposure"
    for other in others:
        if not isinstance(other, Bracket):
            return f"{plate.name} is encoded and the ball's photographs are camera raws"
        theirs = other.photographs[0].exposure
        for attribute, word in (("f_number", "f-number"), ("iso", "ISO")):
            lacking = [getattr(each, attribute, None) is None for each in (exposure, theirs)]
            if lacking[0] != lacking[1]:
                having, without = (other.name, plate.name) if lacking[0] else (plate.name, other.name)
                return f"{having} holds an {word} and {without} none"
    return None


def merge_single(
    bracket: Bracket, known: CameraProfile | Response | None, settings: MergeSettings
) -> tuple[MergedBracket, MergedCamera]:
    """The radiance of a single photograph, and its camera; every value is read exactly as the curve has it.

    known : the camera's profile, or the response that its other photographs showed; sRGB is assumed unless given

    Values that are white or black are marked `clipped`, and their variance is infinite.
    """
    (photograph,) = bracket.photographs
    levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
    if known is None:
        known = assumed_response(photograph)
    elif isinstance(known, Response) and known.levels != levels:
        known = _at_depth(known, levels)
    # No exposure at all is no doubt of a photograph alone: its scale is found otherwise.
    assert photograph.exposure is not None  # a Bracket has one
    bracket = Bracket((replace(photograph, exposure=replace(photograph.exposure, source="given")),))
    # White and black count as what the curve says, for no other photograph says better.
    plain = replace(settings, weighting=AllButEnds(guard=-1), align=False, deghost=False, refine=False)
    result = merge_brackets(bracket, profile=known, settings=plain)
    for doubt in result.doubts:
        warn(doubt.line, doubt.effect)
    merged = result.bracket
    return replace(merged, picture=_ends_marked(merged.picture, photograph)), result.camera


def assumed_response(photograph: Photograph) -> Response:
    """The curve of the photograph's profile, else sRGB, with the noise that its flat patches show; warns.

    ISO 12232 rates JPEG files by the middle of their values (118 of 255). The curve's zero is at the middle, where
    recovered curves have theirs: so two cameras' exposures are tied as their ISO numbers promise, to about half a stop.
    """
    warn(
        f"{photograph.name}: one photograph, and the curve of {photograph.camera or 'its camera'} is not known: its "
        f"values are taken for {name_of(photograph)}; give the profile of its camera, or a bracket",
        effect=ASSUMED,
    )
    levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
    curve = response_of(photograph) or srgb_response(levels)
    middle = (levels - 1) // 2
    log_exposure = curve.log_exposure - curve.log_exposure[:, middle : middle + 1]
    rows, columns = (slice(max(0, (n - LOOKED_AT) // 2), (n + LOOKED_AT) // 2) for n in photograph.pixels.shape[:2])
    outside = None if photograph.outside is None else photograph.outside[rows, columns]
    grain = photograph_grain(replace(photograph, pixels=photograph.pixels[rows, columns], outside=outside))
    if grain is None:
        return Response(log_exposure, curve.noise)
    values = np.arange(levels)
    measured = np.stack([np.interp(values, *each) for each in zip(grain.values, grain.deviation, strict=True)])
    return Response(log_exposure, np.sqrt(measured**2 + ROUNDING))


def _at_depth(response: Response, levels: int) -> Response:
    """The response for photographs of another number of values: of 16 bits for 8."""
    own, wanted = np.linspace(0, 1, response.levels), np.linspace(0, 1, levels)
    curves, noise = (
        np.stack([np.interp(wanted, own, each) for each in part])
        for part in (response.log_exposure, response.deviation)
    )
    return Response(curves, noise * (levels - 1) / (response.levels - 1))


def _ends_marked(picture: RadianceMap, photograph: Photograph) -> RadianceMap:
    """The picture with what is white in a channel, or black in all, marked, and not known to any accuracy."""
    pixels = photograph.pixels
    white = pixels >= WHITE * np.iinfo(pixels.dtype).max
    marks = np.where(white.any(-1), SATURATED, 0).astype(np.uint8)
    marks[(pixels == 0).all(-1)] = BLACK
    if picture.clipped is not None:
        marks = np.where(picture.clipped != 0, picture.clipped, marks)
    variance = None if picture.variance is None else np.where(white | (pixels == 0), np.inf, picture.variance)
    return replace(picture, clipped=marks, variance=variance)
