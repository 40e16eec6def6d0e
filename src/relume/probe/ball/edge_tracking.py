"""Following a ball's rim along its normals, to a tenth of a pixel.

Right inside the rim the ball shows all that lies behind it, squeezed: at the depth s below the rim the light from an
angle ∝ √s off the blind direction. So across the rim the brightness is level or slopes outside, and starts as a root
inside; where the ball reflects nearly all, there is no step at all, only this root.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d, map_coordinates

from relume.image.colour import luminance
from relume.probe.ball.silhouette import RAYS, TELEPHOTO, Cone, Grazing, Outline, cone_through, outline_of
from relume.sphere.directions import normalised

OUTLIER = 1.0
"""Pixels beyond which a point of the rim is not believed; an edge is seen to a few tenths."""
PRECISE = 0.3
"""The same for the places that were found in linear light: what the ball mirrors near its rim draws whole stretches of
it inward by a pixel or two, and only a narrow gate separates them from the rim itself."""
HELD, LEAST_HELD = 0.006, 1.0
"""The most, in radii and at least in pixels, by which placing in linear light moves any part of the rim."""
AGREED, FREE, LEAST_FREE = 0.4, 0.03, 2.5
"""Share of the rim that lies on one ellipse so precisely from which on it may move farther, and how far: a ball that
reflects all has no step at its rim, and its strongest edge lies up to two pixels inside."""
REACH = (0.02, 0.012, 0.008)
"""How far the rim is sought on either side of the guess, in radii, pass by pass."""
ARC, LEAST_ARC = 3.0, 2.5
"""Standard deviation of the arc over which a rim is averaged: points half a degree apart, and at least pixels."""
LASTING = 1.4
"""Mean change along an arc, against its spread, from which on it is an edge: noise alone gives 0.27 of a rim at
30 pixels' radius, 0.19 at 96 and 0.09 at 160."""
LEAST_WITHIN = 0.6
"""Share of the rim inside the picture of which the seen part is counted at least: less of it is met by chance."""
STEP, INSIDE, OUTSIDE, MOVE = 0.5, 6.0, 4.0, 2.0
"""Pixels: between the samples of a profile, its lengths inside and outside the rim, and the most it is moved."""
MOST_FOLLOWED = 4
"""Lengths of the picture's longer side: an outline of more is no rim that the picture shows."""
BLURS = (0.3, 0.4, 0.5, 0.65, 0.85, 1.1, 1.5)
"""Standard deviations, in pixels, of the blur of lens and pixel that are tried; the picture decides for one."""


def evened(image: np.ndarray) -> np.ndarray:
    """Luminance (H, W) made even over many stops, so that an edge in the dark counts as much as one in the light."""
    positive = np.maximum(image, np.percentile(image[image > 0], 1) if np.any(image > 0) else 1.0)
    logarithm = np.log(positive)
    low, high = np.percentile(logarithm, [1, 99.5])
    return np.clip((logarithm - low) / max(high - low, 1e-3), 0, 1.2)


def follow(
    picture: np.ndarray,
    cone: Cone,
    focal_length: float,
    reaches: tuple[float, ...] = REACH,
    size: tuple[float, float] | None = None,
) -> Outline | None:
    """The rim near a cone's silhouette; None where too little of it is seen.

    picture : (H, W) luminance, `evened`
    reaches : how far to look on either side, in radii, for each pass
    size : twice the principal point; that of the picture, (width, height), unless given
    """
    size = size or (picture.shape[1], picture.shape[0])
    points, coverage = np.empty((0, 2)), 0.0
    for reach in reaches:
        rim, normals = cone.silhouette(size, focal_length)
        radius = float(np.sqrt(np.prod(np.ptp(rim, axis=0)))) / 2
        if radius > MOST_FOLLOWED * max(picture.shape):
            return None  # a cone that is nearly flat, as a lens of a few pixels makes it
        half = max(reach * radius, 2.0)
        places = _edges(picture, rim, normals, half, max(0.8, radius / 300))
        points = (rim + normals * places[:, None])[np.isfinite(places)]
        if len(points) < RAYS // 10:
            return None
        cone, near = robust_cone(points, size, focal_length, max(OUTLIER, 0.5 * half))
        within = np.all((rim > 1) & (rim < np.array(picture.shape[::-1]) - 1), axis=1).mean()
        points, coverage = points[near], float(near.sum()) / RAYS / max(float(within), LEAST_WITHIN)
    return outline_of(cone, size, focal_length, points, min(coverage, 1.0)) if reaches else None


