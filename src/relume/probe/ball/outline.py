"""Finding the outline of a mirrored ball in a picture, anywhere in it.

Of the round things that are seen, the one that reflects is taken, and what mirrors nothing is refused. The rim is then
chosen among nested curves and followed in ever finer pictures; where the focal length is unknown, and a ball beside the
middle is plainly no circle, its ellipse gives it. Pixel coordinates: x right, y down, (0, 0) the outer corner of the
first pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.errors import BallNotFound, warn
from relume.probe.ball.candidates import SPREAD, Candidate, Circle, candidates, coverage_needed, guesses
from relume.probe.ball.rim_likelihood import sharpest_rim
from relume.probe.ball.rim_selection import settled
from relume.probe.ball.silhouette import TELEPHOTO, Outline
from relume.probe.ball.windows import Pyramid

JUDGED_AT = (96.0, 40.0)
"""Radius, in pixels, of the pictures in which round things are judged: where nothing is seen in the first, lens or
motion may have blurred it, and the second is sharp again."""
ROUGHLY_AT, ROUGHLY = 24.0, 1.8
"""The same of the last, in which places without a ball look like one too, and the evidence of whole profiles that is
needed in it: 1.9 to 3.3 of a ball blurred by 3 and 4 % of its radius, of one 24 pixels wide and of one on a wide stand;
1.6 at most of arches, rooms and streets."""
BLURRED = 0.02
"""How precisely a rim is found in the second, in radii: 1 to 2.3 % where defocus is 1 to 3 % of the radius."""
RIVAL = 0.75
"""How well, against the best, another outline beside it must be seen to make the choice a guess."""
TRIED = 3
"""The most candidates whose rim is sought finely."""
NESTED = 0.15
"""Radii within which a circle is one of the curves near the rim, between which `outermost` chooses."""
SAME = 0.03
"""Radii within which a rim that was followed finely is the one that was judged roughly."""
CROSSING = 0.85
"""How well, against the best, a circle that overlaps it must be seen to make the choice a doubt."""
PLAIN = 0.5
"""Coverage from which on a round thing is one that a photographer meant."""
TAPE, UNEXPECTED = 0.08, 0.5
"""Standard deviation of the size that tape measure and lens predict, as a share of it: 5 % each of the tape, the lens
and the ball's own size. What is of another size keeps this much of its worth: EXIF of a crop predicts a wrong one."""
EXPECTED_SEEN = 0.25
"""Share of a rim of the expected size that must be seen, as of a picked one: 0.23 at most where no ball is."""
RIVALS_TRIED, SURELY, MUCH_LIKELIER = 3, 2.4, 2.0
"""Candidates across the worthiest whose rims are tried too, and the evidence from which on one of them is the rim, at
least and against the worthiest's own: 2.8 to 5 of rims, where curves of a room in the ball had 0.8 to 1.1.
"""
LESSER = 0.5
"""Worth, against the best, below which a thing is another one, tried only when the best has no rim at either sharpness:
on sunlit paving a chance circle a ninth as large had one in the first picture, and the ball in the second."""
OFFERED = 4
"""The most round things that a refusal offers as picks."""
LEAST_OFFERED = 0.25
"""The share of their rim that must be seen."""


