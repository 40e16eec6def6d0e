"""The facets of a multi-image filter in a film's frames: where each shows the ball, and how they are laid on another.

Facets look at the ball from nearly one place, each through a neutral density of its own (Waese & Debevec 2001). The
camera's own frames say where they are: rims where these are seen, the filter's symmetry where a facet is too dark for
one, and what both show of the light moves each onto the next brighter one.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from relume.errors import BallNotFound, NotABracket, warn
from relume.image.colour import luminance
from relume.probe.ball.candidates import Candidate, candidates, guesses
from relume.probe.ball.outline import JUDGED_AT, find_outline, shown
from relume.probe.ball.rim_selection import picked_rim, placed_rim
from relume.probe.ball.silhouette import TELEPHOTO, outline_of_circle
from relume.probe.ball.windows import Pyramid
from relume.probe.video.exposure_ratios import ExposureRatio, ratio_of_pixels, ratio_of_quantiles
from relume.probe.video.light_tables import LightTables, looked_up
from relume.probe.video.lookup import BallLookup, BallPlace, Circle
from relume.sphere.directions import normalised

ALIKE = 0.08
"""Radii by which the rims of facets may differ: all show one ball through one lens."""
INNER = 0.9
"""Radii up to which facets are laid on one another; farther out the ball shows much in little."""
DARKER = 0.3
"""ln of exposure by which facets must differ at least to be several exposures."""


def find_facets(frame: np.ndarray, count: int, tables: LightTables, name: str) -> tuple[Circle, ...]:
    """The rims (x, y, radius) of the ball in the `count` facets of a frame (H, W, 3) uint8, pixels.

    name : of the film, for messages
    Of facets whose rim is too dark to be seen the place follows from the others': filters are symmetric about their
    middle; a warning says so. Raises BallNotFound, with what is round, where fewer than two are seen.
    """
    light = tables.exposure[frame, np.arange(3)]
    if count == 1:
        outline = find_outline(light, name)
        rim = outline if outline.roughly else placed_rim(light, outline, [None])
        return ((*rim.centre, rim.radius),)
    pyramid = Pyramid.of(light, float(TELEPHOTO * frame.shape[1]))
    circles, found = guesses(pyramid), list[Candidate]()
    for at in JUDGED_AT:
        found += [each for each in candidates(pyramid, circles, at) if each.mirror.likelihood > 0]
    alike = _one_ball(found)
    if len(alike) < 2:
        picks = tuple(each.circle for each in found)
        raise BallNotFound(
            f"{name}: {len(alike)} of {count} facets show a ball's rim; pick the rim in each facet with --pick "
            "X,Y,RADIUS, once for each", picks, light,
        )  # fmt: skip
    rims = [placed_rim(light, each.outline, [None]) for each in alike[:count]]
    # One ball through one lens: the rim that is seen best is as large as the others.
    radius = max(rims, key=lambda rim: rim.coverage * rim.radius).radius
    result = [(*rim.centre, radius) for rim in rims]
    if len(result) < count:
        result = _completed(result, count, (frame.shape[1], frame.shape[0]), name)
    return tuple(result)


def _one_ball(found: Sequence[Candidate]) -> list[Candidate]:
    """The most candidates that are of one size and lie apart, the best seen first."""
    best: list[Candidate] = []
    for first in found:
        group: list[Candidate] = []
        same = [each for each in found if abs(np.log(each.circle[2] / first.circle[2])) < ALIKE]
        for each in sorted(same, key=lambda one: -one.outline.coverage):
            x, y, radius = each.circle
            if all(np.hypot(x - a, y - b) > 0.9 * (radius + r) for a, b, r in (one.circle for one in group)):
                group.append(each)
        if _worth(group) > _worth(best):
            best = group
    return best


def _worth(group: Sequence[Candidate]) -> float:
    return sum(each.outline.coverage * float(np.sqrt(each.circle[2])) for each in group)


def _completed(seen: list[Circle], count: int, size: tuple[int, int], name: str) -> list[Circle]:
    """The rims that are seen, and those that follow from them by the filter's symmetry."""
    middle = min(seen, key=lambda rim: np.hypot(rim[0] - size[0] / 2, rim[1] - size[1] / 2))
    radius = float(np.median([rim[2] for rim in seen]))
    outer = [np.subtract(rim[:2], middle[:2]) for rim in seen if rim is not middle]
    # Opposite each other first, then as in a mirror, then a quarter turn on: filters have one or more of these.
    images = [np.array(each) for each in ([[-1, 0], [0, -1]], [[-1, 0], [0, 1]], [[1, 0], [0, -1]], [[0, -1], [1, 0]])]
    result = list(seen)
    for place in (image @ arm for image in images for arm in outer):
        x, y = (float(at + by) for at, by in zip(middle[:2], place, strict=True))
        free = all(np.hypot(x - a, y - b) > radius for a, b, _ in result)
        if free and 0 < x < size[0] and 0 < y < size[1] and len(result) < count:
            result.append((x, y, radius))
    if len(result) < count:
        places = " and ".join(shown(rim) for rim in seen)
        raise BallNotFound(
            f"{name}: {len(seen)} of {count} facets show a ball's rim, at {places}, and where the others are does not "
            "follow from them; pick the rim in each facet with --pick X,Y,RADIUS, once for each", tuple(seen),
        )  # fmt: skip
    missing = ", ".join(shown(rim) for rim in result[len(seen) :])
    warn(
        f"{name}: the ball's rim is seen in {len(seen)} of {count} facets; the others are taken to stand as these do "
        f"on the other sides of the middle one, at {missing}; pick the rims where that is wrong",
        effect=0.01,
    )
    return result