def refined(
    radiance: np.ndarray,
    outline: Outline,
    focal_length: float | None = None,
    reaches: tuple[float, ...] = REACH[1:],
) -> Outline:
    """The rim near an outline, placed in linear light, where a pixel that the rim cuts mixes both sides by their areas.

    radiance : (H, W, 3)
    outline : within about 1 % of its radius of the rim
    focal_length : pixels; a circle is followed where it is unknown
    reaches : how far to look for edges first, in radii, for each pass; none for an outline that follows them already

    The outline is given back as it was where too little of the rim is seen.
    """
    bright = np.asarray(luminance(radiance), np.float64)
    size = (bright.shape[1], bright.shape[0])
    focal = float(TELEPHOTO * size[0]) if focal_length is None else focal_length
    cone = cone_through(outline.points, size, focal)
    found = follow(evened(bright), cone, focal, reaches) if reaches else outline
    return outline if found is None else replace(placed(bright, found, focal, size), rivals=outline.rivals)


def placed(bright: np.ndarray, outline: Outline, focal_length: float, size: tuple[float, float]) -> Outline:
    """An outline that follows edges, placed in linear light; itself where too little of the rim is seen.

    bright : (H, W) luminance, linear
    focal_length : pixels
    size : twice the principal point
    """
    cone, found, bright = cone_through(outline.points, size, focal_length), outline, np.asarray(bright, np.float64)
    start, _ = cone.silhouette(size, focal_length)
    for _ in range(2):
        rim, normals = cone.silhouette(size, focal_length)
        places, sure = _placed(bright, rim, normals)
        points = (rim + normals * places[:, None])[sure]
        if len(points) < RAYS // 10:
            break
        cone, near = robust_cone(points, size, focal_length, PRECISE)
        # Few points that happen to lie on one ellipse must not carry the whole rim away.
        share, least = (HELD, LEAST_HELD) if near.sum() < AGREED * RAYS else (FREE, LEAST_FREE)
        if np.abs(_off(start, cone, size, focal_length)).max() > max(share * found.radius, least):
            break
        found = outline_of(cone, size, focal_length, points[near], found.coverage)
    return found


def robust_cone(
    points: np.ndarray, size: tuple[float, float], focal_length: float, tolerance: float
) -> tuple[Cone, np.ndarray]:
    """The cone that most points (N, 2) lie on within `tolerance` pixels, and which they are, (N,) bool."""
    rays = Grazing.of(points, size, focal_length)
    # Cones through three points each, all at once.
    near = rays.near(rays.planes(_threes(len(points))), focal_length, tolerance)
    best = near[int(np.argmax(near.sum(1)))]
    if best.sum() < 3:
        best = np.ones(len(points), bool)
    plane = rays.plane(best)
    for _ in range(5):
        near = rays.near(plane, focal_length, tolerance)
        if near.sum() < 3 or (near == best).all():
            break
        best = near
        plane = rays.plane(best)
    return rays.cone(plane), best


def _threes(count: int) -> np.ndarray:
    """A hundred choices of three of so many points, (100, 3), none twice."""
    first, second, third = (
        np.random.default_rng(1998).random((3, 100)) * np.array([[count], [count - 1], [count - 2]])
    ).astype(np.intp)
    # Each is counted among those that are left.
    second += second >= first
    third += third >= np.minimum(first, second)
    third += third >= np.maximum(first, second)
    return np.stack([first, second, third], axis=1)


def _off(points: np.ndarray, cone: Cone, size: tuple[float, float], focal_length: float) -> np.ndarray:
    """How far outside a cone's silhouette points (N, 2) lie, pixels, to first order."""
    offset = points - np.array(size) / 2
    rays = normalised(np.concatenate([offset, np.full((len(points), 1), focal_length)], axis=1))
    # The chord between directions keeps its digits where their cosine is 1 to all of them.
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(rays - cone.axis, axis=-1) / 2, 1))
    return (angle - cone.half_angle) * focal_length / rays[:, 2] ** 2


def _edges(picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, half: float, blur: float) -> np.ndarray:
    """Where along its normal each rim point has its edge, pixels outward; NaN where none is clear."""
    steps = np.arange(-2 * half, 2 * half + 0.25, 0.5)
    slope, lasting = slopes(picture, rim, normals, steps, blur)
    # The guess draws the choice towards itself, so that a stronger edge inside the ball does not win.
    drawn = slope * lasting * np.exp(-0.5 * (steps / half) ** 2)
    best, rows = np.argmax(drawn[:, 1:-1], axis=1) + 1, np.arange(len(rim))
    before, here, after = slope[rows, best - 1], slope[rows, best], slope[rows, best + 1]
    bend = np.minimum(before - 2 * here + after, -1e-12)
    edge = steps[best] + 0.5 * np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
    clear = (here >= before) & (here >= after) & (here > 1.5 * np.median(slope, axis=1)) & (here > 0.002)
    clear &= lasting[rows, best]
    at = rim + normals * steps[best][:, None]
    clear &= np.all((at > 0) & (at < np.array(picture.shape[::-1])), axis=1)
    return np.where(clear, edge, np.nan)


