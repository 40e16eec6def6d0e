"""Searches for the rotation between two views of a ball when no prior is given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.image.colour import luminance
from relume.probe.ball.unwrapping import BallView
from relume.probe.ball.weights import trust
from relume.sphere.directions import rotation_about, rotation_angle
from relume.sphere.mappings.mapping import LatLong, pixel_points

EDGES: Any = ("nearest", "wrap")
"""How a lat-long chart goes on beyond its edges when it is blurred."""
ROWS = 64
"""Rows of the charts that are compared: 2.8° each, and as much blur."""
SPACING = np.radians(7.5)
"""Between the turns that are tried; the blurred charts agree over more than that."""
KEPT = 6
"""Turns that are given back, the likeliest first, for the finest comparison to choose from."""


def likeliest_turns(reference: BallView, view: BallView, *, tilt: float) -> list[np.ndarray]:
    """Rotations of `view`'s world that may lay it on `reference`, the likeliest first.

    tilt : the most that the vertical may be moved, radians; turns about it are free

    Small charts of ln luminance, each less its local mean, are correlated at turns 7.5° apart, and again closer to the
    best of them.
    """
    ours, theirs = _chart(reference), _chart(view)
    directions = LatLong().directions(pixel_points(LatLong(), 24)).reshape(-1, 3)
    area = np.repeat(LatLong().solid_angles(24)[:, 0], 48)
    here, trusted = _at(ours, directions)
    weight = area * trusted
    scores: list[tuple[float, np.ndarray]] = []
    for lean in _leans(tilt):
        for heading in np.arange(0, 2 * np.pi, SPACING):
            turn = rotation_about((0, 1, 0), heading) @ lean
            scores.append((_likeness(here, weight, _at(theirs, directions @ turn)), turn))
    scores.sort(key=lambda each: -each[0])
    peaks: list[np.ndarray] = []
    for _, turn in scores:
        if all(rotation_angle(turn.T @ other) > 2.5 * SPACING for other in peaks):
            peaks.append(turn)
        if len(peaks) == 2 * KEPT:
            break
    closer = [_climbed(peak, here, weight, theirs, directions) for peak in peaks]
    closer.sort(key=lambda each: -each[0])
    return [turn for _, turn in closer[:KEPT]]


Chart = tuple[np.ndarray, np.ndarray]
"""ln luminance less its local mean, and how far it is to be believed, both (ROWS, 2·ROWS)."""


def _chart(view: BallView) -> Chart:
    directions = LatLong().directions(pixel_points(LatLong(), ROWS, 3))
    radiance, _ = view.lookup(directions)
    share = trust(view, directions)
    level = np.log(luminance(radiance) + 1e-9) * share
    cells = (ROWS, 3, 2 * ROWS, 3)
    level, share = level.reshape(cells).mean((1, 3)), share.reshape(cells).mean((1, 3))
    # Both blurs are masked ones: what is not seen does not darken what is.
    fine, coarse = (_blurred(level, share, blur) for blur in (1.0, 8.0))
    return fine - coarse, share


def _blurred(level: np.ndarray, share: np.ndarray, blur: float) -> np.ndarray:
    above, below = (np.asarray(gaussian_filter(each, blur, mode=EDGES)) for each in (level, share))
    return above / np.maximum(below, 1e-6)


def _at(chart: Chart, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points = LatLong().image_points(directions)
    column = np.minimum((points[..., 0] * 2 * ROWS).astype(int), 2 * ROWS - 1)
    row = np.minimum((points[..., 1] * ROWS).astype(int), ROWS - 1)
    return chart[0][row, column], chart[1][row, column]


def _likeness(here: np.ndarray, weight: np.ndarray, there: tuple[np.ndarray, np.ndarray]) -> float:
    both = weight * there[1]
    total = both.sum()
    ours, theirs = here - (both @ here) / total, there[0] - (both @ there[0]) / total
    scale = np.sqrt((both @ ours**2) * (both @ theirs**2))
    return float((both @ (ours * theirs)) / max(scale, 1e-12))


def _climbed(
    turn: np.ndarray, here: np.ndarray, weight: np.ndarray, theirs: Chart, directions: np.ndarray
) -> tuple[float, np.ndarray]:
    """The best turn near one, by steps that are halved."""
    score = _likeness(here, weight, _at(theirs, directions @ turn))
    step = SPACING / 2
    while step > np.radians(0.9):
        tried = [
            rotation_about(axis, sign * step) @ turn for axis in np.eye(3) for sign in (-1.0, 1.0)
        ]  # each a small turn about one axis of the world
        scores = [_likeness(here, weight, _at(theirs, directions @ each)) for each in tried]
        if max(scores) > score:
            score, turn = max(scores), tried[int(np.argmax(scores))]
        else:
            step /= 2
    return score, turn


def _leans(tilt: float) -> Sequence[np.ndarray]:
    """Rotations about horizontal axes by up to `tilt`, `SPACING` apart."""
    leans = [np.eye(3)]
    for ring in range(1, int(tilt / SPACING) + 1):
        angle = ring * SPACING
        count = max(6, int(np.ceil(2 * np.pi * np.sin(angle) / SPACING)))
        turns = 2 * np.pi * np.arange(count) / count
        leans += [rotation_about((np.cos(turn), 0.0, np.sin(turn)), angle) for turn in turns]
    return leans