def laid_on_another(
    frames: Sequence[np.ndarray], circles: Sequence[Circle], place: BallPlace, stops: Sequence[float] | None,
    tables: LightTables, name: str,
) -> tuple[tuple[Circle, ...], tuple[tuple[float, float], ...], tuple[ExposureRatio, ...]]:  # fmt: skip
    """Facets in the order of their exposure, each moved onto the next brighter one, and their exposures.

    frames : of the film, (H, W, 3) uint8
    circles : their rims, any order
    stops : of the densities, in the order of exposure, 0 first; found in the frames unless given
    Returns the rims, where each facet looks from (`BallPlace.view`), and ln exposure over the brightest's with errors.
    Raises NotABracket where two facets show too little of the same light, and where none is darker than another.
    """
    means = []
    for circle in circles:
        light, _, inside = _samples(frames, circle, circle, place, ((0.0, 0.0), (0.0, 0.0)), tables)
        means.append(float(light[:, inside].mean()))
    order = np.argsort(means)[::-1]
    rims, aside = [circles[number] for number in order], _asides([circles[number] for number in order])
    ratios = [ExposureRatio(np.zeros(3), np.zeros(3))]
    for number in range(1, len(rims)):
        pair = (number - 1, number)
        what = f"{name}, facet {number + 1}"
        bright, dark = (_samples(frames, rims[k], rims[number - 1], place, (aside[k], aside[number - 1]), tables)
                        for k in pair)  # fmt: skip
        if stops is not None:
            step = ExposureRatio(np.full(3, -(stops[number] - stops[number - 1]) * np.log(2)), np.zeros(3))
        else:
            step = ratio_of_quantiles(bright[0][:, bright[2]], dark[0][:, dark[2]], tables, what)
        if step.logarithm.mean() > -DARKER:
            raise NotABracket(
                f"{what}: shows {np.exp(step.logarithm.mean()):.2f} times the light of the facet before it; facets "
                "through densities differ by a half stop or more: check the number of facets, or pick their rims"
            )
        shift = _shift(bright, dark, step.logarithm, tables)
        x, y, radius = rims[number]
        rims[number] = (x + shift[0], y + shift[1], radius)
        if stops is None:
            dark = _samples(frames, rims[number], rims[number - 1], place, (aside[number], aside[number - 1]), tables)
            both = bright[1] & dark[1]
            try:
                step = ratio_of_pixels(bright[0][both], dark[0][both], tables, what)
            except NotABracket:
                warn(
                    f"{what}: few pixels show light well in it and in the next brighter one, so its exposure is known "
                    f"to {100 * step.error.mean():.0f} % only; give --stops, or film where more lamps are",
                    effect=float(step.error.mean()),
                )
        before = ratios[-1]
        ratios.append(ExposureRatio(before.logarithm + step.logarithm, np.hypot(before.error, step.error)))
    return tuple(rims), tuple(aside), tuple(ratios)


def _asides(circles: Sequence[Circle]) -> list[tuple[float, float]]:
    """Where each facet looks from: as its picture lies beside the middle one, in distances between facets."""
    places = np.array([circle[:2] for circle in circles])
    away = places - places[int(np.argmin(np.linalg.norm(places - places.mean(0), axis=1)))]
    spacing = float(np.max(np.linalg.norm(away, axis=1), initial=0.0))
    return [(float(x), float(y)) for x, y in away / (spacing or 1.0)]


