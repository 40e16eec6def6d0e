"""Finding the outline of a mirrored ball in a picture, anywhere in it.

Circles are sought in a small picture; the likeliest are fitted and followed as the ellipses of balls in perspective,
each in a picture in which it has the same size. What reflects is preferred, and what mirrors nothing is refused. The
rim is then chosen among nested curves and followed in ever finer pictures. Pixel coordinates: x right, y down, (0, 0)
the outer corner of the first pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.optimize import minimize

from relume.errors import BallNotFound
from relume.probe.ball.circle_search import SEARCH_SIDE, Circle, gradient, likeliest_circles
from relume.probe.ball.edge_tracking import evened, follow
from relume.probe.ball.mirroring import Mirroring, mirroring
from relume.probe.ball.rim_selection import settled
from relume.probe.ball.silhouette import RAYS, TELEPHOTO, Cone, Outline
from relume.probe.ball.windows import Pyramid, Window, outline_without
from relume.sphere.directions import normalised

LEAST_SEARCHED = 160
"""Longer side, in pixels, to which smaller pictures are enlarged before circles are sought."""
FITTED_AT = 96.0
"""Radius, in pixels, of the pictures in which circles are fitted and judged."""
RIVAL = 0.75
"""How well, against the best, another outline beside it must be seen to make the choice a guess."""
TRIED = 3
"""The most candidates whose rim is sought finely."""
NESTED = 0.15
"""Radii within which a circle is one of the curves near the rim, between which `outermost` chooses."""
CROSSING = 0.85
"""How well, against the best, a circle that overlaps it must be seen to make the choice a doubt."""
COVERAGE_NEEDED = 1 / 3
"""The share of the outline that must be seen: below it, curves inside rooms are taken for balls."""
SPREAD = 0.6
"""The share of the rim's parts of 30° on which an edge must be seen: a half of them are hidden by no stand."""
UNSURE = 1.5
"""Pixels of the picture in which circles are sought, by which they are off."""
OFFERED = 4
"""The most round things that a refusal offers as picks."""
LEAST_OFFERED = 0.25
"""The share of their rim that must be seen."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A round thing that might be the ball.

    outline : pixels of the whole picture
    mirror : what speaks for a mirror; see `Mirroring`
    """

    outline: Outline
    mirror: Mirroring

    @property
    def circle(self) -> Circle:
        """Its (x, y, radius)."""
        return (*self.outline.centre, self.outline.radius)

    @property
    def spread(self) -> float:
        """The share of the parts of 30° that an edge is seen on, 0 to 1: of arches it is not all round."""
        x, y = (self.outline.points - np.array(self.outline.centre)).T
        parts = np.floor(np.arctan2(y, x) * 6 / np.pi).astype(int) % 12
        return float((np.bincount(parts, minlength=12) > 0.2 * RAYS / 12).mean())

    @property
    def believable(self) -> bool:
        """Whether it may be taken without anyone looking at it."""
        return self.outline.coverage >= COVERAGE_NEEDED and self.spread >= SPREAD and self.mirror.likelihood > 0

    @property
    def worth(self) -> float:
        """Rooms mirrored in the ball hold smaller circles: among well-seen ones the larger is the ball."""
        return self.outline.coverage * float(np.sqrt(self.outline.radius)) * (0.1 + self.mirror.likelihood)


def find_outline(
    radiance: np.ndarray, name: str = "picture", focal_length: float | None = None, *, mirrored: bool = True
) -> Outline:
    """Find the ball's silhouette in a radiance map (H, W, 3).

    focal_length : pixels; where it is unknown the silhouette is taken for a circle
    mirrored : whether it has to show its surroundings; not where lamps alone light it, as on a light stage
    Raises BallNotFound, with the candidates, when no outline shows an edge along a third of its length and mirrors what
    is around it, and when two that lie apart are seen about equally well. The outline's `rivals` are curves round the
    same place that might be the rim instead.
    """
    focal = float(TELEPHOTO * radiance.shape[1]) if focal_length is None else focal_length
    pyramid = Pyramid.of(radiance, focal)
    found = candidates(pyramid, mirrored)
    seen = [each for each in found if each.believable and not any(_outdone(each, other) for other in found)]
    what = "mirrored ball found; it must be" if mirrored else "ball found; it must be"
    for best, other in ((seen[0], other) for other in seen[1:]):
        if _apart(best, other) > 0.9 and other.worth > RIVAL * best.worth:
            places = " and ".join(shown(each.circle) for each in (best, other))
            raise refusal(
                f"{name}: two balls, at x,y,radius {places} pixels; pick the one that is meant", (best, other),
                radiance, mirrored,
            )  # fmt: skip
    for chosen in seen[:TRIED]:
        result = settled(pyramid, chosen.outline)
        # A short circle is met by chance more easily than a long one.
        if result.coverage < COVERAGE_NEEDED + 0.5 / np.sqrt(2 * np.pi * result.radius):
            continue
        # Circles across it that are seen as well say that it may be the wrong one.
        x, y, radius = *result.centre, result.radius
        doubts = [
            each.circle for each in seen
            if _apart(chosen, each) <= 0.9 and each.worth > CROSSING * chosen.worth
            and np.hypot(each.circle[0] - x, each.circle[1] - y) + abs(each.circle[2] - radius) > NESTED * radius
        ]  # fmt: skip
        return replace(result, rivals=(*result.rivals, *doubts))
    raise refusal(f"{name}: no {what} round, whole in the picture and sharp", found, radiance, mirrored)


