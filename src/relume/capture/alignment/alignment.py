"""Bringing the frames of a hand-held bracket onto one of them, before the camera's response is known."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relume.capture.alignment.warping import Motion, move
from relume.capture.exposure.bracket import Bracket
from relume.errors import warn
from relume.image.bands import in_threads

if TYPE_CHECKING:
    from relume.capture.alignment.estimate import Estimate
    from relume.capture.alignment.pyramid import Level

UNMOVED = 0.125
"""Pixels, root mean square over the picture, below which a frame is not touched: interpolation would cost more."""
AGREEMENT = 0.3
"""Least mean cosine between edges for a frame to show the reference's scene."""
WELL = 25.0
"""Least value, of 255, that is well exposed: below it noise and rounding are large beside the detail."""
NEARLY = 0.8
"""Share of the best frame's well exposed pixels that makes another one as good; of these the middle one is taken,
which has most in common with all."""
FARTHEST = 0.4
"""Share of width or height beyond which a shift is not believed."""
NEIGHBOURS = 2
"""Frames nearest in exposure, on the reference's side, that each frame is compared with, beside the reference."""


@dataclass(frozen=True, eq=False)
class Aligned:
    """A bracket whose frames lie on one another, and how they had to be moved.

    bracket : every frame as the reference sees it; what no pixel fills is `outside`. Frames that lie well are the
        very objects that were given
    motions : a photograph each, where it holds what the reference shows; (0, 0, 0) for those not moved
    reference : index of the frame that the others were moved onto
    errors : standard error of each motion at a corner, pixels, 0 for the reference; infinite where nothing was
        estimated
    agreements : mean cosine between the directions of each frame's edges and its neighbours', 1 for the reference
    """

    bracket: Bracket
    motions: tuple[Motion, ...]
    reference: int
    errors: tuple[float, ...]
    agreements: tuple[float, ...]

    @property
    def moved(self) -> bool:
        """Whether any frame was moved."""
        return any(motion != Motion() for motion in self.motions)


def align(bracket: Bracket, *, rotation: bool = True) -> Aligned:
    """Find how each frame was shifted and turned against the best exposed one, and move it back.

    bracket : of any exposures, 8 or 16 bits; `outside` pixels do not count
    rotation : whether frames may be turned, by up to about 3°; False for a camera on a level rail

    Frames are compared with those nearest in exposure, whose motions are known, and with the reference, at edges that
    are clipped in neither. Values are matched by their ranks, since exposure keeps their order (Ward 2003 thresholds at
    one rank). A frame that needs less than an eighth of a pixel, or less than twice its error, is left alone. Nothing
    can be estimated in a frame nearly all black, or of another scene. It keeps the motion of its neighbour in exposure,
    in whole pixels, and a warning says so if any frame moved.
    """
    photographs = bracket.photographs
    if len(photographs) == 1:
        return Aligned(bracket, (Motion(),), 0, (0.0,), (1.0,))
    # Numba is imported only where a kernel is used.
    from relume.capture.alignment.pyramid import pyramid

    levels = in_threads(lambda index, _: pyramid(photographs[index]), len(photographs), chunk=1)
    reference = _best_exposed([level[0] for level in levels])
    found = _estimates(levels, reference, rotation, photographs[0].size)
    motions = tuple(_needed(estimate, photographs[0].size) for estimate in found)
    # Where no frame moved, the camera stood on a tripod, and a black frame lies as the others do.
    moved = any(motion != Motion() for motion in motions)
    for photograph, estimate in zip(photographs, found, strict=True):
        if moved and not _reliable(estimate):
            warn(
                f"{photograph.name}: too little in common with the other frames to align it; it is moved as its "
                "neighbour is; leave it out if edges are doubled"
            )
    frames = tuple(
        move(photograph, motion, whole_beside_white=index == 0)
        for index, (photograph, motion) in enumerate(zip(photographs, motions, strict=True))
    )
    return Aligned(
        replace(bracket, photographs=frames),
        motions,
        reference,
        tuple(estimate.error for estimate in found),
        tuple(estimate.agreement for estimate in found),
    )


def _best_exposed(finest: Sequence[Level]) -> int:
    well = np.array([(level.valid * (level.values > WELL)).mean() for level in finest])
    good = np.flatnonzero(well >= NEARLY * well.max())
    return int(good[np.argmin(np.abs(good - (len(finest) - 1) / 2))])


def _estimates(
    levels: Sequence[tuple[Level, ...]], reference: int, rotation: bool, size: tuple[int, int]
) -> list[Estimate]:
    """A motion for every frame, found from the reference outwards: neighbours in exposure have most in common."""
    from relume.capture.alignment.estimate import Estimate, Placed, estimate

    found = {reference: Estimate(Motion(), 0.0, 1.0)}

    def follow(order: range) -> None:
        placed = [reference]
        for index in order:
            nearest = placed[-NEIGHBOURS:][::-1]
            compared = nearest if reference in nearest else [*nearest, reference]
            partners = [Placed(levels[i], found[i].motion) for i in compared]
            found[index] = estimate(levels[index], partners, rotation=rotation)
            dx, dy = abs(found[index].motion.dx), abs(found[index].motion.dy)
            # Beyond what a hand may move it, some edge of a smooth scene was taken for another.
            if _reliable(found[index]) and dx <= FARTHEST * size[0] and dy <= FARTHEST * size[1]:
                placed.append(index)
            else:
                found[index] = replace(found[index], motion=partners[0].motion, error=np.inf)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(follow, (range(reference - 1, -1, -1), range(reference + 1, len(levels)))))
    return [found[index] for index in range(len(levels))]


def _reliable(estimate: Estimate) -> bool:
    return bool(np.isfinite(estimate.error) and estimate.agreement >= AGREEMENT)


def _needed(estimate: Estimate, size: tuple[int, int]) -> Motion:
    motion = estimate.motion
    if not np.isfinite(estimate.error) and motion.angle == 0:
        # Known no better than this: whole pixels are copied, and lamps in the darkest frame stay as sharp as they are.
        motion = Motion(float(round(motion.dx)), float(round(motion.dy)))
    least = max(UNMOVED, 2 * estimate.error if np.isfinite(estimate.error) else 0.0)
    return motion if motion.displacement(size) >= least else Motion()
