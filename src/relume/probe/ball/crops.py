"""Photographs of one ball that were cropped by hand, brought onto one frame by the ball itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.errors import BallNotFound
from relume.image.photograph import Photograph
from relume.probe.ball.edge_tracking import refined
from relume.probe.ball.outline import find_outline
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.probe.single_photograph import linear

ALIKE = 0.05
"""Difference in radius between crops of one ball, drawn by one hand."""


def on_one_frame(photographs: Sequence[Photograph]) -> tuple[Photograph, ...]:
    """Photographs of different sizes, each moved and scaled so that its ball covers that of the first.

    What lay beyond a crop is marked `outside`. Focal lengths are left out: EXIF holds that of the whole picture.
    Raises BallNotFound, naming the first, where none shows a ball.
    """
    import cv2

    outlines = _outlines(photographs)
    width, height = photographs[0].size
    first, moved = outlines[0], []
    for photograph, outline in zip(photographs, outlines, strict=True):
        scale = first.radius / outline.radius
        # cv2 counts from pixel centres, outlines from the corner of the first pixel.
        shift = np.array(first.centre) - 0.5 - scale * (np.array(outline.centre) - 0.5)
        matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
        pixels = cv2.warpAffine(photograph.pixels, matrix, (width, height), flags=cv2.INTER_LINEAR)
        covered = np.ones(photograph.pixels.shape[:2], np.float32)
        if photograph.outside is not None:
            covered[photograph.outside] = 0
        outside = cv2.warpAffine(covered, matrix, (width, height), flags=cv2.INTER_LINEAR) < 0.999
        moved.append(replace(photograph, pixels=pixels, outside=outside, focal_length=None))
    return tuple(moved)


def _outlines(photographs: Sequence[Photograph]) -> list[Outline]:
    """The ball in each: crops of one ball are alike in size, and one that comes out otherwise is sought again there."""
    lights = [linear(replace(photograph, exposure=None)).radiance for photograph in photographs]
    found: list[Outline | None] = []
    for photograph, light in zip(photographs, lights, strict=True):
        try:
            found.append(refined(light, find_outline(light, photograph.name), None, ()))
        except BallNotFound:
            found.append(None)
    seen = [outline for outline in found if outline is not None]
    if not seen:
        raise BallNotFound(f"{photographs[0].name}: no mirrored ball found in it, nor in the others; crop them alike")
    usual = float(np.median([outline.radius for outline in seen]))
    usual_place = np.median([outline.centre for outline in seen if abs(outline.radius / usual - 1) < ALIKE], axis=0)
    result = []
    for outline, light in zip(found, lights, strict=True):
        if outline is None or abs(outline.radius / usual - 1) > ALIKE:
            # In a dark frame lamps outshine the rim; what little of it is seen is looked for where the others have it.
            x, y = usual_place.tolist()
            outline = refined(light, outline_of_circle(x, y, usual))
        result.append(outline)
    return result
