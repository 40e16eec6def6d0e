"""The round things of a picture that might be the ball: sought, fitted as ellipses in perspective, and judged.

Circles are sought in a small picture, by the share of each on which the brightness changes across it and not along it
(a Hough transform by convolution, blind to how strong the edges are); the likeliest are fitted and followed, each in a
picture in which it has the same size, and what reflects is preferred. Pixel coordinates: x right, y down, (0, 0) the
outer corner of the first pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import fft

from relume.probe.ball.edge_tracking import LEAST_WITHIN, REACH, evened, follow
from relume.probe.ball.mirroring import Mirroring, mirroring
from relume.probe.ball.silhouette import RAYS, Cone, Outline
from relume.probe.ball.windows import Pyramid, Window, outline_without
from relume.probe.descent import down_across
from relume.sphere.directions import normalised

SEARCH_SIDE = 256
"""Longer side, in pixels, of the picture in which circles are sought; finer ones are fitted afterwards."""
COARSE = 40.0
"""Radius, in pixels, from which on circles are sought at half that size: a quarter of the time."""
LEAST_RADIUS = 5.0
"""Pixels of that picture: smaller ones are specks."""
LEAST_SHOWN = 0.4
"""The share of a circle that has to lie in the picture."""
CIRCLES = 32
"""The likeliest circles, which are fitted."""
Circle = tuple[float, float, float]
LEAST_SEARCHED = 160
"""Longer side, in pixels, to which smaller pictures are enlarged before circles are sought."""
COVERAGE_NEEDED, BY_CHANCE = 0.31, 0.7
"""The share of a large outline that must be seen: below it, curves inside rooms are taken for balls; and how much more
of a small one, over the root of its length in pixels: noise alone shows 0.27 of a rim at 30 pixels' radius."""
MOST_BEYOND = 0.1
"""The share of a ball that may lie beyond the picture: arcs along its edge are found in noise."""
MUCH_BEYOND, LEAST_CUT, PLAINLY_SEEN = 0.4, 20.0, 0.45
"""The same for a ball of more pixels' radius whose rim is seen on more of it, so that a cut one is named as that."""
SPREAD, LEAST_PARTS = 0.6, 4
"""The share of the rim's parts of 30° on which an edge must be seen: a half of them are hidden by no stand; and of how
many parts at least: all that lies in a picture cut from inside the rim."""
UNSURE = 1.5
"""Pixels of the picture in which circles are sought, by which they are off."""
CUT_OUT = (0.92, 0.95, 0.97, 0.985, 1.0, 1.02, 1.04)
"""Radii, against half of the shorter side, of circles that are tried in the middle of a picture that is nearly square:
a ball is often cut out along its rim, and little of what is behind it is left to find it by."""
SQUARE, UNSURE_CUT = 1.3, 0.015
"""How much longer the longer side of such a picture is at most, and how far off those circles are, in radii."""
LENSES = (2.2, 1.3, 0.85, 0.6)
"""Focal lengths, in widths of the picture, that are tried where it is unknown: the longest draws a ball in a corner 2 %
longer than wide, and the shortest is that of a phone's ultra-wide lens."""
ROUNDER = 0.01
"""How much longer than wide the shortest of them must draw a ball, or it is a circle."""
BENT, NEAREST = 8, 6.0
"""The likeliest that are tried so, and ball radii from which nobody photographs a ball: a large one lies far off,
behind a long lens, and is a circle wherever it is."""
SAME, ALIKE = 0.02, 0.002
"""How near two circles lie, in radii, that are one, and two from which the same rim is followed: it is looked for ten
times as far."""
CLEARER = 1.15
"""Coverage as an ellipse, against that of the circle, from which on a ball is one."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A round thing that might be the ball.

    outline : pixels of the whole picture
    mirror : what speaks for a mirror; see `Mirroring`
    spread : the share of the parts of 30° that an edge is seen on, 0 to 1, of those in the picture: of arches it is not
        all round
    focal_length : pixels, by which it was followed
    at : its radius where it was judged, pixels
    """

    outline: Outline
    mirror: Mirroring
    spread: float
    focal_length: float
    at: float

    @property
    def circle(self) -> Circle:
        """Its (x, y, radius)."""
        return (*self.outline.centre, self.outline.radius)

    @property
    def believable(self) -> bool:
        """Whether it may be taken without anyone looking at it."""
        seen = self.outline.coverage >= coverage_needed(min(self.outline.radius, self.at)) and self.spread >= SPREAD
        return seen and self.mirror.likelihood > 0

    @property
    def worth(self) -> float:
        """Rooms mirrored in the ball hold smaller circles: among well-seen ones the larger is the ball."""
        return self.outline.coverage * float(np.sqrt(self.outline.radius)) * (0.1 + self.mirror.likelihood)


