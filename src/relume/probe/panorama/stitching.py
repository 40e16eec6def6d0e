"""Photographs taken from one place in several directions, stitched into one environment map.

Miller & Hoffman (1984), §5.1: "The six pictures must be mosaiced into one seamless image."
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.panorama.balance import RIM, Balancing, balance, compare
from relume.probe.panorama.bundle_adjustment import Adjusted, orient
from relume.probe.panorama.coverage import coverage
from relume.probe.panorama.matching import Matching
from relume.probe.panorama.seams import ROWS as SEAM_ROWS
from relume.probe.panorama.seams import blend, even, lay_seams
from relume.probe.panorama.views import PanoramaView, angles_of, refuse_unusable
from relume.sphere.environment_map import EnvironmentMap

LARGEST = 4096
"""Rows of a map whose size was not given, at most: 300 MB."""
STEP = 16
"""Rows are a multiple of it, so that a map can be halved."""
LOOSE = 3.0
"""Pixels that matches differ by above which the views were not taken from one place."""
UNLIKE = 0.2
"""Median difference of ln luminance above which overlapping views do not show the same."""
SHARE_DISPUTED = 0.02
"""Of the sphere, that views may show differently before a warning is given."""


@dataclass(frozen=True, eq=False)
class Panorama:
    """An environment map with what it was put together from.

    light : lat-long; `clipped` marks what no view saw, or none measured
    views : as given, with rotation, focal length and distortion as found, without those that are left out
    gains : (views, 3), that each picture was multiplied by
    vignetting : that was taken out of all
    unseen : steradians that no view sees, filled in
    saturated : steradians that are saturated in every view that sees them
    error : root mean square of what matches differ by, radians; None where orientations were given
    disagreement : median difference of ln luminance where views overlap, balanced
    warnings : doubts about the result, a line each
    notes : what was done that nobody asked for, a line each
    """

    light: EnvironmentMap
    views: tuple[PanoramaView, ...]
    gains: np.ndarray
    vignetting: Vignetting
    unseen: float
    saturated: float
    error: float | None
    disagreement: float
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def facts(self, *, listed: bool = True) -> dict[str, object]:
        """What was found; the views as one list (`listed`) for machines, or by name, for lines."""
        views = [_view_facts(*each) for each in zip(self.views, self.gains, strict=True)]
        shown: dict[str, object] = {"views": views}
        if not listed:
            names = [str(view["name"]) for view in views]
            shown = {
                f"view {name}" if names.count(name) == 1 else f"view {number} {name}": {
                    key: _gain(value) if isinstance(value, list) else value
                    for key, value in view.items()
                    if key != "name"
                }
                for number, (name, view) in enumerate(zip(names, views, strict=True), start=1)
            }
        light = self.light.audit().facts()
        return {
            "size": f"{2 * self.light.size}×{self.light.size}",
            **shown,
            "distortion": _short(self.views[0].distortion, 5),
            "vignetting": [_short(a, 4) for a in self.vignetting.coefficients],
            "matches agree within": None if self.error is None else f"{math.degrees(self.error):.3f}°",
            "unseen sr": round(self.unseen, 4),
            "saturated sr": round(self.saturated, 6),
            **{key: light[key] for key in ("total", "irradiance", "peak", "peak direction")},
        }


def stitch_panorama(
    views: Sequence[PanoramaView],
    *,
    size: int | None = None,
    matching: Matching = Matching(),
    balancing: Balancing | None = Balancing(),
) -> Panorama:
    """Put views from one place together into an environment map.

    views : two or more; where their rotation is None it is found from what they have in common
    size : rows of the map; as fine as the middle of the finest view unless given
    matching : how orientations are found, where they are not given
    balancing : of exposure and vignetting; None takes the pictures as they are
    A few views without enough in common with the others are left out, with a note.
    Raises NotAPanorama for a lone view, for pixels that are no light, and, by name, for too many views that have too
    little in common.
    Raises ValueError for a size of too few rows.
    """
    views = list(views)
    refuse_unusable(views)
    if size is not None and size < STEP:
        raise ValueError(f"size is {size}; expected at least {STEP} rows")
    error, doubts, notes = None, [], []
    # Where the views looked.
    if any(view.rotation is None for view in views):
        adjusted = orient(views, matching)
        doubts += _doubts_of_matching(adjusted)
        notes += _notes_of_matching(views, adjusted)
        views, error = list(adjusted.views), adjusted.error
    rows = _rows(views) if size is None else size
    taken = tuple(views)
    balanced = compare(views) if balancing is None else balance(views, balancing)
    # Views that only touch and need no gain are right as they are: what their rims differ by is what they show.
    if balancing is not None and not (balanced.touching and balanced.unchanged):
        views = list(even(balanced.views, RIM if balanced.touching else 0.0))
    # Seams, and the map along them.
    seen = coverage(views, SEAM_ROWS)
    seams = lay_seams(views, seen)
    light = blend(views, seams, rows)
    angles = light.mapping.solid_angles(rows)
    codes = np.zeros(angles.shape, np.uint8) if light.clipped is None else light.clipped
    unseen, saturated = (float(angles[codes == code].sum()) for code in (OUTSIDE, SATURATED))
    # Whether the views show the same.
    if balanced.disagreement > UNLIKE:
        doubts.append(
            f"views differ by {100 * np.expm1(balanced.disagreement):.0f} % where they overlap; check their "
            "orientation (yaw to the right, pitch up, roll clockwise), and whether the light changed"
        )
    elif seams.disputed > SHARE_DISPUTED * 4 * np.pi:
        doubts.append(
            f"{seams.disputed:.2g} sr are shown differently by views that overlap; something moved, or they were not "
            "taken from one place"
        )
    return Panorama(
        light, taken, balanced.gains, balanced.vignetting, unseen, saturated, error, balanced.disagreement,
        tuple(doubts), (*notes, *balanced.remarks),
    )  # fmt: skip


def _rows(views: Sequence[PanoramaView]) -> int:
    finest = np.pi * max(view.focal_length for view in views)
    return int(min(max(STEP * round(finest / STEP), STEP), LARGEST))


def _doubts_of_matching(adjusted: Adjusted) -> list[str]:
    notes, found = [], adjusted.views[0]
    if adjusted.left_out:
        names = ", ".join(view.name for view in adjusted.left_out)
        notes.append(
            f"{names}: left out, too little in common with the others to find the orientation; give it with "
            "--orientations, a table of these alone is enough"
        )
    pixels = adjusted.error * found.focal_length
    if pixels > LOOSE:
        notes.append(
            f"matches differ by {pixels:.1f} pixels; were the views taken from one place, the lens turned about itself?"
        )
    if abs(np.log(adjusted.scale)) > 0.1:
        notes.append(
            f"the focal length comes out {adjusted.scale:.3g} times as long as given; check the field of view, and "
            "that the pictures are not cropped"
        )
    return notes


def _notes_of_matching(given: Sequence[PanoramaView], adjusted: Adjusted) -> list[str]:
    if not adjusted.apart:
        return []
    oriented = {view.name for view in given if view.rotation is not None}
    first = next(view.name for view in adjusted.views if view.name not in oriented)
    return [
        f"{', '.join(sorted(oriented))}: as given, with too little in common with the others to be matched; their "
        f"yaw counts from {first}, which looks towards −Z, and their pitch from the horizon that was found"
    ]


def _view_facts(view: PanoramaView, gain: np.ndarray) -> dict[str, object]:
    yaw, pitch, roll = (_short(math.degrees(angle), 3) for angle in angles_of(view.placed))
    across = math.degrees(2 * math.atan(view.picture.size[0] / 2 / view.focal_length))
    return {
        "name": view.name, "yaw": yaw, "pitch": pitch, "roll": roll, "field": _short(across, 3),
        "gain": [_short(float(g), 4) for g in gain],
    }  # fmt: skip


def _gain(channels: list[float]) -> str:
    """One number where all channels have the same."""
    return " ".join(f"{gain:.4f}" for gain in (channels[:1] if len(set(channels)) == 1 else channels))


def _short(value: float, digits: int) -> float:
    """Rounded, and never −0."""
    return round(value, digits) + 0.0