def slopes(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray, blur: float
) -> tuple[np.ndarray, np.ndarray]:
    """How fast the blurred picture changes along the normals, (N, K) ≥ 0, and whether it does so all along the rim.

    A rim changes alike over some degrees, while noise and texture change to and fro: a mean over an arc counts where it
    exceeds `LASTING` of its own spread.
    """
    # The picture is sharpest across the rim; along it noise is averaged over an arc.
    raw = np.gradient(profiles(softened(picture, blur), rim, normals, steps), axis=1)
    spacing = float(np.hypot(*(np.roll(rim, -1, axis=0) - rim).T).mean())
    arc = max(ARC, LEAST_ARC / spacing)
    around = 2 * int(4 * arc + 0.5) + 1
    # The rim closes on itself: as many rays as the mean reaches are laid on at either end.
    whole = np.arange(-(around // 2), len(rim) + around // 2) % len(rim)
    raw = raw[whole]
    mean, square = (
        cv2.GaussianBlur(each, (1, around), arc)[around // 2 : around // 2 + len(rim)] for each in (raw, raw**2)
    )
    spread = np.sqrt(np.maximum(square - mean**2, 1e-12))
    return np.abs(mean), np.abs(mean) > LASTING * spread


def softened(picture: np.ndarray, blur: float) -> np.ndarray:
    """A picture (H, W) blurred by a Gaussian of so many pixels, to four of its standard deviations."""
    side = 2 * int(4 * blur + 0.5) + 1
    return np.asarray(cv2.GaussianBlur(picture, (side, side), blur, borderType=cv2.BORDER_REFLECT))


def _placed(bright: np.ndarray, rim: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where along its normal each rim point has the rim, pixels outward, and whether that is sure.

    The model, a line outside and a + b·√depth inside, blurred, is fitted at every place that is tried; its residual is
    a fixed quadratic form of the profile, so all points are done at once.
    """
    steps = np.arange(-INSIDE, OUTSIDE + STEP / 2, STEP)
    seen = profiles(bright, rim, normals, steps)
    around = profiles(np.ones_like(bright), rim, normals, steps, mode="constant").min(1) > 0.99
    varied = seen - seen.mean(1, keepdims=True)
    total = np.maximum((varied**2).sum(1), 1e-300)
    moves = np.arange(-MOVE, MOVE + 0.05, 0.1)
    best: tuple[float, np.ndarray] | None = None
    for blur in BLURS:
        model = _Model.of(blur)
        residuals = np.stack([model.unexplained(steps - move) @ seen.T for move in moves])
        left = (residuals**2).sum(1).T / total[:, None]
        misfit = float(np.median(left.min(1)[around])) if around.any() else 0.0
        if best is None or misfit < best[0]:
            best = misfit, left
    assert best is not None
    left = best[1]
    lowest = np.clip(np.argmin(left, axis=1), 1, len(moves) - 2)
    rows = np.arange(len(rim))
    before, here, after = left[rows, lowest - 1], left[rows, lowest], left[rows, lowest + 1]
    place = moves[lowest] + 0.1 * np.clip(0.5 * (before - after) / np.maximum(before - 2 * here + after, 1e-12), -1, 1)
    # A profile that is alike wherever the rim is put says nothing.
    dips = here < 0.25 * np.minimum(left[:, 0], left[:, -1])
    return place, around & dips & (np.abs(place) < MOVE - 0.15)


@dataclass(frozen=True, eq=False)
class _Model:
    """What a profile across a blurred rim is made of, in columns: level and slope outside, level and root inside."""

    places: np.ndarray
    shapes: np.ndarray

    @staticmethod
    def of(blur: float) -> _Model:
        fine = 0.05
        places = np.arange(-INSIDE - MOVE - 8, OUTSIDE + MOVE + 8, fine)
        outside = (places > 0).astype(np.float64)
        shapes = np.stack([outside, outside * places, 1 - outside, np.sqrt(np.maximum(-places, 0))])
        return _Model(places, np.asarray(gaussian_filter1d(shapes, blur / fine, axis=1, mode="nearest")))

    def unexplained(self, steps: np.ndarray) -> np.ndarray:
        """The matrix that takes from a profile at `steps` from the rim all that the rim explains."""
        columns = [np.interp(steps, self.places, shape) for shape in self.shapes]
        basis, _ = np.linalg.qr(np.stack(columns, axis=1))
        return np.eye(len(steps)) - basis @ basis.T


def profiles(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray, mode: str = "nearest"
) -> np.ndarray:
    """The picture (H, W) at `steps` pixels outward along the normals of rim points (N, 2): (N, len(steps))."""
    (x, y), (across, down) = rim.T[:, :, None] - 0.5, normals.T[:, :, None]
    at = np.stack([y + down * steps, x + across * steps])
    return np.asarray(map_coordinates(picture, at, order=1, mode=mode))
