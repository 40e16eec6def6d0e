"""Radiance from scans of one negative at different density settings (Debevec & Malik 1997, §2.4)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.lens.vignetting import robust_deviation
from relume.capture.merging import InverseVariance, Weighting, clipping_bounds, log_deviation
from relume.capture.response.camera_profile import read_profile
from relume.errors import NotABracket, warn
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.image.response import Response

FEWEST = 50
"""Pixels that two scans must both hold well, in each channel, for their scales to be compared."""
APART = 0.1
"""Disagreement of ln exposure between scans, beyond a constant, above which their registration is doubtful."""


def merge_scans(
    scans: Sequence[tuple[Photograph, Response]], *, weighting: Weighting = InverseVariance()
) -> RadianceMap:
    """Combine scans of one negative at different density settings into one map by eq. 6 (Debevec & Malik 1997, §2.4).

    scans : photographs in register, positive (brighter where the scene was), of one exposure, each with the response
        recovered from a bracket scanned at its setting; the first one's response gives the scale
    weighting : least noisy unless given

    Each response leaves its own scale open, so each scan is first brought to the first one's by the pixels that both
    hold well, channel by channel. A channel that no scan holds keeps the tightest bound, and is marked as in `merge`.
    Raises NotABracket for scans of different size or exposure, or with no pixel in common; warns where they disagree.
    """
    if not scans:
        raise NotABracket("no scans were given; give at least one with its response")
    _require_one_exposure([photograph for photograph, _ in scans])
    read = [_read(photograph, response, weighting) for photograph, response in scans]
    read = [read[0], *(_aligned(read[0], other) for other in read[1:])]

    weights = np.stack([scan.weights for scan in read])
    logarithm = np.stack([scan.logarithm for scan in read])
    total = weights.sum(0)
    measured = total > 0
    safe = np.where(measured, total, 1.0)
    mean = (weights * logarithm).sum(0) / safe
    variance = (weights**2 * np.stack([scan.relative_variance for scan in read])).sum(0) / safe**2

    inside = np.logical_not(np.stack([scan.outside[..., None] for scan in read]))
    white = np.stack([scan.white for scan in read]) & inside
    saturated = white.any(0) & ~measured
    lower = np.where(white, logarithm, -np.inf).max(0)
    upper = np.where(inside & ~white, logarithm, np.inf).min(0)
    value = np.where(measured, mean, np.where(saturated, lower, upper))
    nowhere = np.logical_and.reduce([scan.outside for scan in read])

    clipped = np.where(saturated.any(-1), SATURATED, np.where((~measured).any(-1), BLACK, 0)).astype(np.uint8)
    clipped[nowhere] = OUTSIDE
    radiance = np.where(nowhere[..., None], 0.0, np.exp(np.where(np.isfinite(value), value, 0.0)))
    spread = np.where(measured, radiance**2 * variance, np.inf)
    return RadianceMap(radiance.astype(np.float32), spread.astype(np.float32), clipped)


def merge_scan_files(
    scans: Sequence[str | os.PathLike[str]], profiles: Sequence[str | os.PathLike[str]], *,
    seconds: float | None = None, weighting: Weighting = InverseVariance(),
) -> RadianceMap:  # fmt: skip
    """`merge_scans` of files: scans of one negative, and the profile of each one's density setting, in their order.

    profiles : as `relume merge --save-profile` writes them, of a bracket that was scanned at that setting
    seconds : exposure of the negative; that of the scans' EXIF unless given. Without any the scale is that of 1 s
    weighting : as of `merge_scans`
    Raises NotABracket for other numbers of profiles and as `merge_scans`; UnreadableFile, ValueError for files.
    """
    if len(profiles) != len(scans):
        raise NotABracket(f"{len(scans)} scans and {len(profiles)} profiles; give one a scan, of its density setting")
    read = []
    for path, profile in zip(scans, profiles, strict=True):
        response = read_profile(Path(profile)).response
        if response is None:
            raise NotABracket(f"{profile}: holds no response of photographs; save one from a bracket of scans")
        photograph = files.read_photograph(path)
        if seconds is not None or photograph.exposure is None:
            photograph = replace(photograph, exposure=Exposure(1.0 if seconds is None else seconds))
        read.append((photograph, response))
    return merge_scans(read, weighting=weighting)


@dataclass(frozen=True, eq=False)
class _Scan:
    """One scan read through its response; arrays (H, W, 3).

    logarithm : ln radiance; a bound where `weights` is 0
    relative_variance : variance of ln radiance
    weights : of eq. 6
    white : in the upper half of the pixel values
    outside : (H, W)
    """

    name: str
    logarithm: np.ndarray
    relative_variance: np.ndarray
    weights: np.ndarray
    white: np.ndarray
    outside: np.ndarray


def _read(photograph: Photograph, response: Response, weighting: Weighting) -> _Scan:
    levels = np.iinfo(photograph.pixels.dtype).max + 1
    if levels != response.levels:
        raise NotABracket(
            f"{photograph.name}: {photograph.pixels.dtype} pixels and a response of {response.levels} values; "
            f"it needs a response of {levels} values"
        )
    assert photograph.exposure is not None  # _require_one_exposure refused the others
    values, channels = photograph.pixels.astype(np.intp), np.arange(3)
    outside = np.zeros(values.shape[:2], bool) if photograph.outside is None else photograph.outside
    weights = np.where(outside[..., None], 0.0, weighting.table(response)[channels, values])
    known = np.where(weights > 0, response.log_exposure[channels, values], clipping_bounds(response)[channels, values])
    return _Scan(
        photograph.name,
        known - np.log(photograph.exposure.factor),
        (log_deviation(response) ** 2)[channels, values],
        weights,
        values > levels // 2,
        outside,
    )


def _aligned(first: _Scan, other: _Scan) -> _Scan:
    """The other scan on the first one's scale, channel by channel."""
    logarithm = other.logarithm.copy()
    for channel, name in enumerate(("red", "green", "blue")):
        both = (first.weights[..., channel] > 0) & (other.weights[..., channel] > 0)
        if both.sum() < FEWEST:
            raise NotABracket(
                f"{first.name} and {other.name} hold {int(both.sum())} pixels of {name} in common; scan at density "
                "settings that overlap"
            )
        apart = (first.logarithm - other.logarithm)[..., channel][both]
        noise = np.sqrt((first.relative_variance + other.relative_variance)[..., channel][both])
        middle, scatter = float(np.median(apart)), robust_deviation(apart)
        if scatter > max(APART, 3 * float(np.median(noise))):
            warn(
                f"{first.name} and {other.name} disagree by {scatter:.2f} of ln exposure in {name}; register the scans "
                "and check that each has the response of its own setting"
            )
        # The mean of what lies within three deviations: the median of rounded values would come in steps.
        width = 3 * np.maximum(noise, scatter)
        near = np.abs(apart - middle) <= width
        weight = noise[near] ** -2
        logarithm[..., channel] += float(weight @ apart[near] / weight.sum())
    return replace(other, logarithm=logarithm)


def _require_one_exposure(photographs: Sequence[Photograph]) -> None:
    first = photographs[0]
    for photograph in photographs:
        if photograph.exposure is None:
            raise NotABracket(f"{photograph.name}: no exposure is known; give that of the negative")
        assert first.exposure is not None  # the first was looked at first
        if photograph.size != first.size:
            raise NotABracket(
                f"{photograph.name} is {photograph.size[0]}×{photograph.size[1]}, {first.name} is "
                f"{first.size[0]}×{first.size[1]}; register the scans and crop them alike"
            )
        if abs(np.log(photograph.exposure.factor / first.exposure.factor)) > 1e-6:
            raise NotABracket(
                f"{photograph.name} and {first.name} have different exposures, so they are no scans of one negative; "
                "merge them as a bracket"
            )
