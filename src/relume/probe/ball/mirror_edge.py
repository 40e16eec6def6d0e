"""A mirrored ball's rim where it is no step: where the picture stops being squeezed.

Light that grazes a mirror goes straight on, and so what the ball shows right inside its rim is what lies right behind
it: the picture is continuous there, and its steepest change lies a pixel or two inside. But at the depth s inside a rim
of radius R it shows what lies 2·√(2s/R) aside, radians, so that hundreds of pixels of the place are squeezed into the
outermost one, all across the rim. Change across the rim is therefore of another kind inside than outside, and the
circle that divides the two best is sought (a change point, by likelihood). How far blur, pixels and the looking up
between them carry the change outward is known, and a profile that is continuous with a root inside says the same in
another way; the mean of both is taken. Pixel frame as in `silhouette`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d, uniform_filter1d

from relume.probe.ball.edge_tracking import evened, profiles
from relume.probe.ball.silhouette import Cone, Outline, cone_through, outline_of
from relume.probe.ball.windows import Pyramid, Window, outline_within, outline_without
from relume.probe.descent import least_along

BLURS = (0.3, 0.4, 0.5, 0.65, 0.85, 1.1)
"""Standard deviations of the picture's blur that are tried, pixels; at the last the edge is lost."""
PIXEL = 0.5
"""Standard deviation of what a pixel, and looking up between pixels, blur by themselves: √(1/12 + 1/6)."""
SPACING = 0.25
"""Pixels between samples of a profile; changes are differences over two of them."""
STEADY = 0.25
"""Pixels by which the middle is moved at most once the change is found, which places it better than any profile."""
INWARD, OUTWARD = -2.6, 0.3
"""Pixels by which the rim may lie off the circle that divides the changes."""
MISFIT = 0.02
"""Contrast, as a share, that no model of a profile explains: surroundings are no lines."""
LOOKED_AT = (160.0, 80.0, 40.0)
"""Radius of the ball, in pixels, of the pictures that are tried: the next where the lens or motion blurred the last."""
SHOWN, LEAST_AROUND = 1.75, 0.5
"""Radii that are looked at to all sides, and the share of what is looked at round the rim that must be pictured: of a
ball that fills its picture nothing is known to differ from it."""
ROUGH, FINE = 0.5, 0.0
"""Blur, in pixels, of the pictures in which the change is sought: the first against noise."""
REACH, LEAST_REACH = 0.035, 3.0
"""How far the rim is sought from where it was, in radii and at least in pixels, in each of `ROUNDS`."""
ROUNDS = 4
GAP, DEPTH, LEAST_DEPTH = 0.5, 0.05, 5.0
"""Pixels beside the rim that are of neither kind, and how far inside it, in radii and at least in pixels, changes are
of the ball's kind."""
WHITE, LEAST_WHITE, HIDDEN = 0.98, 0.01, 0.05
"""Share of the most light from which on a place is white, the share of a window that must be as white for that to be a
white that was cut off, and how much of a sample may be."""
LEVELS = 24
"""Classes of change, each of as many samples."""
LEAST_EVIDENCE = 12.0
"""Log-likelihood for each ray, against none of them inside, from which on the change is believed: below 10 in a garden
whose grass is as fine as what the ball shows of it, and where a ball fills its picture and little is left around it."""
LENS_STEP, SHAPE = 0.45, 1.0
"""Ln of how far a focal length that is one of a few may be off, which is the way to the next; and pixels, of which the
half is the difference between the semi-axes that a rim leaves open, 0.5."""
AS_WELL = 0.98
"""Evidence, against the best lens's, from which on another one is not excluded."""


@dataclass(frozen=True, eq=False)
class Part:
    """A window of a picture: `light` (h, w) luminance; `size`, twice its principal point, and focal length, pixels."""

    light: np.ndarray
    size: tuple[float, float]
    focal_length: float

    def moved(self, cone: Cone, by: np.ndarray) -> Cone:
        """The cone whose silhouette lies `by` pixels right, down and outward of another's."""
        rim, normals = cone.silhouette(self.size, self.focal_length)
        return cone_through(rim + normals * (by[2] + normals @ by[:2])[:, None], self.size, self.focal_length)


