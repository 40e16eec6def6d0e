"""Laying the views of a ball on one another: how each is turned against the first, how near the walls are.

All views are compared in the logarithm of luminance, at directions spread evenly over the sphere, weighted by how well
each view shows them. Rays to a near wall leave the ball in different places for different cameras, which looks like a
turn; so the walls' distance is found together with the turns. The first view stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.errors import BallNotFound, Doubt
from relume.image.colour import luminance
from relume.probe.ball.bundle_adjustment import NEAREST, Bundle
from relume.probe.ball.unwrapping import BallView
from relume.probe.ball.weights import EDGES, trust
from relume.sphere.directions import rotation_about, rotation_angle, rotation_from_vector
from relume.sphere.mappings.mapping import LatLong, pixel_points

TURN_LIMIT = np.radians(6)
"""The farthest that registration turns a view whose camera's place is known: what a tape measure leaves uncertain."""
TURN_HOLD = 4.0
"""How hard known places hold the turns, in misfit per radian: enough for light that shows little of them."""
LIKENESS = 0.7
"""Correlation of ln luminance below which two views do not show one light; the room's two reach 0.995, and −0.04 to
0.84 where a camera is said to have stood elsewhere."""
BRIGHTNESS_LIMIT = 0.1
"""Natural logarithm of the brightness ratio of two views above which a warning is given."""
MISPLACED = 0.5
"""What a view at a wrong place does to the light: half of it comes from wrong directions."""
HORIZON = 0.1
"""Least y of the directions that are compared: what the ball stands on is nearer than all else."""
DIRECTIONS = 20_000
"""Spread over the sphere; half of those above the horizon are compared."""
ROWS = 64
"""Rows of the charts that are compared: 2.8° each, and as much blur."""
SPACING = np.radians(7.5)
"""Between the turns that are tried; the blurred charts agree over more than that."""
KEPT = 6
"""Turns that are given back, the likeliest first, for the finest comparison to choose from."""
Chart = tuple[np.ndarray, np.ndarray]
"""ln luminance less its local mean, and how far it is to be believed, both (ROWS, 2·ROWS)."""


@dataclass(frozen=True, eq=False)
class Registration:
    """How the views of a ball lie.

    views : turned into the first one's world, their silhouettes adjusted so that they agree
    turns : (N, 3, 3) rotations of each view's world into the first one's; the first is the identity
    corrections : (N,) the angle of each turn, radians
    nearness : ball radius over the distance of what surrounds it; 0 for a lone view
    gains : (N,) how many times as bright as the first each view is
    likenesses : (N,) correlation of ln luminance with the other views; 1 for the first, and in even light
    doubts : with their effect on the light
    """

    views: tuple[BallView, ...]
    turns: np.ndarray
    corrections: tuple[float, ...]
    nearness: float
    gains: tuple[float, ...]
    likenesses: tuple[float, ...]
    doubts: tuple[Doubt, ...] = ()


class RegistrationMethod(Protocol):
    """How views are laid on one another."""

    def __call__(self, views: Sequence[BallView]) -> Registration: ...


@dataclass(frozen=True)
class KnownPlaces:
    """The cameras' places are known; each view is turned by no more than their uncertainty.

    limit : the most a view is turned, radians; 6°, what tape measure and level leave uncertain
    """

    limit: float = float(TURN_LIMIT)

    def __call__(self, views: Sequence[BallView]) -> Registration:
        return _laid(views, np.stack([np.eye(3)] * len(views)), self.limit, hold=TURN_HOLD)


