"""Finding the outline of a mirrored ball in a picture, without being told where it is.

At every centre and radius, the share of the circle on which the brightness changes across it and not along it is
taken (a Hough transform by convolution, blind to how strong the edges are); the best circles are then fitted at
full resolution and followed. Pixel coordinates: x right, y down, (0, 0) the outer corner of the first pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d, map_coordinates, maximum_filter, zoom
from scipy.optimize import minimize

from relume.errors import BallNotFound
from relume.image.colour import luminance

SEARCH_SIDE = 200
"""Longer side, in pixels, of the picture in which circles are sought; finer ones are fitted afterwards."""
RAYS = 720
RIVAL = 0.75
"""How well, against the best, another outline beside it must be seen to make the choice a guess."""
COVERAGE_NEEDED = 1 / 3
"""The share of the outline that must be seen: below it, curves inside rooms are taken for balls."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The ball's silhouette: points on it, and the circle or ellipse through them.

    points : (N, 2) pixel coordinates (x, y) on the silhouette
    centre : (x, y) of its middle
    radius : pixels; of an ellipse the root of the product of its semi-axes
    coverage : the share of it where an edge was seen, 0 to 1
    semi_axes : pixels, the greater first; None for a circle
    tilt : of the greater one against x, towards y, radians
    """

    points: np.ndarray
    centre: tuple[float, float]
    radius: float
    coverage: float
    semi_axes: tuple[float, float] | None = None
    tilt: float = 0.0

    def cut(self, size: tuple[int, int]) -> float:
        """The share of the disc that lies outside a picture of `size` (width, height)."""
        steps = (np.arange(200) + 0.5) / 100 - 1
        x, y = np.meshgrid(steps, steps)
        inside = x * x + y * y < 1
        x, y = self.centre[0] + self.radius * x, self.centre[1] + self.radius * y
        seen = inside & (x > 0) & (y > 0) & (x < size[0]) & (y < size[1])
        return 1 - float(seen.sum() / inside.sum())


def find_outline(radiance: np.ndarray, name: str = "picture") -> Outline:
    """Find the ball's silhouette in a radiance map (H, W, 3).

    Raises BallNotFound when no circle shows an edge along a third of its length, and when two that lie apart are seen
    about equally well.
    """
    picture = evened(luminance(radiance))
    slopes = _slopes(picture)
    outlines = [_followed(picture, *_fitted(slopes, *circle)) for circle in _circles(picture)]
    seen = [o for o in outlines if o is not None and o.coverage >= COVERAGE_NEEDED]
    if not seen:
        raise BallNotFound(f"{name}: no mirrored ball found; it must be round, whole in the picture and sharp")
    best = max(seen, key=_worth)
    for other in seen:
        apart = np.hypot(other.centre[0] - best.centre[0], other.centre[1] - best.centre[1])
        if apart > 0.9 * (other.radius + best.radius) and _worth(other) > RIVAL * _worth(best):
            places = " and ".join(f"{o.centre[0]:.0f},{o.centre[1]:.0f},{o.radius:.0f}" for o in (best, other))
            raise BallNotFound(f"{name}: two balls, at x,y,radius {places} pixels; pick the one that is meant")
    return best


def outline_through(points: np.ndarray) -> Outline:
    """The outline through points picked by hand on the rim, (N ≥ 3, 2) pixels.

    Raises ValueError for fewer, and for points on a line.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
        raise ValueError(f"points have shape {points.shape}; three points (x, y) on the rim are needed at least")
    x, y, radius = _circle_through(points)
    spread = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not np.isfinite(radius) or radius > 1e3 * spread or spread == 0:
        raise ValueError("the points lie on a line; pick three round the rim, far from one another")
    return Outline(points, (x, y), radius, 1.0)


def outline_of_circle(x: float, y: float, radius: float) -> Outline:
    """The outline told as a circle, pixels; raises ValueError unless its radius is above 0."""
    if not radius > 0:
        raise ValueError(f"radius is {radius}; a ball's outline has a radius above 0")
    turns = 2 * np.pi * np.arange(RAYS) / RAYS
    points = np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)
    return Outline(points, (x, y), radius, 1.0)