@dataclass(frozen=True, eq=False)
class Rim:
    """A rim that was found so.

    outline : pixels of the whole picture
    evidence : log-likelihood for each ray
    """

    outline: Outline
    evidence: float


def mirror_edge(pyramid: Pyramid, outline: Outline, least: float = LEAST_EVIDENCE) -> Rim | None:
    """The rim near an outline, where the picture stops being squeezed; None where no such change is plain.

    pyramid : of the whole picture; its focal length is taken
    outline : within a few per cent of the rim
    least : evidence that is needed
    """
    for radius in reduced_radii(outline.radius, LOOKED_AT):
        window, light = window_about(pyramid, outline, radius)
        part = Part(light, window.size, window.focal_length)
        cone = cone_through(outline_within(window, outline).points, window.size, window.focal_length)
        cone, _ = _divided(part, cone, ROUGH)
        cone, evidence = _divided(part, cone, FINE)
        if evidence <= least:
            return None
        fitted, blur = fitted_profiles(part, cone)
        if blur >= BLURS[-1]:
            continue
        fading = leaked(part, cone, float(np.sqrt(max(blur**2 - PIXEL**2, 0))))
        placed = part.moved(cone, np.array([*fitted[:2] / 2, (fitted[2] + fading) / 2]))
        found = outline_of(placed, part.size, part.focal_length, coverage=outline.coverage)
        return Rim(replace(outline_without(window, found, pyramid), rivals=outline.rivals), evidence)
    return None


def fitted_lens(radiance: np.ndarray, outline: Outline, focal_length: float) -> tuple[float, float]:
    """The focal length, pixels, whose perspective explains the rim near an outline best, and how far off it may be.

    radiance : (H, W, 3); the principal point is its middle
    focal_length : pixels, within a grid's step of the true one
    The second is a share of it, from what the difference of the semi-axes, R·(aside/f)²/2, is unsure by.
    """
    pyramid = Pyramid.of(radiance, 1.0)
    steps = np.linspace(-LENS_STEP, LENS_STEP, 7)
    middle, worth = focal_length, np.zeros(len(steps))
    for _ in range(3):
        lenses = middle * np.exp(steps)
        rims = [mirror_edge(replace(pyramid, focal_length=float(lens)), outline, 0.0) for lens in lenses]
        worth = np.array([0.0 if rim is None else rim.evidence for rim in rims])
        best = int(np.argmax(worth))
        if 0 < best < len(steps) - 1 or not worth.any():
            break
        middle = float(lenses[best])
    if not 0 < best < len(steps) - 1:
        return middle, LENS_STEP
    # The top of the parabola through the best and its neighbours.
    before, here, after = worth[best - 1 : best + 2]
    found = steps[best] + 0.5 * (steps[1] - steps[0]) * (before - after) / min(before - 2 * here + after, -1e-9)
    result = middle * float(np.exp(found))
    aside = float(np.hypot(*np.subtract(outline.centre, np.array(pyramid.size) / 2)))
    unsure = SHAPE / max(outline.radius * (aside / result) ** 2, 1e-9)
    # Those that explain it about as well are not excluded either.
    alike = np.abs(steps[worth > AS_WELL * worth[best]] - found)
    return result, min(max(unsure, float(alike.max(initial=0.0))), LENS_STEP)


def reduced_radii(radius: float, wanted: Sequence[float]) -> Iterator[float]:
    """The radii, pixels, that a ball of that radius has in ever smaller pictures.

    Never enlarged: what is put between pixels is smooth, and blurs the edge. None is much like the one before.
    """
    at = np.inf
    for each in wanted:
        if min(each, radius) <= 0.9 * at:
            at = min(each, radius)
            yield at