def refusal(words: str, found: Sequence[Candidate], radiance: np.ndarray, offered: bool = True) -> BallNotFound:
    """The refusal, with what is round; `offered` as picks to copy."""
    circles = tuple([each.circle for each in found if each.outline.coverage > LEAST_OFFERED][:OFFERED])
    if circles and offered:
        picks = ", ".join(f"{number}: --pick {shown(circle)}" for number, circle in enumerate(circles, 1))
        first = ", ".join(shown(circles[0]).split(","))
        words += (
            f"; round things that may be picked are {picks} (in a shot file pick = [{first}]); --picture draws them"
        )
    return BallNotFound(words, circles, radiance)


def shown(circle: Circle) -> str:
    """A circle as it is picked: x,y,radius in pixels."""
    figures = 1 if circle[2] < 50 else 0
    return ",".join(f"{value:.{figures}f}" for value in circle)


def _apart(one: Candidate, other: Candidate) -> float:
    """How far the middles of two are apart, as a share of the sum of their radii."""
    (x, y, radius), (a, b, r) = one.circle, other.circle
    return float(np.hypot(x - a, y - b)) / (radius + r)


def _outdone(candidate: Candidate, other: Candidate) -> bool:
    """Whether a thing that mirrors nothing is seen much better in the same place."""
    alike = 0.6 < candidate.circle[2] / other.circle[2] < 1.6 and _apart(candidate, other) < 0.35
    return alike and not other.mirror.likelihood and other.outline.coverage > 1.3 * candidate.outline.coverage


def candidates(pyramid: Pyramid, mirrored: bool = True) -> list[Candidate]:
    """The round things of a picture that show an edge along a part of their rim, the worthiest first."""
    width, height = pyramid.size
    longer = max(width, height)
    factor = SEARCH_SIDE / longer if longer > SEARCH_SIDE else max(1.0, LEAST_SEARCHED / longer)
    whole = pyramid.window((width / 2, height / 2), longer, factor)
    found: list[Candidate] = []
    for x, y, radius in likeliest_circles(evened(whole.light)):
        centre = whole.whole(np.array([[x, y]]))[0]
        circle = (float(centre[0]), float(centre[1]), radius / whole.factor)
        window = pyramid.about(circle, FITTED_AT)
        outline = _fitted(window, circle, UNSURE / radius)
        if outline is None:
            continue
        mirror = mirroring(window, outline) if mirrored else Mirroring.taken_for_granted()
        candidate = Candidate(outline_without(window, outline, pyramid), mirror)
        x, y, radius = candidate.circle
        if 0 < x < width and 0 < y < height and 4 < radius < 0.7 * longer and not _known(candidate, found):
            found.append(candidate)
    return sorted(found, key=lambda each: -each.worth)


def _known(candidate: Candidate, found: Sequence[Candidate]) -> bool:
    """Whether the same circle was found before."""
    x, y, radius = candidate.circle
    return any(np.hypot(x - a, y - b) + abs(radius - r) < 0.02 * radius for a, b, r in (f.circle for f in found))


def _fitted(window: Window, circle: Circle, unsure: float) -> Outline | None:
    """The ball near a guess, in pixels of the window: its rim, across which the picture changes on most of it.

    circle : the guess, pixels of the whole picture
    unsure : how far the rim may be from it, in radii: farther off are other curves
    """
    x, y = window.part(np.array(circle[:2]))
    guess = np.array([x, y, circle[2] * window.factor])
    picture = evened(window.light)
    for share in (1, 1 / 2, 1 / 4):
        blur = max(share * unsure * guess[2], 0.8)
        gx, gy = gradient(picture, blur)
        noise = float(np.median(np.abs(gx))) + 1e-6

        def unseen(c: np.ndarray, gx: np.ndarray = gx, gy: np.ndarray = gy, noise: float = noise) -> float:
            cone = cone_at((c[0], c[1], c[2]), window.size, window.focal_length)
            rim, normals = cone.silhouette(window.size, window.focal_length, RAYS // 4)
            at = [rim[:, 1] - 0.5, rim[:, 0] - 0.5]
            right, down = (map_coordinates(g, at, order=1, mode="nearest") for g in (gx, gy))
            # The logarithm lets a long weak edge outweigh a short strong one.
            return -float(np.log1p(((right * normals[:, 0] + down * normals[:, 1]) / noise) ** 2).mean())

        simplex = guess + np.vstack([np.zeros(3), np.eye(3) * blur])
        options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-3, "maxiter": 50}
        guess = minimize(unseen, guess, method="Nelder-Mead", options=options).x
    if not 4 < guess[2] < 2 * max(picture.shape):
        return None
    cone = cone_at((guess[0], guess[1], guess[2]), window.size, window.focal_length)
    return follow(picture, cone, window.focal_length, (0.02, 0.012), window.size)


def cone_at(circle: Circle, size: tuple[float, float], focal_length: float) -> Cone:
    """The cone whose silhouette lies round (x, y), `radius` pixels away across the line to the principal point.

    size : twice the principal point, pixels
    """
    x, y, radius = circle
    axis = np.array([x - size[0] / 2, y - size[1] / 2, focal_length])
    return Cone(normalised(axis), float(np.hypot(1, np.linalg.norm(axis) / max(radius, 1e-6))))