def _worth(outline: Outline) -> float:
    """Rooms mirrored in the ball hold smaller circles: among well-seen ones the larger is the ball."""
    return outline.coverage * float(np.sqrt(outline.radius))


def evened(image: np.ndarray) -> np.ndarray:
    """Luminance (H, W) made even over many stops, so that an edge in the dark counts as much as one in the light."""
    positive = np.maximum(image, np.percentile(image[image > 0], 1) if np.any(image > 0) else 1.0)
    logarithm = np.log(positive)
    low, high = np.percentile(logarithm, [1, 99.5])
    return np.clip((logarithm - low) / max(high - low, 1e-6), 0, 1.2)


def _circles(picture: np.ndarray, count: int = 12) -> list[tuple[float, float, float]]:
    """The likeliest circles (x, y, radius), in pixels of `picture`."""
    scale = min(1.0, SEARCH_SIDE / max(picture.shape))
    small = np.asarray(zoom(gaussian_filter(picture, 0.4 / scale), scale, order=1)) if scale < 1 else picture
    side = min(small.shape)
    margin = side // 8
    padded = np.pad(small, margin, mode="edge")
    gx, gy = _gradient(padded, 1.0)
    strength = gx**2 + gy**2
    # Each direction of change counts alike once it stands out of the noise.
    level = strength + np.percentile(strength, 50) + 1e-8
    across, along = np.fft.rfft2((gx**2 - gy**2) / level), np.fft.rfft2(2 * gx * gy / level)

    height, width = padded.shape
    y, x = np.indices((height, width))
    x, y = (x + width // 2) % width - width // 2, (y + height // 2) % height - height // 2
    distance, angle = np.hypot(x, y), np.arctan2(y, x)
    found: list[tuple[float, float, float, float]] = []
    for radius in np.arange(max(4.0, 0.06 * side), 0.6 * side, 0.75):
        ring = np.exp(-0.5 * ((distance - radius) / 0.8) ** 2)
        ring /= ring.sum()
        # Change across the circle minus change along it: (g·n)² − (g·t)², with n at angle ψ.
        share = np.fft.irfft2(
            across * np.conj(np.fft.rfft2(ring * np.cos(2 * angle)))
            + along * np.conj(np.fft.rfft2(ring * np.sin(2 * angle))),
            s=(height, width),
        )
        share = share[margin : height - margin, margin : width - margin]
        peak = np.where(share == maximum_filter(share, 7), share, 0)
        for index in np.argsort(peak, axis=None)[-3:]:
            row, column = divmod(int(index), share.shape[1])
            found.append((float(share[row, column]), column + 0.5, row + 0.5, float(radius)))
    # A short circle is matched by chance more easily than a long one.
    found.sort(key=lambda circle: -circle[0] * circle[3] ** 0.25)
    chosen: list[tuple[float, float, float]] = []
    for _, cx, cy, radius in found:
        if all(np.hypot(cx - a, cy - b) + abs(radius - r) > max(3.0, 0.12 * radius) for a, b, r in chosen):
            chosen.append((cx, cy, radius))
        if len(chosen) == count:
            break
    return [(cx / scale, cy / scale, radius / scale) for cx, cy, radius in chosen]


def _slopes(picture: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Blur in pixels, and how the picture so blurred changes to the right and down; coarse to fine."""
    step = max(2.0, max(picture.shape) / SEARCH_SIDE)
    blurs = (step, step / 2, max(step / 4, 0.8))
    return [(b, *_gradient(picture, b)) for b in blurs]


def _gradient(picture: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """The derivative of the blurred picture to the right and down."""
    right, down = (np.asarray(gaussian_filter1d(picture, blur, axis=axis, order=1)) for axis in (1, 0))
    return gaussian_filter1d(right, blur, axis=0), gaussian_filter1d(down, blur, axis=1)


def _fitted(
    slopes: list[tuple[float, np.ndarray, np.ndarray]], x: float, y: float, radius: float
) -> tuple[float, float, float]:
    """The circle near a guess across which the picture changes, on most of its length."""
    angles = 2 * np.pi * np.arange(RAYS) / RAYS
    cosine, sine = np.cos(angles), np.sin(angles)
    circle = np.array([x, y, radius])
    for blur, gx, gy in slopes:
        noise = float(np.median(np.abs(gx))) + 1e-6

        def unseen(c: np.ndarray, gx: np.ndarray = gx, gy: np.ndarray = gy, noise: float = noise) -> float:
            at = [c[1] + c[2] * sine - 0.5, c[0] + c[2] * cosine - 0.5]
            right, down = (map_coordinates(g, at, order=1, mode="nearest") for g in (gx, gy))
            # The logarithm lets a long weak edge outweigh a short strong one.
            return -float(np.log1p(((right * cosine + down * sine) / noise) ** 2).mean())

        simplex = circle + np.vstack([np.zeros(3), np.eye(3) * blur])
        options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-4, "maxiter": 120}
        circle = minimize(unseen, circle, method="Nelder-Mead", options=options).x
    return float(circle[0]), float(circle[1]), float(circle[2])


def _followed(picture: np.ndarray, x: float, y: float, radius: float) -> Outline | None:
    """The edge along rays from the centre, or None where too little of it is seen."""
    height, width = picture.shape
    if not (0 < x < width and 0 < y < height and 4 < radius < 0.7 * max(width, height)):
        return None
    angles = 2 * np.pi * np.arange(RAYS) / RAYS
    blurred = gaussian_filter(picture, max(0.8, radius / 300))
    points, coverage = np.empty((0, 2)), 0.0
    for reach in (0.02, 0.012):
        half = max(reach * radius, 2.0)
        distances = radius + np.arange(-2 * half, 2 * half + 0.25, 0.5)
        px, py = x + np.cos(angles)[:, None] * distances, y + np.sin(angles)[:, None] * distances
        slope = np.abs(np.gradient(map_coordinates(blurred, [py - 0.5, px - 0.5], order=1, mode="nearest"), axis=1))
        # The guess draws the choice towards itself, so that a stronger edge inside the ball does not win.
        drawn = slope * np.exp(-0.5 * ((distances - radius) / half) ** 2)
        best, rows = np.argmax(drawn[:, 1:-1], axis=1) + 1, np.arange(RAYS)
        before, here, after = slope[rows, best - 1], slope[rows, best], slope[rows, best + 1]
        bend = np.minimum(before - 2 * here + after, -1e-12)
        edge = distances[best] + 0.5 * np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
        clear = (here >= before) & (here >= after) & (here > 1.5 * np.median(slope, axis=1)) & (here > 0.002)
        at_x, at_y = px[rows, best], py[rows, best]
        clear &= (at_x > 0) & (at_y > 0) & (at_x < width) & (at_y < height)
        points = np.stack([x + np.cos(angles) * edge, y + np.sin(angles) * edge], axis=1)[clear]
        if len(points) < RAYS // 10:
            return None
        x, y, radius, near = _robust_circle(points, tolerance=max(1.0, 0.5 * half))
        coverage, points = float(near.sum()) / RAYS, points[near]
    return Outline(points, (x, y), radius, coverage)


def _robust_circle(points: np.ndarray, tolerance: float) -> tuple[float, float, float, np.ndarray]:
    """The circle that most points lie on within `tolerance` pixels, and which they are."""
    generator = np.random.default_rng(1998)
    best = np.zeros(len(points), bool)
    for _ in range(100):
        x, y, radius = _circle_through(points[generator.choice(len(points), 3, replace=False)])
        near = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius) < tolerance
        if near.sum() > best.sum():
            best = near
    x, y, radius = _circle_through(points[best])
    for _ in range(5):
        best = np.abs(np.hypot(points[:, 0] - x, points[:, 1] - y) - radius) < tolerance
        x, y, radius = _circle_through(points[best])
    return x, y, radius, best


def _circle_through(points: np.ndarray) -> tuple[float, float, float]:
    """Least squares circle, x² + y² = 2ax + 2by + c (Kåsa's form)."""
    middle = points.mean(0)
    x, y = (points - middle).T
    (a, b, c), *_ = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], 1), x**2 + y**2, rcond=None)
    return float(a + middle[0]), float(b + middle[1]), float(np.sqrt(max(c + a * a + b * b, 0.0)))