def find_outline(
    radiance: np.ndarray,
    name: str = "picture",
    focal_length: float | None = None,
    *,
    mirrored: bool = True,
    expected: float | None = None,
) -> Outline:
    """Find the ball's silhouette in a radiance map (H, W, 3).

    focal_length : pixels; where it is unknown the silhouette is taken for a circle, unless an ellipse is seen plainly
    expected : its radius in pixels by tape measure and lens; what is as large is preferred, and nothing else refused
    mirrored : whether it has to show its surroundings; not where lamps alone light it, as on a light stage
    Raises BallNotFound, with the candidates, when no outline shows an edge along a third of its length and mirrors what
    is around it, and when two that lie apart are seen about equally well. The outline's `rivals` are curves round the
    same place that might be the rim instead.
    """
    # What is round, judged in ever smaller pictures.
    focal = float(TELEPHOTO * radiance.shape[1]) if focal_length is None else focal_length
    pyramid = Pyramid.of(radiance, focal)
    circles, found = guesses(pyramid), list[Candidate]()
    for at in JUDGED_AT:
        found = candidates(pyramid, circles, at, mirrored, focal_length is not None) or found
        seen = [each for each in found if each.believable and not any(_outdone(each, other) for other in found)]
        seen.sort(key=lambda each: -_worth(each, expected))
        _require_one(seen, expected, name, radiance, mirrored)
        alike = [
            each for each in seen if at == JUDGED_AT[-1] or _worth(each, expected) > LESSER * _worth(seen[0], expected)
        ]
        likelier = _likelier(pyramid, alike[0], found) if alike and mirrored else None
        alike = alike if likelier is None else [likelier, *alike]
        result = _chosen(pyramid, alike, found, expected, at / JUDGED_AT[0], likelier)
        if result is not None:
            # The mean of a stage's pictures is as sharp as they are, though lamps light little of its rim.
            if at < JUDGED_AT[0] and mirrored:
                warn(
                    f"{name}: the ball's rim is blurred or lost in noise, and was placed to about "
                    f"{100 * BLURRED:.0f} % of its radius only; photograph it sharp, or pick its rim",
                    effect=2 * BLURRED,
                )
            return result
    # What only a very small picture shows, and else why nothing is taken.
    roughly = _roughly(pyramid, circles, focal_length is not None, expected) if mirrored else None
    if roughly is not None:
        return roughly
    what = "mirrored ball found; it must be" if mirrored else "ball found; it must be"
    words = f"{name}: no {what} round, whole in the picture and sharp"
    dull = [each for each in found if each.spread >= SPREAD and each.outline.coverage >= PLAIN]
    if dull and not dull[0].mirror.likelihood:
        words += (
            f", and what is round at {shown(dull[0].circle)} shows nothing of the place, as matte and scratched balls, "
            "fruit and lamps do"
        )
    raise refusal(words, found, radiance, mirrored)


def _roughly(
    pyramid: Pyramid, circles: Sequence[tuple[Circle, float]], lens_known: bool, expected: float | None
) -> Outline | None:
    """The likeliest of what is seen in a very small picture; None where no rim there is likely."""
    found = candidates(pyramid, circles, ROUGHLY_AT, lens_known=lens_known)
    # A white lamp is round and has a rim as likely as any.
    seen = [
        each for each in found
        if each.believable and not each.mirror.white and not any(_outdone(each, other) for other in found)
    ]  # fmt: skip
    seen.sort(key=lambda each: -_worth(each, expected))
    rims = [
        (sharpest_rim(replace(pyramid, focal_length=each.focal_length), each.outline), each) for each in seen[:TRIED]
    ]
    rim, best = max(rims, key=lambda pair: pair[0].evidence, default=(None, None))
    if rim is None or best is None or rim.evidence < ROUGHLY:
        return None
    focal_length = None if best.focal_length == pyramid.focal_length else best.focal_length
    return replace(rim.outline, focal_length=focal_length, roughly=True)


def refusal(words: str, found: Sequence[Candidate], radiance: np.ndarray, offered: bool = True) -> BallNotFound:
    """The refusal, with what is round; `offered` as picks to copy."""
    circles = tuple([each.circle for each in found if each.outline.coverage > LEAST_OFFERED][:OFFERED])
    if not circles or not offered:
        return BallNotFound(words, circles, radiance)
    picks = ", ".join(f"{number}: --pick {shown(circle)}" for number, circle in enumerate(circles, 1))
    remedy = f"round things that may be picked are {picks}; --picture draws them"
    return BallNotFound(words, circles, radiance, remedy)


def shown(circle: Circle) -> str:
    """A circle as it is picked: x,y,radius in pixels."""
    figures = 1 if circle[2] < 50 else 0
    return ",".join(f"{value:.{figures}f}" for value in circle)


def _worth(candidate: Candidate, expected: float | None) -> float:
    """How much speaks for a candidate, with what is known of its size."""
    if expected is None:
        return candidate.worth
    off = np.log(candidate.outline.radius / expected) / TAPE
    return candidate.worth * (UNEXPECTED + (1 - UNEXPECTED) * float(np.exp(-0.5 * off**2)))