def guesses(pyramid: Pyramid) -> list[tuple[Circle, float]]:
    """Circles of a picture that might be a ball's rim, pixels, and how far each may be off, in radii."""
    (width, height), longer = pyramid.size, max(pyramid.size)
    factor = SEARCH_SIDE / longer if longer > SEARCH_SIDE else max(1.0, LEAST_SEARCHED / longer)
    whole = pyramid.window((width / 2, height / 2), longer, factor)
    found = [(circle, UNSURE_CUT) for circle in _cut_out(pyramid.size)]
    for x, y, radius in likeliest_circles(evened(whole.light)):
        centre = whole.whole(np.array([[x, y]]))[0]
        found.append(((float(centre[0]), float(centre[1]), radius / whole.factor), UNSURE / radius))
    return found


def candidates(
    pyramid: Pyramid,
    circles: Sequence[tuple[Circle, float]],
    at: float,
    mirrored: bool = True,
    lens_known: bool = True,
) -> list[Candidate]:
    """The round things of a picture that show an edge along a part of their rim, the worthiest first.

    circles : the picture's `guesses`
    at : radius, in pixels, of the pictures in which they are fitted and judged
    mirrored : whether they have to show their surroundings
    lens_known : whether the pyramid's focal length is the picture's; others are tried where it is not
    """
    found: list[Candidate] = []
    tried: list[Circle] = []
    for circle, unsure in circles:
        window = pyramid.about(circle, at)
        picture = evened(window.light)
        fitted = _fitted(window, picture, circle, unsure)
        if fitted is None or _known(window.whole_circle(fitted), tried, ALIKE):
            continue
        tried.append(window.whole_circle(fitted))
        cone = cone_at(fitted, window.size, window.focal_length)
        outline = follow(picture, cone, window.focal_length, REACH[:2], window.size)
        if outline is None:
            continue
        whole = outline_without(window, outline, pyramid)
        plain = whole.radius > LEAST_CUT and whole.coverage > PLAINLY_SEEN
        if (
            4 < whole.radius < 0.7 * max(pyramid.size)
            and not _known((*whole.centre, whole.radius), [each.circle for each in found], SAME)
            and whole.cut(pyramid.size) < (MUCH_BEYOND if plain else MOST_BEYOND)
        ):
            found.append(_judged(pyramid, window, outline, whole, at, mirrored))
    found.sort(key=lambda each: -each.worth)
    if not lens_known:
        found = [_in_perspective(pyramid, each, at, mirrored) for each in found[:BENT]] + found[BENT:]
        found.sort(key=lambda each: -each.worth)
    return found


def coverage_needed(radius: float) -> float:
    """The share of an outline that must be seen where it has this radius, pixels."""
    return COVERAGE_NEEDED + BY_CHANCE / float(np.sqrt(2 * np.pi * radius))


def cone_at(circle: Circle, size: tuple[float, float], focal_length: float) -> Cone:
    """The cone whose silhouette lies round (x, y), `radius` pixels away across the line to the principal point.

    size : twice the principal point, pixels
    """
    x, y, radius = circle
    axis = np.array([x - size[0] / 2, y - size[1] / 2, focal_length])
    return Cone(normalised(axis), float(np.hypot(1, np.linalg.norm(axis) / max(radius, 1e-6))))


def _cut_out(size: tuple[int, int]) -> list[Circle]:
    """Circles in the middle of a picture that is nearly square."""
    shorter, longer = sorted(size)
    if longer > SQUARE * shorter:
        return []
    return [(size[0] / 2, size[1] / 2, share * shorter / 2) for share in CUT_OUT]