def window_about(pyramid: Pyramid, outline: Outline, radius: float) -> tuple[Window, np.ndarray]:
    """The picture about a ball, in which its radius is so many pixels, and its light (h, w) float64.

    The light is against its median: what stands against dark noise below is a share of the usual light, in any unit.
    """
    window = pyramid.window(outline.centre, SHOWN * outline.radius, radius / outline.radius)
    light = np.asarray(window.light, np.float64)
    return window, light / (float(np.median(light[light > 0])) if np.any(light > 0) else 1.0)


def white(light: np.ndarray) -> np.ndarray:
    """Where a window (h, w) is white, as far as it is one tone: what changes there is not known."""
    found = light >= WHITE * float(light.max(initial=0.0))
    return found if found.mean() >= LEAST_WHITE else np.zeros_like(found)


def _divided(part: Part, cone: Cone, blur: float) -> tuple[Cone, float]:
    """The cone whose silhouette best divides change of the ball's kind from that of what is behind it; the evidence."""
    picture = evened(part.light)
    picture = gaussian_filter(picture, blur) if blur else picture
    evidence, hidden = 0.0, white(part.light).astype(np.float64)
    for attempt in range(ROUNDS):
        rim, normals = cone.silhouette(part.size, part.focal_length)
        radius = float(np.sqrt(np.prod(np.ptp(rim, axis=0)))) / 2
        reach = max(REACH * radius, LEAST_REACH) / (1 if attempt == 0 and blur else 2)
        beyond = reach + max(6.0, 0.06 * radius)
        steps = np.arange(-beyond, beyond + SPACING / 2, SPACING)
        change, shown = changes(picture, rim, normals, steps)
        shown &= profiles(hidden, rim, normals, steps) < HIDDEN
        within = (steps > -max(LEAST_DEPTH, DEPTH * radius)) & (steps < -GAP)
        without = (steps > GAP) & (steps < beyond - 1)
        if shown[:, without].mean() < LEAST_AROUND:
            return cone, 0.0
        # How often change of each class is met inside and outside.
        edges = np.quantile(change[shown], np.linspace(0, 1, LEVELS + 1)[1:-1])
        level = np.searchsorted(edges, change)
        inside, outside = (
            np.bincount(level[:, part][shown[:, part]], minlength=LEVELS) + 5.0 for part in (within, without)
        )
        ratio = np.log(inside / inside.sum()) - np.log(outside / outside.sum())
        total = np.cumsum(np.where(shown, ratio[level], 0), axis=1) * SPACING
        # The ellipse that holds most of what speaks for the inside.
        best = best_move(-total, steps, normals, reach)
        cone, evidence = part.moved(cone, best[0]), -best[1] / len(rim)
        if np.abs(best[0]).max() < 0.05:
            break
    return cone, evidence


def best_move(cost: np.ndarray, steps: np.ndarray, normals: np.ndarray, reach: float) -> tuple[np.ndarray, float]:
    """By how many pixels right, down and outward an ellipse moves to where the sum of a cost (N, K) is least."""
    grid = np.linspace(-reach, reach, 9)
    starts = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    starts = starts[np.hypot(starts[:, 0], starts[:, 1]) + np.abs(starts[:, 2]) <= 1.5 * reach]
    return least_along(starts, cost, steps, normals, reach / 5, (0.02, 0.1), tried=2)