@dataclass(frozen=True)
class UnknownPlaces:
    """How the views are turned against the first is unknown: it is searched for, then refined.

    tilt : the most by which a camera leant or looked down more than the first one's, radians; turns about the vertical
        are free. 45°, since photographers keep the horizon upright
    limit : the most by which a turn that was found is refined, radians; 8°, the spacing of those that are tried

    Raises BallNotFound for views that do not overlap or do not show one light.
    """

    tilt: float = float(np.radians(45))
    limit: float = float(np.radians(8))

    def __call__(self, views: Sequence[BallView]) -> Registration:
        turns = [np.eye(3)]
        for number, view in enumerate(views[1:], start=2):
            tried: list[tuple[float, np.ndarray]] = []
            for start in likeliest_turns(views[0], view, tilt=self.tilt):
                found = _laid((views[0], view), np.stack([np.eye(3), start]), self.limit, quick=True)
                tried.append((found.likenesses[1], found.turns[1]))
            likeness, turn = max(tried, key=lambda each: each[0])
            if not likeness > LIKENESS:
                raise BallNotFound(
                    f"view {number} of the ball shows nothing that fits the first one, however it is turned; "
                    "leave it out, or give where its camera stood"
                )
            turns.append(turn)
        return _laid(views, np.stack(turns), self.limit)


def spread_directions(count: int) -> np.ndarray:
    """Unit vectors (count, 3), evenly spread (a Fibonacci spiral)."""
    y = 1 - 2 * (np.arange(count) + 0.5) / count
    longitude = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - y * y)
    return np.stack([ring * np.sin(longitude), y, -ring * np.cos(longitude)], axis=1)


def _laid(
    views: Sequence[BallView], turns: np.ndarray, limit: float, *, hold: float = 0.0, quick: bool = False
) -> Registration:
    """All views turned by `turns`, then refined together; `quick` for a first look, without touching silhouettes."""
    count = len(views)
    placed = [view.turned(turn) for view, turn in zip(views, turns, strict=True)]
    if count == 1:
        return Registration(tuple(placed), turns, (0.0,), 0.0, (1.0,), (1.0,))
    directions = spread_directions(DIRECTIONS // (8 if quick else 1))
    directions = directions[directions[:, 1] > HORIZON]
    shares = np.stack([trust(view, directions) for view in placed])
    # A direction is compared where two views at least show it well.
    second = np.sort(shares, axis=0)[-2]
    chosen = second > np.quantile(second, 0.5)
    if not chosen.any():
        raise BallNotFound("the views of the ball have no direction in common that both show well; take them closer")
    directions, shares = directions[chosen], shares[:, chosen] ** 2
    problem = Bundle(placed, directions, shares / shares.sum(0), adjusting=not quick, hold=hold)
    found = problem.solved(limit)
    seen = problem.logarithms(found)
    gains = np.exp(problem.offsets(seen))
    likenesses: list[float] = [1.0]
    doubts: list[Doubt] = []
    for index in range(1, count):
        likeness = problem.likeness(seen, index)
        likenesses.append(likeness)
        far = np.any(np.abs(found.vectors[index]) > 0.98 * limit) or found.nearness > 0.98 * NEAREST
        if likeness <= LIKENESS or far:
            line = f"view {index + 1} of the ball does not fit the first one; check where its camera stood"
            doubts.append(Doubt(line, MISPLACED))
        if abs(np.log(gains[index])) > BRIGHTNESS_LIMIT:
            line = (
                f"view {index + 1} of the ball is {gains[index]:.2f} times as bright as the first; "
                "did the light or the exposure change?"
            )
            # The blend lies between the two.
            doubts.append(Doubt(line, abs(float(gains[index]) - 1) / 2))
    refined = [rotation_from_vector(v) @ turn for v, turn in zip(found.vectors, turns, strict=True)]
    return Registration(
        tuple(problem.placed(found, index) for index in range(count)),
        np.stack(refined),
        tuple(float(np.linalg.norm(v)) for v in found.vectors),
        found.nearness,
        tuple(gains.tolist()),
        tuple(likenesses),
        tuple(doubts),
    )


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


def _chart(view: BallView) -> Chart:
    directions = LatLong().directions(pixel_points(LatLong(), ROWS, 3))
    share = trust(view, directions)
    level = np.log(luminance(view.see(directions).radiance) + 1e-9) * share
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
        # Each a small turn about one axis of the world.
        tried = [rotation_about(axis, sign * step) @ turn for axis in np.eye(3) for sign in (-1.0, 1.0)]
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