def _judged(pyramid: Pyramid, window: Window, outline: Outline, whole: Outline, at: float, mirrored: bool) -> Candidate:
    """What speaks for an outline of the window, which is `whole` in the whole picture."""
    mirror = mirroring(window, outline) if mirrored else Mirroring.taken_for_granted()
    middle, (width, height) = np.array(whole.centre), pyramid.size
    turns = 2 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    x, y = middle[:, None] + whole.radius * np.stack([np.cos(turns), np.sin(turns)])
    within = (x > 0) & (x < width) & (y > 0) & (y < height)
    parts = [np.bincount((angle % (2 * np.pi) * 6 / np.pi).astype(int) % 12, minlength=12) for angle in (
        np.arctan2(*(whole.points - middle).T[::-1]), turns[within])]  # fmt: skip
    counted = parts[1] > 0.5 * RAYS / 12
    spread = float((parts[0] > 0.2 * RAYS / 12)[counted].sum() / max(counted.sum(), LEAST_PARTS))
    return Candidate(whole, mirror, spread, pyramid.focal_length, at)


def _in_perspective(pyramid: Pyramid, candidate: Candidate, at: float, mirrored: bool) -> Candidate:
    """A candidate followed as an ellipse where a lens of some focal length explains its rim better than a circle."""
    x, y, _ = candidate.circle
    width, height = pyramid.size
    aside = np.hypot(x - width / 2, y - height / 2) / width
    best: tuple[Pyramid, Window, Outline] | None = None
    window = pyramid.about(candidate.circle, at)
    picture = evened(window.light)
    for lens in LENSES:
        if np.hypot(1, aside / lens) < 1 + ROUNDER or lens * width < NEAREST * candidate.circle[2]:
            continue
        bent = replace(pyramid, focal_length=lens * width)
        window = replace(window, focal_length=bent.focal_length * window.factor)
        place = window.part(np.array([x, y])).tolist()
        cone = cone_at((place[0], place[1], candidate.circle[2] * window.factor), window.size, window.focal_length)
        outline = follow(picture, cone, window.focal_length, (0.04, *REACH[:2]), window.size)
        least = CLEARER * candidate.outline.coverage if best is None else best[2].coverage
        if outline is not None and outline.coverage > least:
            best = bent, window, outline
    if best is None:
        return candidate
    bent, window, outline = best
    return _judged(bent, window, outline, outline_without(window, outline, bent), at, mirrored)


def _known(circle: Circle, found: Sequence[Circle], share: float) -> bool:
    """Whether the same circle was found before, to a share of its radius."""
    x, y, radius = circle
    return any(np.hypot(x - a, y - b) + abs(radius - r) < share * radius for a, b, r in found)


