"""From camera raws to a radiance map with all that is known of it."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from relume.capture.alignment.alignment import align
from relume.capture.clipping_report import extent
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import Doubt, check
from relume.capture.ghosts.deghosting import deghost
from relume.capture.measurement import Measured, Measurement, MergeSettings, without_lens
from relume.capture.provenance import provenance
from relume.capture.raw.merging import RawCalibration, RawSource, calibrate_raw, merge_raw, opened
from relume.capture.raw.sensor import Sensor
from relume.capture.scale.absolute import Scale, calibrated
from relume.capture.step_timing import Steps
from relume.errors import NotABracket
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.raw import RawPhotograph
from relume.image.response import Response

PREVIEW = 1600
"""Pixels, about, of a preview's longer side: enough to see a shift of half a pixel of the raw."""
LEVELS = 65536
MOVED = 0.5
"""Pixels of the raw by which a frame may lie off before it is told: sharp detail is smeared from there on."""

RawScale = Callable[[RadianceMap, Bracket, RawCalibration], Scale]


def measure_raw(
    photographs: Sequence[RawSource] | Sequence[Sequence[RawSource]],
    *,
    times: Sequence[float] | None = None,
    balance: Sequence[float] | None = None,
    refine: bool = True,
    scale: RawScale | None = None,
    sensor: Sensor | None = None,
    treatment: MergeSettings = MergeSettings(),
    told: Callable[[str], None] = lambda step: None,
) -> Measurement:
    """Merge camera raws photosite by photosite, with what the photographs say against the result.

    photographs : of one bracket, or of several of one camera, whose maps share one scale. What is read in a map, as a
        spot meter's reading, is read in that of the first
    times : exposure time of each in seconds, bracket after bracket, in place of the whole EXIF exposure
    balance : as in `merge_raw`
    refine : whether the ratios of the exposures are measured from the pixels. They are unless told otherwise: without a
        curve to recover nothing else could be meant by what the pixels say of them
    scale : given the map, its bracket (small pictures, the focal length the map's) and what the raws tell, the scale to
        cd/m²
    sensor : of the camera, where it was measured before; see `calibrate_raw`
    treatment : its glare, vignetting, balance and focal length count. Raws need no response, so method, neutral, refine
        and scale, which tell of one, do not; they are weighed by their sensor's noise and merged as they lie, so
        weighting, aligned and consistency do not either
    told : called with the name of each step as it begins

    Frames that moved against each other, and things that moved in them, are found in small pictures of them and told as
    doubts. Raises UnreadableFile, NotABracket.
    """
    brackets = _brackets(photographs)
    count = sum(len(bracket) for bracket in brackets)
    if times is not None and len(times) != count:
        raise NotABracket(f"{len(times)} times were given for {count} photographs; give one a photograph")
    steps, treatment, response = Steps(told), treatment.read_once(), _linear()
    measured: list[Measured] = []
    cameras: list[str] = []
    sensors: list[Sensor] = []
    found, begin = None, 0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        for sources in brackets:
            with steps.step("exposures and noise"):
                own = None if times is None else times[begin : begin + len(sources)]
                known = calibrate_raw(sources, times=own, sensor=sensor, refine_exposures=refine)
            begin += len(sources)
            with steps.step("check"):
                bracket, shrunk = _previews(sources, known)
                doubts = (*check(bracket, response), *_movement(bracket, response, shrunk))
            cameras.append(bracket.photographs[0].camera)
            if cameras[-1] != cameras[0]:
                raise NotABracket(f"{bracket.name}: of {cameras[-1]}, the others of {cameras[0]}; merge them apart")
            with steps.step("merge"):
                picture = merge_raw(sources, calibration=known, balance=balance)
            picture, balanced = without_lens(picture, known.exposures, treatment, steps)
            picture = replace(picture, attributes={**picture.attributes, **provenance(bracket.photographs)})
            if scale is not None:
                found = found or scale(picture, bracket, known)
                picture = calibrated(picture, found)
            focal_length = treatment.focal_length or bracket.focal_length
            measured.append(Measured(
                picture, bracket.name, bracket.exposure_table, doubts, None, None,
                extent(picture, focal_length=focal_length), found, balanced, known.corrections(),
            ))  # fmt: skip
            sensors.append(known.sensor)
    telling = [one for one in sensors if one.noise is not None] or sensors
    lines = dict.fromkeys(str(w.message) for w in caught)
    return Measurement(cameras[0], tuple(measured), None, None, steps.seconds, tuple(lines), telling[0])


def _brackets(photographs: Sequence[RawSource] | Sequence[Sequence[RawSource]]) -> list[Sequence[RawSource]]:
    """Several brackets, or the one that was given."""
    several: list[Sequence[RawSource]] = []
    alone: list[RawSource] = []
    for each in photographs:
        if isinstance(each, str | os.PathLike | RawPhotograph):
            alone.append(each)
        else:
            several.append(each)
    if alone and several:
        raise ValueError("photographs and brackets of them together; give the photographs of one, or brackets alone")
    return several or [alone]


def _previews(photographs: Sequence[RawSource], known: RawCalibration) -> tuple[Bracket, int]:
    """Small linear pictures of the raws, their focal length the raws' own, and how many raw pixels theirs are wide."""
    frames, shrunk = [], 2
    for raw, factor, exposure in zip(opened(photographs), known.factors, known.exposures, strict=True):
        shrunk = 2 * max(1, max(raw.size) // (2 * PREVIEW))
        told = replace(exposure, seconds=exposure.seconds * float(factor) / exposure.factor)
        frames.append(replace(preview(raw, shrunk, known.saturation), exposure=told, focal_length=raw.focal_length))
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


def _linear() -> Response:
    """Values as they are; a preview's noise is small beside 1 % of its value."""
    values = np.arange(LEVELS) + 0.5
    return Response(np.tile(np.log(values / LEVELS), (3, 1)), np.tile(8 + 0.01 * values, (3, 1)))


def _movement(bracket: Bracket, response: Response, shrunk: int) -> list[Doubt]:
    if len(bracket.photographs) == 1:
        return []
    aligned = align(bracket)
    doubts = []
    for photograph, motion in zip(aligned.bracket.photographs, aligned.motions, strict=True):
        moved = motion.displacement(photograph.size) * shrunk
        if moved > MOVED:
            doubts.append(
                Doubt(
                    photograph.name,
                    f"lies {moved:.1f} pixels off the others, and raws are merged as they lie",
                    "develop the raws to 16-bit TIFF with a known curve and merge those, or photograph from a tripod",
                    True,
                )
            )
    share = float(deghost(aligned.bracket, response).ghosts.mean())
    if share > 1e-3:
        doubts.append(
            Doubt(
                bracket.name,
                f"something moved in {100 * share:.2g} % of the picture, and raws are merged without taking it out",
                "develop the raws to 16-bit TIFF with a known curve and merge those, or leave out the frames it is in",
                True,
            )
        )
    return doubts