def _require_one(
    seen: Sequence[Candidate], expected: float | None, name: str, radiance: np.ndarray, mirrored: bool
) -> None:
    """Refuse a picture in which two things that lie apart are seen about equally well."""
    for best, other in ((seen[0], other) for other in seen[1:]):
        if _apart(best, other) > 0.9 and _worth(other, expected) > RIVAL * _worth(best, expected):
            places = " and ".join(shown(each.circle) for each in (best, other))
            raise refusal(
                f"{name}: two balls, at x,y,radius {places} pixels; pick the one that is meant", (best, other),
                radiance, mirrored,
            )  # fmt: skip


def _chosen(
    pyramid: Pyramid,
    seen: Sequence[Candidate],
    found: Sequence[Candidate],
    expected: float | None,
    sharpness: float,
    likelier: Candidate | None,
) -> Outline | None:
    """The rim of the worthiest candidate that has one.

    seen : what may be taken, the worthiest first
    found : all that is round, among which those seen as well raise doubts
    sharpness : share of the usual size at which rims are followed
    likelier : one of them of which less of the rim need be seen
    """
    for chosen in seen[:TRIED]:
        bent = replace(pyramid, focal_length=chosen.focal_length)
        result = settled(bent, chosen.outline, sharpness)
        # Where the fine rim is the one that was judged, what was seen of it then counts: noise hides rims in detail.
        near = _off(result, chosen.circle) < SAME * result.radius
        coverage = max(result.coverage, chosen.outline.coverage if near else 0)
        # A short circle is met by chance more easily than a long one, and one of the expected size seldom.
        as_expected = expected is not None and abs(np.log(result.radius / expected)) < TAPE
        if coverage < (
            EXPECTED_SEEN if as_expected or chosen is likelier else coverage_needed(min(result.radius, chosen.at))
        ):
            continue
        # Circles across it that are seen as well say that it may be the wrong one.
        worth = CROSSING * _worth(chosen, expected)
        doubts = [
            each.circle for each in found
            if each.mirror.likelihood > 0 and _apart(chosen, each) <= 0.9 and _worth(each, expected) > worth
            and _off(result, each.circle) > NESTED * result.radius
        ]  # fmt: skip
        focal_length = None if chosen.focal_length == pyramid.focal_length else chosen.focal_length
        return replace(result, coverage=coverage, rivals=(*result.rivals, *doubts), focal_length=focal_length)
    return None


def _likelier(pyramid: Pyramid, best: Candidate, found: Sequence[Candidate]) -> Candidate | None:
    """One across the worthiest whose rim is much likelier than its own, at that rim, where little of that is seen."""
    if best.outline.coverage >= PLAIN:
        return None
    across = [each for each in found if each is not best and _apart(best, each) <= 0.9 and each.mirror.likelihood > 0]
    rims = [
        sharpest_rim(replace(pyramid, focal_length=each.focal_length), each.outline)
        for each in (best, *across[:RIVALS_TRIED])
    ]
    first = max(range(len(rims)), key=lambda number: rims[number].evidence)
    if not first or rims[first].evidence < max(SURELY, MUCH_LIKELIER * rims[0].evidence):
        return None
    return replace(across[first - 1], outline=rims[first].outline)


def _off(outline: Outline, circle: Circle) -> float:
    """The most by which a circle lies off an outline, pixels."""
    x, y, radius = circle
    return float(np.hypot(x - outline.centre[0], y - outline.centre[1])) + abs(radius - outline.radius)


def _apart(one: Candidate, other: Candidate) -> float:
    """How far the middles of two are apart, as a share of the sum of their radii."""
    (x, y, radius), (a, b, r) = one.circle, other.circle
    return float(np.hypot(x - a, y - b)) / (radius + r)


def _outdone(candidate: Candidate, other: Candidate) -> bool:
    """Whether a thing that mirrors nothing is seen much better in the same place."""
    alike = 0.6 < candidate.circle[2] / other.circle[2] < 1.6 and _apart(candidate, other) < 0.35
    return alike and not other.mirror.likelihood and other.outline.coverage > 1.3 * candidate.outline.coverage
