"""Photographs of one ball that were cropped by hand, brought onto one frame by the ball itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.image.photograph import Photograph
from relume.probe.following import refined
from relume.probe.lone_photograph import linear
from relume.probe.outline import find_outline
from relume.probe.silhouette import Outline


def on_one_frame(photographs: Sequence[Photograph]) -> tuple[Photograph, ...]:
    """Photographs of different sizes, each moved and scaled so that its ball covers that of the first.

    What lay beyond a crop is marked `outside`. Focal lengths are left out: EXIF tells that of the whole picture.
    Raises BallNotFound, naming the photograph.
    """
    import cv2

    outlines = [_outline(photograph) for photograph in photographs]
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


def _outline(photograph: Photograph) -> Outline:
    radiance = linear(replace(photograph, exposure=None)).radiance
    return refined(radiance, find_outline(radiance, photograph.name))
