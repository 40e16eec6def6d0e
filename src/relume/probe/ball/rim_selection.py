"""Which of several nested curves is a ball's rim: the outermost that is seen nearly as well as the best.

Near its rim a ball shows bright walls and lamps squeezed into bands that run along it, and their edges are often
stronger than the rim's own. So every edge near a first outline counts alike, not only the strongest along each normal,
and ellipses are tried a little inside and outside. Reflections lie within the rim, and what is behind the ball follows
no ellipse round it: among those that are seen nearly equally well the outermost is the rim.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter1d

from relume.errors import warn
from relume.probe.ball.edge_tracking import REACH, evened, follow, profiles, refined, robust_cone
from relume.probe.ball.silhouette import RAYS, TELEPHOTO, Outline, cone_through, outline_of, outline_of_circle
from relume.probe.ball.windows import Pyramid, outline_within, outline_without

SOUGHT = 0.1
"""How far inside and outside a first outline ellipses are tried, in radii: bands of reflections lie in there."""
LEAST_SOUGHT = 4.0
"""Pixels: the same at least."""
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
SEEN = 0.7
"""Support, against the best, below which a curve is not one that competes."""
NEARLY = 0.72
"""Support, against the best, from which on an ellipse farther out is the rim: 0.78 to 1 in photographs of a ball under
a bright ceiling, whose rims then agree to half a pixel; round other balls nothing farther out reaches 0.65."""
FARTHER = 0.4
"""Support that an ellipse farther out has at least: in a noisy dark picture curves reach 0.37 by chance."""
RIVALLING = 0.9
"""Support, against the chosen one, from which on another ellipse makes the choice a doubt."""
PLAINLY = 1.1
"""Coverage in a finer picture, against the chosen one's, from which on a rival outside it is the rim: 1.2 of a ball on
sunlit paving, whose rim divides paving from paving; of curves that chance made it is below 1."""
APART = 0.02
"""Least distance, in radii, of ellipses that are two curves and not one seen twice; at least `LEAST_APART` pixels."""
LEAST_APART = 1.5
NEAR = 0.75
"""Pixels from an ellipse within which an edge supports it."""
STEP = 0.5
"""Pixels between samples along a normal."""
RINGING, GHOST = 3.0, 0.2
"""Pixels to either side of a strong edge, and shares of its slope: JPEG and sharpening leave ghosts of it there."""


@dataclass(frozen=True, eq=False)
class _Curves:
    """The curves near an outline.

    rim, normals : (N, 2) of the outline, and out of it
    steps : (K,) pixels along the normals
    edges : (N, K) bool, where the picture changes most
    offsets : (C, 3) pixels right, down and outward from the outline to each curve, the best supported first
    support : (C,) share of each that lies in the picture and has an edge on it
    apart : pixels by which two of them differ at least
    """

    rim: np.ndarray
    normals: np.ndarray
    steps: np.ndarray
    edges: np.ndarray
    offsets: np.ndarray
    support: np.ndarray
    apart: float


def outermost(
    picture: np.ndarray, outline: Outline, focal_length: float, size: tuple[float, float] | None = None
) -> Outline:
    """The outermost ellipse round a first outline that edges support nearly as well as any.

    picture : (H, W) luminance, `evened`
    outline : one of the nested curves; given back in its place where it is the rim itself
    focal_length : pixels
    size : twice the principal point; that of the picture, (width, height), unless given

    The `rivals` of what is given back are ellipses seen about as well, between which the picture does not decide.
    """
    size = size or (picture.shape[1], picture.shape[0])
    curves = _curves(picture, outline, focal_length, size, SOUGHT)
    chosen = _outer(curves)
    rivals = tuple(
        (outline.centre[0] + float(x), outline.centre[1] + float(y), outline.radius + float(out))
        for (x, y, out), support in zip(curves.offsets, curves.support, strict=True)
        if support > RIVALLING * curves.support[chosen]
        and _distance(np.array([x, y, out]), curves.offsets[chosen]) > curves.apart
    )
    same = _distance(curves.offsets[chosen], np.zeros(3)) < curves.apart
    found = outline if same else _along(curves, chosen, focal_length, size)
    return replace(found, rivals=rivals)


def settled(pyramid: Pyramid, outline: Outline) -> Outline:
    """The ball's rim near an outline that was found roughly: chosen among nested curves, then followed finely.

    pyramid : of the whole picture
    outline : within about 2 % of one of the curves, pixels of the whole picture
    """
    # Where the rim is faint it stands out of what is mirrored in a small picture, and is placed in a finer one.
    for radius in (SOUGHT_AT, SELECTED_AT):
        if radius > SOUGHT_AT and outline.radius <= SOUGHT_AT:
            break
        window = pyramid.about((*outline.centre, outline.radius), radius)
        picture, rough = evened(window.light), outline_within(window, outline)
        cone = cone_through(rough.points, window.size, window.focal_length)
        first = follow(picture, cone, window.focal_length, REACH[:2], window.size) or rough
        outline = outline_without(window, outermost(picture, first, window.focal_length, window.size), pyramid)
    return _decided(pyramid, _finely(pyramid, outline))


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
        curves = _curves(picture, rough, window.focal_length, window.size, reach)
        chosen = _outer(curves)
        if curves.support[chosen] >= LEAST_SEEN:
            found = outline_without(window, _along(curves, chosen, window.focal_length, window.size), pyramid)
            return refined(radiance, _finely(pyramid, found), focal, ())
    warn(
        f"{name}: no rim is seen near what was picked, x,y,radius {x:.0f},{y:.0f},{radius:.0f}, so it was taken as it "
        "is; look at it with --picture"
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
    outside = [each for each, at in zip(seen, places, strict=True) if _outside(at - places[0])]
    best = max(outside, key=lambda each: each.coverage, default=outline)
    if best.coverage < PLAINLY * outline.coverage:
        return outline
    circles = [(float(x), float(y), float(radius)) for x, y, radius in places]
    rivals = tuple(
        circle for circle, each in zip(circles, seen, strict=True)
        if each.coverage > RIVALLING * best.coverage
        and _distance(np.array(circle), np.array([*best.centre, best.radius])) > least
    )  # fmt: skip
    return replace(best, rivals=rivals)


def _curves(
    picture: np.ndarray, outline: Outline, focal_length: float, size: tuple[float, float], reach: float
) -> _Curves:
    """The best supported ellipses that lie apart from better ones, moved by up to `reach` radii."""
    radius = outline.radius
    rim, normals = cone_through(outline.points, size, focal_length).silhouette(size, focal_length)
    most = max(SOUGHT * radius, LEAST_SOUGHT)
    steps = np.arange(-1.6 * most, 1.6 * most + STEP / 2, STEP)
    edges, shown = _edges(picture, rim, normals, steps, max(0.8, radius / 300))
    most = max(reach * radius, LEAST_SOUGHT)
    moves = np.linspace(-most, most, int(np.ceil(2 * most / max(0.5, radius / 150))) | 1)
    near = np.asarray(maximum_filter1d(edges.astype(np.float32), 2 * int(NEAR / STEP) + 1, axis=1))
    offsets = np.stack(np.meshgrid(moves, moves, moves, indexing="ij"), axis=-1).reshape(-1, 3)
    offsets = offsets[np.hypot(offsets[:, 0], offsets[:, 1]) + np.abs(offsets[:, 2]) <= 1.5 * most]
    support = _supports(near, normals, steps, offsets)
    apart = max(APART * radius, LEAST_APART)
    chosen: list[int] = []
    left = support.copy()
    while len(chosen) < 12:
        best = int(np.argmax(left))
        if chosen and left[best] < SEEN * support[chosen[0]]:
            break
        chosen.append(best)
        left[_distance(offsets, offsets[best]) < apart] = -1
    # What was found before stays one of them, where it is, lest the grid of ellipses shift it.
    own = np.flatnonzero(_distance(offsets, np.zeros(3)) < apart)
    first = int(own[np.argmax(support[own])])
    if first not in chosen:
        chosen.append(first)
    # The grid is coarser than an edge is sharp: each curve is moved to where it is best seen.
    finer = np.linspace(-0.75, 0.75, 7) * (moves[1] - moves[0])
    around = np.stack(np.meshgrid(finer, finer, finer, indexing="ij"), axis=-1).reshape(-1, 3)
    places, seen = [], []
    for curve in offsets[chosen]:
        support = _supports(near, normals, steps, curve + around)
        places.append(curve + around[int(np.argmax(support))])
        seen.append(float(support.max()) / max(float(shown.mean()), 1e-6))
    kept: list[int] = []
    for curve in np.argsort(seen)[::-1]:
        if all(_distance(places[curve], places[other]) >= apart for other in kept):
            kept.append(int(curve))
    return _Curves(rim, normals, steps, edges, np.array(places)[kept], np.array(seen)[kept], apart)


def _outer(curves: _Curves) -> int:
    """The outermost that is seen nearly as well as the best, counted from the outline where that is one of them."""
    enough = curves.support >= NEARLY * curves.support[0]
    own = (_distance(curves.offsets, np.zeros(3)) < curves.apart) & enough
    first = int(np.argmax(np.where(own, curves.support, 0))) if own.any() else 0
    enough &= curves.support >= FARTHER
    farther = np.flatnonzero(enough & _outside(curves.offsets - curves.offsets[first]))
    return int(max(farther, key=lambda c: curves.offsets[c][2], default=first))


def _along(curves: _Curves, chosen: int, focal_length: float, size: tuple[float, float]) -> Outline:
    """The outline through the edges that support a curve."""
    offset = curves.offsets[chosen]
    wanted = offset[2] + curves.normals @ offset[:2]
    off = np.where(curves.edges, np.abs(curves.steps - wanted[:, None]), np.inf)
    points = (curves.rim + curves.normals * curves.steps[np.argmin(off, axis=1)][:, None])[off.min(1) < 2 * NEAR]
    if len(points) < 3:
        points = curves.rim + curves.normals * wanted[:, None]
    cone, near = robust_cone(points, size, focal_length, NEAR)
    return outline_of(cone, size, focal_length, points[near], float(near.sum()) / RAYS)


def _edges(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray, blur: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where along the normals the picture changes most, (N, K) bool, and which rim points lie in it, (N,).

    Ghosts beside stronger edges are left out.
    """
    slope = np.abs(np.gradient(profiles(gaussian_filter(picture, blur), rim, normals, steps), axis=1))
    peak = slope == maximum_filter1d(slope, 3, axis=1)
    beside = maximum_filter1d(slope, 2 * int(RINGING / STEP) + 1, axis=1)
    clear = (slope > 2 * np.median(slope, axis=1, keepdims=True)) & (slope > 0.004) & (slope > GHOST * beside)
    at = rim[:, None] + normals[:, None] * steps[None, :, None]
    inside = np.all((at > 1) & (at < np.array(picture.shape[::-1]) - 1), axis=-1)
    return peak & clear & inside, inside[:, len(steps) // 2]


def _supports(near: np.ndarray, normals: np.ndarray, steps: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The share of each ellipse that has an edge near it, (M,), of ellipses moved by `offsets` (M, 3)."""
    support = np.zeros(len(offsets), np.float32)
    for normal, row in zip(normals[::2], near[::2], strict=True):
        place = offsets[:, 2] + offsets[:, 0] * normal[0] + offsets[:, 1] * normal[1]
        support += row[np.clip(np.rint((place - steps[0]) / STEP).astype(np.intp), 0, len(steps) - 1)]
    return support / len(normals[::2])


def _outside(moved: np.ndarray) -> np.ndarray:
    """Whether ellipses moved so from another one, (…, 3), lie outside it over most of them: larger by a third of it."""
    return moved[..., 2] > 0.3 * np.hypot(moved[..., 0], moved[..., 1])


def _distance(offsets: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The most by which ellipses lie off another one, pixels: (M,)."""
    apart = offsets - other
    return np.hypot(apart[..., 0], apart[..., 1]) + np.abs(apart[..., 2])
