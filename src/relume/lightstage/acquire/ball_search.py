"""Finding one ball or several in the pictures of a light stage, which no picture lights all round."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from relume.errors import BallNotFound
from relume.probe.ball.candidates import SEARCH_SIDE, candidates, coverage_needed, guesses
from relume.probe.ball.outline import JUDGED_AT, find_outline
from relume.probe.ball.rim_selection import settled
from relume.probe.ball.silhouette import TELEPHOTO, Outline
from relume.probe.ball.windows import Pyramid

_SHRINKS = (1, 2, 4)
"""By which pictures are made smaller, one after the other, until the ball is found."""
_TRIED = 6
"""The most round things in which lamps are looked for where several balls are sought."""
_ALIKE = np.radians(30)
"""The angle within which balls that stand apart show one lamp: it is that of a lamp twice as far away as they are from
each other. What is round and no ball shows it anywhere."""
_CLOSELY = np.radians(5)
"""That angle where the rims are hardly seen, as among far lamps in a dark room."""
_FAINT = 0.15
"""The least share of a rim that is seen, even so."""


def find_ball(
    pictures: Iterable[np.ndarray],
    name: str = "pictures",
    focal_length: float | None = None,
    others: Iterable[np.ndarray] = (),
) -> Outline:
    """The silhouette of the ball in pictures from one place, which their mean shows best: no picture lights it all.

    pictures : (H, W, 3) scene-linear
    focal_length : pixels; the silhouette is taken for a circle where it is unknown
    others : pictures from the same place under other light, such as the room's, where the mean does not show the ball
    Raises BallNotFound; give a circle (`outline_of_circle`) or a mask (`outline_of_mask`) then.
    """
    failure: BallNotFound | None = None
    total = _sum_of(pictures, name)
    # One picture's rim may be blurred, which is seen when it is small; the mean's is as sharp as any.
    tries = [(total, (1,)), *((picture, _SHRINKS) for picture in others if picture.shape == total.shape)]
    for picture, shrinks in tries:
        for shrink in shrinks:
            try:
                return _found_small(picture.astype(np.float32), shrink, name, focal_length)
            except BallNotFound as error:
                failure = failure or error
    assert failure is not None
    raise failure


def find_balls(
    pictures: Iterable[np.ndarray],
    count: int,
    lamps: Callable[[Outline], np.ndarray],
    name: str = "pictures",
    focal_length: float | None = None,
    others: Iterable[np.ndarray] = (),
    taken: Sequence[Outline] = (),
) -> tuple[Outline, ...]:
    """The silhouettes of several balls in the same pictures, from left to right.

    lamps : the directions (N, 3) towards the lamps of some of the pictures, as a ball of an outline shows them; raises
        BallNotFound where it shows none
    taken : of balls in the same pictures that are known
    pictures, focal_length, others : as of `find_ball`
    Of all that is round the best seen are taken that lie apart and show the lamps alike. Raises BallNotFound.
    """
    total = _sum_of(pictures, name)
    known = [(outline, lamps(outline)) for outline in taken]
    sought = [total, *(each for each in others if each.shape == total.shape)]
    seen = [_round_things(picture, lamps, focal_length) for picture in sought]
    # Rims that are seen are believed first; where the lamps light none, what the balls show has to agree closely.
    for clear, apart in ((True, _ALIKE), (False, _CLOSELY)):
        for things in seen:
            shown = [(outline, directions) for outline, directions, sharp in things if sharp or not clear]
            for chosen in combinations(shown, count):
                if all(_of_one_light(*pair, apart) for pair in combinations((*known, *chosen), 2)):
                    return tuple(sorted((outline for outline, _ in chosen), key=lambda outline: outline.centre))
    raise BallNotFound(
        f"{name}: {count + len(taken)} balls are sought in the same pictures, and not so many round things are seen "
        "whole in them that lie apart and show the same lamps; give each ball its circle"
    )


def _round_things(
    picture: np.ndarray, lamps: Callable[[Outline], np.ndarray], focal_length: float | None
) -> list[tuple[Outline, np.ndarray, bool]]:
    """The outlines of what is round in a picture and shows lamps, the best seen first, with the directions to these
    and whether the rim is seen well enough to be believed."""
    focal = float(TELEPHOTO * picture.shape[1]) if focal_length is None else focal_length
    pyramid = Pyramid.of(picture.astype(np.float32), focal)
    found: list[tuple[Outline, np.ndarray, bool]] = []
    for candidate in candidates(pyramid, guesses(pyramid), JUDGED_AT[0], mirrored=False):
        if candidate.outline.coverage < _FAINT or len(found) == _TRIED:
            continue
        sharp = candidate.believable
        # Also a rim of which the lamps light little: as roughly as it was found it is 0.8 % of its radius too small.
        outline = settled(pyramid, candidate.outline)
        if any(_touch(outline, other) for other, _, _ in found):
            continue
        try:
            needed = coverage_needed(min(outline.radius, JUDGED_AT[0]))
            found.append((outline, lamps(outline), sharp and outline.coverage >= needed))
        except BallNotFound:  # round, and no ball
            continue
    return found


def _of_one_light(one: tuple[Outline, np.ndarray], other: tuple[Outline, np.ndarray], apart: float) -> bool:
    """Whether two balls do not touch and show the lamps of most pictures within an angle of each other."""
    chords = np.linalg.norm(one[1] - other[1], axis=1)
    return not _touch(one[0], other[0]) and float(np.median(chords)) < 2 * np.sin(apart / 2)


def _touch(one: Outline, other: Outline) -> bool:
    (x, y), (a, b) = one.centre, other.centre
    return float(np.hypot(x - a, y - b)) < 0.9 * (one.radius + other.radius)


def _sum_of(pictures: Iterable[np.ndarray], name: str) -> np.ndarray:
    """The sum (H, W, 3) of pictures, none brighter than another; raises BallNotFound for several sizes."""
    total: np.ndarray | None = None
    for picture in pictures:
        if total is not None and picture.shape != total.shape:
            raise BallNotFound(f"{name}: pictures of several sizes show no ball in one place; crop them alike")
        # Each counts alike, and no lamp outshines the rim.
        scaled = np.minimum(picture / max(float(np.percentile(picture, 99)), 1e-12), 1)
        total = scaled.astype(np.float64) if total is None else total + scaled
    if total is None:
        raise ValueError("no pictures to find a ball in; give at least one")
    return total


def _found_small(picture: np.ndarray, shrink: int, name: str, focal_length: float | None) -> Outline:
    """The ball's outline in a picture, found in one whose pixels are means of shrink² of its own."""
    if shrink == 1:
        return find_outline(picture, name, focal_length, mirrored=False)
    rows, columns = picture.shape[0] // shrink, picture.shape[1] // shrink
    if min(rows, columns) < SEARCH_SIDE:
        raise BallNotFound(f"{name}: too small to be shrunk")
    blocks = picture[: rows * shrink, : columns * shrink].reshape(rows, shrink, columns, shrink, 3)
    small = blocks.mean(axis=(1, 3))
    found = find_outline(small, name, focal_length and focal_length / shrink, mirrored=False)
    x, y = found.centre
    axes = found.semi_axes and (found.semi_axes[0] * shrink, found.semi_axes[1] * shrink)
    return replace(
        found,
        points=found.points * shrink,
        centre=(x * shrink, y * shrink),
        radius=found.radius * shrink,
        semi_axes=axes,
        rivals=tuple((a * shrink, b * shrink, r * shrink) for a, b, r in found.rivals),
    )
