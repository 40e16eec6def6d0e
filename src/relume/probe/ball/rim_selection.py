"""A ball's rim from a rough outline or a pick: chosen among nested curves in a small picture, then followed finely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.errors import warn
from relume.probe.ball.edge_tracking import REACH, evened, follow, placed, refined
from relume.probe.ball.mirror_edge import LEAST_EVIDENCE, Rim, mirror_edge
from relume.probe.ball.nested_curves import (
    APART,
    LEAST_APART,
    RIVALLING,
    along,
    curves_near,
    distance,
    lies_outside,
    outer_of,
    outermost,
)
from relume.probe.ball.rim_likelihood import likeliest_rim
from relume.probe.ball.silhouette import (
    RAYS,
    TELEPHOTO,
    Cone,
    Outline,
    cone_through,
    outline_of,
    outline_of_circle,
)
from relume.probe.ball.windows import Pyramid, outline_within, outline_without
from relume.sphere.directions import normalised

PICKED = (0.03, 0.08)
"""How far the rim is from what was picked by hand, in radii, at first and if none is seen there; at least
`LEAST_SOUGHT` pixels."""
SOUGHT_AT, SELECTED_AT, FOLLOWED_AT = 96.0, 160.0, 480.0
"""Radius of the ball, in pixels, of the pictures in which the rim is sought among nested curves, chosen, and followed:
nested curves are a pixel or two apart in the first, and noise and soft lenses blur no rim in the second."""
AS_WELL = 0.7
"""Share of the coverage that a rim keeps in the finer picture, or it is not followed there."""
LEAST_SEEN = 0.25
"""Share of the rim with an edge on it below which nothing is there: 0.23 at most in 50 places without a ball, 0.36 at
least on balls."""
PLAINLY = 1.1
"""Coverage in a finer picture, against the chosen one's, from which on a rival outside it is the rim: 1.2 of a ball on
sunlit paving, whose rim divides paving from paving; of curves that chance made it is below 1."""

AGREED, AGREED_EVIDENCE = 0.01, 2.0
"""How near the size by tape and lens must be, as a share, for less evidence to be believed: on sunlit paving, which the
ball mirrors along its rim, it is 3 to 9, and the step there was 1.5 % off."""
ALL_ROUND, MOSTLY, NEAR = 0.95, 0.75, 0.5
"""Share of the rim on which a step must lie in one ellipse to a third of a pixel to be the rim: anywhere, and within so
many pixels of where the picture stops being squeezed. Bands inside the rim reach 0.8."""
ALIKE, ELSEWHERE = 0.02, 0.06
"""How far apart, in radii, two estimates of the rim are that both see it, so that their mean is better than either, and
from which on the likelier one is another curve: blurred rims were followed up to 6 % off."""
LEAST_ALIKE = 1.5
"""Pixels up to which two estimates are alike however small the ball is: pixels and not radii limit both."""


def settled(pyramid: Pyramid, outline: Outline, sharpness: float = 1.0) -> Outline:
    """The ball's rim near an outline that was found roughly: chosen among nested curves, then followed finely.

    pyramid : of the whole picture
    outline : within about 2 % of one of the curves, pixels of the whole picture
    sharpness : of the picture: the share of the usual sizes at which it is looked at
    """
    # Where the rim is faint it stands out of what is mirrored in a small picture, and is placed in a finer one.
    for radius in (sharpness * SOUGHT_AT, sharpness * SELECTED_AT):
        if radius > sharpness * SOUGHT_AT and outline.radius <= sharpness * SOUGHT_AT:
            break
        window = pyramid.about((*outline.centre, outline.radius), radius)
        picture, rough = evened(window.light), outline_within(window, outline)
        cone = cone_through(rough.points, window.size, window.focal_length)
        first = follow(picture, cone, window.focal_length, REACH[:2], window.size) or rough
        outline = outline_without(window, outermost(picture, first, window.focal_length, window.size), pyramid)
    if sharpness == 1:
        return _decided(pyramid, _finely(pyramid, outline))
    # A blurred rim is steepest on its darker side; in linear light, and small, it is where it is.
    window = pyramid.about((*outline.centre, outline.radius), sharpness * SOUGHT_AT)
    small = placed(window.light, outline_within(window, outline), window.focal_length, window.size)
    return replace(outline_without(window, small, pyramid), rivals=outline.rivals)


def picked_rim(
    radiance: np.ndarray, outline: Outline, name: str = "picture", focal_length: float | None = None
) -> Outline:
    """The rim near one that was picked by hand, placed in linear light; the pick as it is, with a warning, without one.

    radiance : (H, W, 3)
    outline : as picked, within 8 % of its radius of the rim
    focal_length : pixels; a circle is followed where it is unknown
    Raises ValueError for a pick that lies outside the picture.
    """
    size = (radiance.shape[1], radiance.shape[0])
    x, y, radius = *outline.centre, outline.radius
    if outline.cut(size) > 0.9:
        raise ValueError(
            f"{name}: the pick x,y,radius {x:.0f},{y:.0f},{radius:.0f} lies outside the picture of {size[0]}×{size[1]} "
            "pixels; count x from its left and y from its top"
        )
    focal = float(TELEPHOTO * size[0]) if focal_length is None else focal_length
    pyramid = Pyramid.of(radiance, focal)
    window = pyramid.about((x, y, radius), SELECTED_AT)
    picture, rough = evened(window.light), outline_within(window, outline)
    for reach in PICKED:
        curves = curves_near(picture, rough, window.focal_length, window.size, reach)
        chosen = outer_of(curves)
        if curves.support[chosen] >= LEAST_SEEN:
            found = outline_without(window, along(curves, chosen, window.focal_length, window.size), pyramid)
            return placed_rim(radiance, _finely(pyramid, found), (focal,))
    warn(
        f"{name}: no rim is seen near what was picked, x,y,radius {x:.0f},{y:.0f},{radius:.0f}, so it was taken as it "
        "is; `relume probe --picture` draws it"
    )
    return outline


def _finely(pyramid: Pyramid, outline: Outline) -> Outline:
    """A rim that was found in a reduced picture, followed in a finer one where that shows it as well."""
    if outline.radius <= SELECTED_AT:
        return outline
    window = pyramid.about((*outline.centre, outline.radius), FOLLOWED_AT, 1.1)
    cone = cone_through(window.part(outline.points), window.size, window.focal_length)
    finer = follow(evened(window.light), cone, window.focal_length, REACH[1:], window.size)
    if finer is None or finer.coverage < AS_WELL * outline.coverage:
        return outline
    found = replace(outline_without(window, finer, pyramid), rivals=outline.rivals)
    moved = np.hypot(found.centre[0] - outline.centre[0], found.centre[1] - outline.centre[1])
    near = moved + abs(found.radius - outline.radius) < REACH[1] * outline.radius
    return found if near else outline


def _decided(pyramid: Pyramid, outline: Outline) -> Outline:
    """The one of an outline and its rivals outside it that a finer picture shows plainly best; itself where none is.

    The rim's edge is as sharp as the lens, while stains, joints and noise, which make chance curves in a small picture,
    come apart in a finer one. Curves farther in are reflections, however well they are seen.
    """
    if outline.radius <= SELECTED_AT or not outline.rivals:
        return outline
    window = pyramid.about((*outline.centre, outline.radius), FOLLOWED_AT, 1.1)
    picture, least = evened(window.light), max(APART * outline.radius, LEAST_APART)
    seen = [outline]
    for x, y, radius in outline.rivals:
        across, down = window.part(np.array([x, y])).tolist()
        rough = outline_of_circle(across, down, radius * window.factor)
        cone = cone_through(rough.points, window.size, window.focal_length)
        found = follow(picture, cone, window.focal_length, REACH[1:], window.size)
        if found is not None:
            seen.append(outline_without(window, found, pyramid))
    places = [np.array([*each.centre, each.radius]) for each in seen]
    outside = [each for each, at in zip(seen, places, strict=True) if lies_outside(at - places[0])]
    best = max(outside, key=lambda each: each.coverage, default=outline)
    if best.coverage < PLAINLY * outline.coverage:
        return outline
    circles = [(float(x), float(y), float(radius)) for x, y, radius in places]
    rivals = tuple(
        circle for circle, each in zip(circles, seen, strict=True)
        if each.coverage > RIVALLING * best.coverage
        and distance(np.array(circle), np.array([*best.centre, best.radius])) > least
    )  # fmt: skip
    return replace(best, rivals=rivals)


def placed_rim(
    radiance: np.ndarray, outline: Outline, lenses: Sequence[float | None], expected: float | None = None
) -> Outline:
    """The rim near an outline that follows edges, placed as precisely as the picture shows it.

    radiance : (H, W, 3)
    lenses : focal lengths, pixels, of which the one that explains the rim best is taken; None for a circle
    expected : its radius in pixels by tape measure and lens

    A step all round is the rim. Else it is where the picture plainly stops being squeezed, and without that where its
    step or its root is; and where whole profiles are likeliest, between the two where they are much alike.
    """
    width = radiance.shape[1]
    pyramid = Pyramid.of(radiance, 1.0)
    least = LEAST_EVIDENCE if expected is None else AGREED_EVIDENCE
    steps = [(refined(radiance, outline, lens, ()), lens) for lens in lenses]
    stepped, lens = max(steps, key=lambda each: len(each[0].points))
    followed, share = stepped, len(stepped.points) / RAYS
    if share > ALL_ROUND:
        return stepped
    rims = [(mirror_edge(replace(pyramid, focal_length=each or TELEPHOTO * width), outline, least), each)
            for each in lenses]  # fmt: skip
    seen = [(rim, each) for rim, each in rims if rim is not None]
    if expected is not None:
        seen = [
            (_with_tape(rim, expected), each) for rim, each in seen
            if _off(rim, expected) < AGREED or rim.evidence > LEAST_EVIDENCE
        ]  # fmt: skip
    if seen:
        best, lens = max(seen, key=lambda each: each[0].evidence)
        followed = best.outline
        # A step that most of the rim shows in one ellipse is placed to less than a tenth of a pixel.
        apart = float(np.hypot(*np.subtract(followed.centre, stepped.centre))) + abs(followed.radius - stepped.radius)
        if share > MOSTLY and apart < NEAR:
            return stepped
    # Where the picture plainly stops being squeezed another curve is no likelier.
    alike = max(ALIKE, LEAST_ALIKE / followed.radius) if seen else ALIKE
    elsewhere = alike if seen else ELSEWHERE
    return _likelier(pyramid, followed, outline, lens or TELEPHOTO * width, expected, alike, elsewhere)


def _likelier(
    pyramid: Pyramid, followed: Outline, start: Outline, lens: float, expected: float | None, alike: float,
    elsewhere: float,
) -> Outline:  # fmt: skip
    """A rim that was followed, moved to where whole profiles are likeliest if those see it too.

    start : from which it was followed
    alike, elsewhere : radii up to which the mean of the two is taken, and from which on the likeliest is another curve
    """
    size, rim = pyramid.size, likeliest_rim(replace(pyramid, focal_length=lens), start)
    if rim is None:
        return followed
    likeliest = rim.outline
    apart = float(np.hypot(*np.subtract(likeliest.centre, followed.centre))) + abs(likeliest.radius - followed.radius)
    # Tape measure that bears out the one and not the other decides.
    off = [abs(float(np.log(each.radius / expected))) if expected else 0 for each in (likeliest, followed)]
    if apart > elsewhere * followed.radius or off[0] >= AGREED > off[1]:
        return followed
    if apart > alike * followed.radius:
        return replace(likeliest, rivals=followed.rivals, focal_length=followed.focal_length)
    cones = [cone_through(each.points, size, lens) for each in (likeliest, followed)]
    half = sum(cone.half_angle for cone in cones) / 2
    middle = Cone(normalised(cones[0].axis + cones[1].axis), float(1 / np.sin(half)))
    return replace(outline_of(middle, size, lens, coverage=followed.coverage), rivals=followed.rivals,
                   focal_length=followed.focal_length)  # fmt: skip


def _off(rim: Rim, expected: float) -> float:
    return abs(float(np.log(rim.outline.radius / expected)))


def _with_tape(rim: Rim, expected: float) -> Rim:
    """The rim without rivals of another size, where tape and lens say its own."""
    if _off(rim, expected) >= AGREED:
        return rim
    kept = tuple(each for each in rim.outline.rivals if abs(float(np.log(each[2] / expected))) < AGREED)
    return replace(rim, outline=replace(rim.outline, rivals=kept))
