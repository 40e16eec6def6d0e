"""Photographs taken from one place in several directions, mosaicked into one illumination map.

Miller & Hoffman (1984), §5.1: "The six pictures must be mosaiced into one seamless image."
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.panorama.balance import RIM, Balancing, balance, compare
from relume.probe.panorama.blending import blend
from relume.probe.panorama.bundle_adjustment import Adjusted, orient
from relume.probe.panorama.coverage import sight
from relume.probe.panorama.matching import Matching
from relume.probe.panorama.seams import ROWS as SEAM_ROWS
from relume.probe.panorama.seams import even, lay_seams
from relume.probe.panorama.views import PanoramaView, refuse_unusable
from relume.sphere.environment_map import EnvironmentMap

LARGEST = 4096
"""Rows of a map whose size was not told, at most: 300 MB."""
STEP = 16
"""Rows are a multiple of it, so that a map can be halved."""
LOOSE = 3.0
"""Pixels that matches differ by above which the views were not taken from one place."""
UNLIKE = 0.2
"""Median difference of ln luminance above which overlapping views do not show the same."""
SHARE_DISPUTED = 0.02
"""Of the sphere, that views may show differently before it is told."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """An illumination map with what it was put together from.

    light : lat-long; `clipped` tells what no view saw, or none measured
    views : as given, with rotation, focal length and distortion as found, without those that are left out
    gains : (views, 3), that each picture was multiplied by
    vignetting : that was taken out of all
    unseen : steradians that no view sees, filled in
    saturated : steradians that are saturated in every view that sees them
    error : root mean square of what matches differ by, radians; None where orientations were told
    disagreement : median difference of ln luminance where views overlap, balanced
    notes : doubts about the result, a line each
    remarks : what was done that nobody asked for, a line each
    """

    light: EnvironmentMap
    views: tuple[PanoramaView, ...]
    gains: np.ndarray
    vignetting: Vignetting
    unseen: float
    saturated: float
    error: float | None
    disagreement: float
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def mosaic(
    views: Sequence[PanoramaView],
    *,
    size: int | None = None,
    matching: Matching = Matching(),
    balancing: Balancing | None = Balancing(),
) -> Panorama:
    """Put views from one place together into an illumination map.

    views : two or more; where their rotation is None it is found from what they have in common
    size : rows of the map; as fine as the middle of the finest view unless given
    matching : how orientations are found, where they are not told
    balancing : of exposure and vignetting; None takes the pictures as they are
    A few views without enough in common with the others are left out, with a note.
    Raises NotAPanorama for a lone view, for pixels that are no light, and, by name, for too many views that have too
    little in common.
    """
    views = list(views)
    refuse_unusable(views)
    if size is not None and size < STEP:
        raise ValueError(f"size is {size}; expected at least {STEP} rows")
    error, notes, remarks = None, [], []
    if any(view.rotation is None for view in views):
        adjusted = orient(views, matching)
        notes += _doubts_of_matching(adjusted)
        remarks += _remarks_of_matching(views, adjusted)
        views, error = list(adjusted.views), adjusted.error
    rows = _rows(views) if size is None else size
    taken = tuple(views)
    balanced = compare(views) if balancing is None else balance(views, balancing)
    # Views that only touch and need no gain are right as they are: what their rims differ by is what they show.
    if balancing is not None and not (balanced.touching and balanced.unchanged):
        views = list(even(balanced.views, RIM if balanced.touching else 0.0))
    seen = sight(views, SEAM_ROWS)
    seams = lay_seams(views, seen)
    light = blend(views, seams, rows)
    angles = light.mapping.solid_angles(rows)
    codes = np.zeros(angles.shape, np.uint8) if light.clipped is None else light.clipped
    unseen, saturated = (float(angles[codes == code].sum()) for code in (OUTSIDE, SATURATED))
    if balanced.disagreement > UNLIKE:
        notes.append(
            f"views differ by {100 * np.expm1(balanced.disagreement):.0f} % where they overlap; check their "
            "orientation (yaw to the right, pitch up, roll clockwise), and whether the light changed"
        )
    elif seams.disputed > SHARE_DISPUTED * 4 * np.pi:
        notes.append(
            f"{seams.disputed:.2g} sr are shown differently by views that overlap; something moved, or they were not "
            "taken from one place"
        )
    return Panorama(
        light, taken, balanced.gains, balanced.vignetting, unseen, saturated, error, balanced.disagreement,
        tuple(notes), (*remarks, *balanced.remarks),
    )  # fmt: skip


def _rows(views: Sequence[PanoramaView]) -> int:
    finest = np.pi * max(view.focal_length for view in views)
    return int(min(max(STEP * round(finest / STEP), STEP), LARGEST))


def _doubts_of_matching(adjusted: Adjusted) -> list[str]:
    notes, found = [], adjusted.views[0]
    if adjusted.left_out:
        names = ", ".join(view.name for view in adjusted.left_out)
        notes.append(
            f"{names}: left out, too little in common with the others to tell the orientation; tell it with "
            "--orientations, a table of these alone is enough"
        )
    pixels = adjusted.error * found.focal_length
    if pixels > LOOSE:
        notes.append(
            f"matches differ by {pixels:.1f} pixels; were the views taken from one place, the lens turned about itself?"
        )
    if abs(np.log(adjusted.scale)) > 0.1:
        notes.append(
            f"the focal length comes out {adjusted.scale:.3g} times as long as told; check the field of view, and "
            "that the pictures are not cropped"
        )
    return notes


def _remarks_of_matching(given: Sequence[PanoramaView], adjusted: Adjusted) -> list[str]:
    if not adjusted.apart:
        return []
    told = {view.name for view in given if view.rotation is not None}
    first = next(view.name for view in adjusted.views if view.name not in told)
    return [
        f"{', '.join(sorted(told))}: as told, for they have too little in common with the others to be matched; their "
        f"yaw counts from {first}, which looks towards −Z, and their pitch from the horizon that was found"
    ]