def _samples(
    frames: Sequence[np.ndarray], rim: Circle, like: Circle, place: BallPlace,
    asides: tuple[tuple[float, float], tuple[float, float]], tables: LightTables,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Exposures (K, S, S, 3) of a facet where another, `like`, shows the same light.

    Also (K, S, S) where they are not beside white, which would make them too dark, and (S, S) where the ball is.
    """
    view, other = place.view(rim, asides[0]), place.view(like, asides[1])
    directions, inside = _mirrored(other.picture.size[0], like[2], place, other.world_from_pixels)
    x, y, incidence, _ = view.places(directions, 0.0)
    middle = view.picture.size[0] / 2
    lookup = BallLookup(place, rim, 2)
    left, top = (round(at) - int(middle) for at in rim[:2])
    x, y = (
        (at - middle + of - corner - 0.5).astype(np.float32) for at, of, corner in ((x, rim[0], left), (y, rim[1], top))
    )
    result = []
    for frame in frames:
        part = lookup.cut(frame)
        white = cv2.dilate((tables.belief[part.max(axis=-1)] < 1).astype(np.float32), np.ones((3, 3), np.uint8))
        # Between pixels a line would blur each facet by another amount, which at the foot of lamps is a ratio.
        light = cv2.remap(looked_up(tables.exposure, part), x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        white = cv2.remap(white, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        result.append((light, white < 0.01))
    shown = inside & (incidence > 0)
    return np.stack([light for light, _ in result]), np.stack([shown & dark for _, dark in result]), shown


def _mirrored(side: int, radius: float, place: BallPlace, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The directions (S, S, 3) that the pixels of a picture with the ball in its middle mirror, and where it is."""
    steps = (np.arange(side) + 0.5 - side / 2) / radius
    x, y = np.meshgrid(steps, steps)
    inside = np.hypot(x, y) < INNER
    # tan α of the ray; from there sin(γ + α) = D sin α.
    away = np.sqrt(place.distance**2 - 1)
    rays = normalised(np.stack([x, y, np.full_like(x, away)], axis=-1))
    sine = np.minimum(np.hypot(rays[..., 0], rays[..., 1]), 1 / place.distance)
    gamma = np.arcsin(place.distance * sine) - np.arcsin(sine)
    sideways = np.divide(rays[..., :2], np.maximum(sine, 1e-12)[..., None])
    normal = np.concatenate([np.sin(gamma)[..., None] * sideways, -np.cos(gamma)[..., None]], axis=-1)
    mirrored = rays - 2 * (rays * normal).sum(-1, keepdims=True) * normal
    return mirrored @ turn.T, inside


def _shift(
    bright: tuple[np.ndarray, np.ndarray, np.ndarray], dark: tuple[np.ndarray, np.ndarray, np.ndarray],
    ratio: np.ndarray, tables: LightTables,
) -> tuple[float, float]:  # fmt: skip
    """By how many pixels right and down the darker facet's rim lies off: translation by ECC (Evangelidis 2008).

    Of both only light that both show is looked at, so that they are one picture but for noise.
    """
    low, high = np.log(tables.black * np.exp(-ratio.mean())), np.log(tables.white)
    if high - low < 0.3:
        return 0.0, 0.0
    pictures = []
    for light, scale in ((bright[0], 1.0), (dark[0], np.exp(-ratio))):
        logarithm = np.log(np.maximum(luminance(light * scale), 1e-6))
        pictures.append(np.clip((logarithm - low) / (high - low), 0, 1).astype(np.float32))
    mask = np.broadcast_to(bright[2] & dark[2], bright[1].shape).astype(np.uint8)
    # The frames below one another: one translation is of all of them.
    side = mask.shape[2]
    first, second, used = (each.reshape(-1, side) for each in (*pictures, mask))
    if float(first[used > 0].std()) < 1e-3:
        return 0.0, 0.0
    move = np.eye(2, 3, dtype=np.float32)
    for blur in (9, 3):
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 60, 1e-5)
        try:
            _, move = cv2.findTransformECC(first, second, move, cv2.MOTION_TRANSLATION, criteria, used, blur)
        except cv2.error:  # too little contrast for it to converge
            return 0.0, 0.0
    x, y = float(move[0, 2]), float(move[1, 2])
    return (x, y) if np.hypot(x, y) < side / 8 else (0.0, 0.0)


def followed(frame: np.ndarray, circle: Circle, tables: LightTables, name: str) -> Circle:
    """A rim that was picked by hand, moved to where it is seen near there; as it is, with a warning, where none is."""
    rim = picked_rim(tables.exposure[frame, np.arange(3)], outline_of_circle(*circle), name)
    return (*rim.centre, rim.radius)
