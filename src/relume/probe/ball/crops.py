"""Crops of one bracket, cut out by hand and so of different sizes, laid on one another by the ball that they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np

from relume.errors import BallNotFound, NotABracket
from relume.image.colour import luminance
from relume.image.photograph import Photograph
from relume.probe.ball.edge_tracking import refined
from relume.probe.ball.outline import find_outline
from relume.probe.ball.rim_selection import picked_rim, placed_rim
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.probe.clipped_light import linear

ALIKE = 0.05
"""Difference in radius between crops of one ball, drawn by one hand."""
COMPARED = 96
"""Rows and columns of the balls when they are compared."""
SAME_BALL = 0.5
"""Correlation of edges inside the ball, below which two crops show different balls: 0.79 and more between neighbouring
exposures of three real sets, 0.37 at most between the sets."""


def on_one_frame(photographs: Sequence[Photograph], picked: Outline | None = None) -> tuple[Photograph, ...]:
    """Photographs of different sizes, each moved and scaled so that its ball covers that of the first.

    picked : the ball's rim in the first of them, followed there; None to have it found

    What lay beyond a crop is marked `outside`. Focal lengths are left out: EXIF holds that of the whole picture.
    Raises BallNotFound, naming the first, where none shows a ball, and NotABracket for crops of different balls.
    """
    outlines = _outlines(photographs, picked)
    _require_one_ball(photographs, outlines)
    width, height = photographs[0].size
    first, moved = outlines[0], []
    for photograph, outline in zip(photographs, outlines, strict=True):
        matrix = _onto(outline, first.centre, first.radius)
        pixels = cv2.warpAffine(photograph.pixels, matrix, (width, height), flags=cv2.INTER_LINEAR)
        covered = np.ones(photograph.pixels.shape[:2], np.float32)
        if photograph.outside is not None:
            covered[photograph.outside] = 0
        outside = cv2.warpAffine(covered, matrix, (width, height), flags=cv2.INTER_LINEAR) < 0.999
        moved.append(replace(photograph, pixels=pixels, outside=outside, focal_length=None))
    return tuple(moved)


def _onto(outline: Outline, centre: tuple[float, float], radius: float) -> np.ndarray:
    """The (2, 3) matrix that lays a ball on a circle; cv2 counts from pixel centres, outlines from corners."""
    scale = radius / outline.radius
    shift = np.array(centre) - 0.5 - scale * (np.array(outline.centre) - 0.5)
    return np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])


def _outlines(photographs: Sequence[Photograph], picked: Outline | None) -> list[Outline]:
    """The ball in each: crops of one ball are alike in size, and one that comes out otherwise is sought again there."""
    lights = [linear(replace(photograph, exposure=None)).radiance for photograph in photographs]
    found: list[Outline | None] = []
    refusal: BallNotFound | None = None
    for index, (photograph, light) in enumerate(zip(photographs, lights, strict=True)):
        try:
            if picked is not None and index == 0:
                found.append(picked_rim(light, picked, photograph.name))
            else:
                found.append(placed_rim(light, find_outline(light, photograph.name), (None,)))
        except BallNotFound as error:
            refusal = refusal or error
            found.append(None)
    seen = [outline for outline in found if outline is not None]
    if not seen:
        assert refusal is not None
        raise BallNotFound(
            f"{photographs[0].name}: no mirrored ball found in it, nor in the others; crop them alike",
            refusal.candidates, refusal.radiance, "or pick its rim in the first with --pick X,Y,RADIUS",
        )  # fmt: skip
    usual = float(np.median([outline.radius for outline in seen]))
    if picked is not None and found[0] is not None:
        usual = found[0].radius
    alike = [abs(each.radius / usual - 1) < ALIKE if each is not None else False for each in found]
    # Hands cut a ball out in the middle alike: places are kept from the middles of the crops.
    middles = [np.array(photograph.size) / 2 for photograph in photographs]
    places = [np.array(each.centre) - middle for each, middle, near in zip(found, middles, alike, strict=True)
              if each is not None and near]  # fmt: skip
    usual_place = np.median(places, axis=0) if places else np.zeros(2)
    result = []
    for outline, light, middle, near in zip(found, lights, middles, alike, strict=True):
        if outline is None or not near:
            # In a dark frame lamps outshine the rim; what little of it is seen is looked for where the others have it.
            x, y = (middle + usual_place).tolist()
            outline = refined(light, outline_of_circle(x, y, usual))
        result.append(outline)
    return result


def _require_one_ball(photographs: Sequence[Photograph], outlines: Sequence[Outline]) -> None:
    """Refuse crops whose balls mirror different places; raises NotABracket."""
    edges = [_edges(photograph, outline) for photograph, outline in zip(photographs, outlines, strict=True)]
    order = np.argsort([float(np.mean(photograph.pixels)) for photograph in photographs]).tolist()
    # Neighbouring exposures show most of the same.
    for one, other in pairwise(order):
        if np.corrcoef(edges[one], edges[other])[0, 1] < SAME_BALL:
            raise NotABracket(
                f"{photographs[one].name} does not show the same ball and place as {photographs[other].name}; give "
                "crops of one bracket, or pick the rim in the first (--pick X,Y,RADIUS, in a shot file pick = [x, y, "
                "radius]) if it was missed"
            )


def _edges(photograph: Photograph, outline: Outline) -> np.ndarray:
    """How strong the edges inside the ball are, (N,), each at most as strong as most."""
    middle = COMPARED / 2
    matrix = _onto(outline, (middle, middle), 0.96 * middle)
    shrink = outline.radius / middle
    light = photograph.pixels.astype(np.float32)
    if shrink > 1:
        light = cv2.GaussianBlur(light, (0, 0), 0.4 * shrink)
    ball = cv2.warpAffine(light, matrix, (COMPARED, COMPARED), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    level = np.log(luminance(ball) + 0.01 * np.iinfo(photograph.pixels.dtype).max)
    level = cv2.GaussianBlur(level.astype(np.float32), (0, 0), 1.5)
    strength = np.hypot(*np.gradient(level))
    y, x = np.mgrid[:COMPARED, :COMPARED] + 0.5
    inside = strength[np.hypot(x - middle, y - middle) < 0.85 * 0.96 * middle]
    return np.minimum(inside / max(float(inside.mean()), 1e-9), 3.0) + 1e-6 * np.arange(len(inside))