def changes(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ln of how much the picture changes over half a pixel at places along the normals, (N, K), and where it is one."""
    wide = np.concatenate([[steps[0] - SPACING], steps, [steps[-1] + SPACING]])
    seen = profiles(picture, rim, normals, wide)
    shown = profiles(np.ones_like(picture), rim, normals, wide, mode="constant") > 0.99
    return np.log(np.abs(seen[:, 2:] - seen[:, :-2]) + 0.002), shown[:, 2:] & shown[:, :-2]


def leaked(part: Part, cone: Cone, blur: float) -> float:
    """How far outward of a silhouette the rim lies by the way change fades out of it, pixels.

    blur : standard deviation of the lens's, pixels
    """
    rim, normals = cone.silhouette(part.size, part.focal_length)
    steps = np.arange(-2.0, 5.5 + SPACING / 2, SPACING)
    change, shown = changes(evened(part.light), rim, normals, steps)
    mean = 2 * (change * shown).sum(0) / np.maximum(shown.sum(0), 1)
    around = float(np.exp(np.median(mean[steps > 3])))
    used = steps <= 3
    seen, moves = mean[used], np.arange(INWARD, OUTWARD, 0.05)
    places, fading = _fading(blur)
    shape = np.interp(steps[used] - moves[:, None], places, fading)
    # The strength is what fits best; it is searched since what is around adds to it.
    strength = np.exp(seen.max() + np.linspace(-1.2, 1.2, 17)[:, None, None]) / fading.max()
    off = np.abs(np.log(strength * shape + around) - seen).mean(-1)
    return float(moves[int(np.argmin(off.min(0)))])


@cache
def _fading(blur: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean squared change (K,) over half a pixel at places (K,) outside the rim, of blurred pixels.

    Over any place what is seen at two angles differs the more the farther they are apart, as the square of a random
    walk does: each depth s adds dθ/ds ∝ s^(−1/2) of the square of what a step there would change here.
    """
    fine = 0.05
    places = np.arange(-14, 14 + fine / 2, fine)
    step = (places > 0).astype(np.float64)
    # A pixel is a box, and what is looked up between pixels a tent, which is two boxes.
    for _ in range(3):
        step = uniform_filter1d(step, round(1 / fine), mode="nearest")
    step = gaussian_filter1d(step, blur / fine, mode="nearest") if blur else step
    shift = round(SPACING / fine)
    squared = (np.roll(step, -shift) - np.roll(step, shift)) ** 2
    squared[: shift + 1] = squared[-shift - 1 :] = 0
    depth = fine * np.arange(int(10 / fine) + 1)
    weight = 2 * np.diff(np.sqrt(depth))
    return places, np.sum([w * np.roll(squared, -index) for index, w in enumerate(weight)], axis=0)


def fitted_profiles(part: Part, cone: Cone) -> tuple[np.ndarray, float]:
    """By how many pixels right, down and outward of a silhouette profiles are best explained by a continuous rim.

    The model: a line outside, and inside a polynomial of √depth that starts where the line ends; blurred.
    """
    rim, normals = cone.silhouette(part.size, part.focal_length)
    steps = np.arange(-6.0, 4.25, 0.5)
    seen = profiles(part.light, rim, normals, steps)
    shown = profiles(np.ones_like(part.light), rim, normals, steps, mode="constant").min(1) > 0.99
    varied = ((seen - seen.mean(1, keepdims=True)) ** 2).sum(1)
    moves = np.arange(INWARD - STEADY, OUTWARD + STEADY + 0.05, 0.1)
    starts = np.array([(0, 0, out) for out in np.arange(INWARD, OUTWARD, 0.1)])
    found = []
    for blur in BLURS:
        left = np.stack([((_unexplained(blur, tuple(steps - move)) @ seen.T) ** 2).sum(0) for move in moves], axis=1)
        noise = float(np.median(left[shown].min(1))) if shown.any() else 1.0
        cost = np.where(shown[:, None], np.log(left + (noise + MISFIT**2 * varied + 1e-12)[:, None]), 0)
        by, value = least_along(starts, cost, moves, normals, 0.2, (0.01, 0.05), limits=(STEADY, INWARD, OUTWARD))
        found.append((value, blur, by))
    _, blur, by = min(found, key=lambda each: each[0])
    return by, blur


@cache
def _unexplained(blur: float, steps: tuple[float, ...]) -> np.ndarray:
    """The matrix that takes from a profile at `steps` from the rim all that a continuous blurred rim explains."""
    fine = 0.05
    places = np.arange(-18, 16, fine)
    depth = np.sqrt(np.maximum(-places, 0))
    shapes = np.stack([np.ones_like(places), np.maximum(places, 0), depth, depth**2, depth**3])
    shapes = gaussian_filter1d(shapes, blur / fine, axis=1, mode="nearest")
    basis, _ = np.linalg.qr(np.stack([np.interp(steps, places, shape) for shape in shapes], axis=1))
    return np.eye(len(steps)) - basis @ basis.T