def _fitted(window: Window, picture: np.ndarray, circle: Circle, unsure: float) -> Circle | None:
    """The circle near a guess, in pixels of the window, across which the picture changes on most of it.

    picture : the window's, `evened`
    circle : the guess, pixels of the whole picture
    unsure : how far the rim may be from it, in radii: farther off are other curves
    """
    x, y = window.part(np.array(circle[:2]))
    guess = np.array([x, y, circle[2] * window.factor])
    turns = 2 * np.pi * np.arange(RAYS // 4) / (RAYS // 4)
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    principal = window.size[0] / 2, window.size[1] / 2
    for share in (1, 1 / 2, 1 / 4):
        blur = max(share * unsure * guess[2], 0.8)
        gx, gy = gradient(picture, blur)
        noise = np.float32(np.median(np.abs(gx)) + 1e-6)
        simplex = guess + np.vstack([np.zeros(3), np.eye(3) * blur])
        guess, _ = down_across(
            gx / noise, gy / noise, ring, window.focal_length, principal, LEAST_WITHIN, simplex, 0.05, 1e-3, 49
        )
    if not 4 < guess[2] < 2 * max(picture.shape):
        return None
    return float(guess[0]), float(guess[1]), float(guess[2])


def likeliest_circles(picture: np.ndarray) -> list[Circle]:
    """The likeliest circles (x, y, radius), in pixels of `picture` (H, W), even luminance; the likeliest first."""
    height, width = picture.shape
    largest = 0.62 * max(min(height, width), 0.75 * max(height, width))
    found = _at_scale(picture, LEAST_RADIUS, min(COARSE, largest))
    if largest > COARSE:
        half = cv2.resize(picture, (max(width // 2, 1), max(height // 2, 1)), interpolation=cv2.INTER_AREA)
        across, down = width / half.shape[1], height / half.shape[0]
        mean = float(np.sqrt(across * down))
        coarse = _at_scale(half, COARSE / 2, largest / 2)
        found += [(worth, x * across, y * down, radius * mean) for worth, x, y, radius in coarse]
    found.sort(key=lambda circle: -circle[0])
    chosen: list[Circle] = []
    for _, cx, cy, radius in found:
        if all(np.hypot(cx - x, cy - y) + abs(radius - r) > max(2.0, 0.05 * radius) for x, y, r in chosen):
            chosen.append((cx, cy, radius))
        if len(chosen) == CIRCLES:
            break
    return chosen


def _at_scale(picture: np.ndarray, least: float, largest: float) -> list[tuple[float, float, float, float]]:
    """Circles with radii between two, each with its worth: (worth, x, y, radius)."""
    # Beyond the picture is a margin in which nothing changes, for circles whose middle is near an edge.
    margin = int(0.3 * largest) + 2
    gx, gy = gradient(picture.astype(np.float32), 1.0)
    strength = gx**2 + gy**2
    # Each direction of change counts alike once it stands out of the noise.
    level = strength + np.percentile(strength, 50) + 1e-8
    height, width = (int(fft.next_fast_len(side + 2 * margin, True) or 0) for side in picture.shape)
    inner = slice(margin, margin + picture.shape[0]), slice(margin, margin + picture.shape[1])

    def spectrum(image: np.ndarray) -> np.ndarray:
        wide = np.zeros((height, width), np.float32)
        wide[inner] = image
        return np.asarray(fft.rfft2(wide))

    across, along = spectrum((gx**2 - gy**2) / level), spectrum(2 * gx * gy / level)
    shown = spectrum(np.ones_like(picture))
    y, x = np.indices((height, width))
    x, y = (x + width // 2) % width - width // 2, (y + height // 2) % height - height // 2
    distance, angle = np.hypot(x, y).astype(np.float32), np.arctan2(y, x)
    double, other = np.cos(2 * angle).astype(np.float32), np.sin(2 * angle).astype(np.float32)
    found: list[tuple[float, float, float, float]] = []
    radius = least
    while radius < largest:
        thick = max(0.8, 0.02 * radius)
        ring = np.exp(-0.5 * ((distance - np.float32(radius)) / np.float32(thick)) ** 2)
        ring /= ring.sum()
        # Change across the circle minus change along it: (g·n)² − (g·t)², with n at angle ψ.
        total = across * np.conj(np.asarray(fft.rfft2(ring * double)))
        total += along * np.conj(np.asarray(fft.rfft2(ring * other)))
        share = np.asarray(fft.irfft2(total, s=(height, width)))[inner]
        part = np.asarray(fft.irfft2(shown * np.conj(np.asarray(fft.rfft2(ring))), s=(height, width)))[inner]
        # A short arc is matched by chance more easily than a long one, and so is a small circle.
        share = np.where(part > LEAST_SHOWN, share / np.maximum(part, LEAST_SHOWN) ** 0.7, 0) * radius**0.25
        rows, columns = np.nonzero((share > 0) & (share == cv2.dilate(share, np.ones((7, 7), np.uint8))))
        for best in np.argsort(share[rows, columns])[-4:]:
            row, column = int(rows[best]), int(columns[best])
            found.append((float(share[row, column]), column + 0.5, row + 0.5, radius))
        radius += 0.95 * thick
    return found


def gradient(picture: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """The derivative of the blurred picture to the right and down."""
    soft = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), blur)
    wide = cv2.copyMakeBorder(soft, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return (wide[1:-1, 2:] - wide[1:-1, :-2]) / 2, (wide[2:, 1:-1] - wide[:-2, 1:-1]) / 2
