"""The silhouette of a ball under perspective: the cone of rays that graze it, and the ellipse they draw.

Pixel frame: x right, y down, z forward; the principal point is the picture's middle. A ball whose centre lies `distance`
radii away along `axis` is touched by the rays d with d·axis = cos α, sin α = 1/distance; the picture cuts this cone in
an ellipse, a circle only where the ball lies in the picture's middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from relume.image.colour import luminance
from relume.probe.outline import RAYS, Outline, evened
from relume.sphere.directions import normalised

OUTLIER = 1.0
"""Pixels beyond which a point of the rim is not believed; an edge is seen to a few tenths."""
REACH = (0.02, 0.008)
"""How far the rim is sought on either side of the guess, in radii, in the first pass and in the second."""


@dataclass(frozen=True, eq=False)
class Cone:
    """The rays that graze a ball.

    axis : unit vector from the camera to the ball's centre, pixel frame
    distance : from the camera to the ball's centre, in ball radii
    """

    axis: np.ndarray
    distance: float

    @property
    def half_angle(self) -> float:
        """α = asin(1/distance), radians."""
        return float(np.arcsin(1 / self.distance))

    def silhouette(self, size: tuple[int, int], focal_length: float, count: int = RAYS) -> tuple[np.ndarray, ...]:
        """Points (count, 2) on the silhouette, pixels, and the unit normals (count, 2) that point away from the ball.

        size : (width, height) of the picture
        focal_length : pixels
        """
        turns = 2 * np.pi * np.arange(count) / count
        points = _projected(self._rays(turns, self.half_angle), size, focal_length)
        step = 1e-4 * self.half_angle
        outer = _projected(self._rays(turns, self.half_angle + step), size, focal_length)
        # Across the ellipse, not along the ray's own move: the two differ where the ball lies far from the middle.
        along = np.roll(points, -1, 0) - np.roll(points, 1, 0)
        normals = normalised(np.stack([along[:, 1], -along[:, 0]], axis=1))
        return points, normals * np.sign((normals * (outer - points)).sum(1, keepdims=True))

    def _rays(self, turns: np.ndarray, angle: float) -> np.ndarray:
        sideways = normalised(np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))]))
        other = np.cross(self.axis, sideways)
        ring = np.cos(turns)[:, None] * sideways + np.sin(turns)[:, None] * other
        return np.cos(angle) * self.axis + np.sin(angle) * ring


def _projected(rays: np.ndarray, size: tuple[int, int], focal_length: float) -> np.ndarray:
    return np.array(size) / 2 + focal_length * rays[:, :2] / rays[:, 2:]


def cone_through(points: np.ndarray, size: tuple[int, int], focal_length: float) -> Cone:
    """The cone through points (N ≥ 3, 2) of a silhouette, by least squares.

    size : (width, height) of the picture
    focal_length : pixels
    """
    x, y = points[:, 0] - size[0] / 2, points[:, 1] - size[1] / 2
    rays = normalised(np.stack([x, y, np.full_like(x, focal_length)], axis=1))
    # Linear in m = axis / cos α: d·m = 1 on every ray.
    m, *_ = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)
    cosine = 1 / float(np.linalg.norm(m))
    return Cone(normalised(m), 1 / float(np.sqrt(max(1 - cosine**2, 1e-12))))


def followed(radiance: np.ndarray, outline: Outline, focal_length: float) -> Outline:
    """The rim near an outline, followed as the ellipse that a ball draws in perspective.

    radiance : (H, W, 3)
    outline : within about 2 % of its radius of the rim
    focal_length : pixels

    The place of an edge is read in linear light, where a pixel that the rim cuts mixes both sides by their areas. The
    outline is given back as it was where too little of the rim is seen.
    """
    height, width = radiance.shape[:2]
    size = (width, height)
    bright = luminance(radiance)
    even = evened(bright)
    cone, found = cone_through(outline.points, size, focal_length), outline
    for index, reach in enumerate(REACH):
        half = max(reach * outline.radius, 2.0)
        rim, normals = cone.silhouette(size, focal_length)
        places = _edges(even, rim, normals, half, max(0.8, outline.radius / 300))
        if index:
            places = _in_linear_light(bright, rim, normals, places)
        points = (rim + normals * places[:, None])[np.isfinite(places)]
        if len(points) < RAYS // 10:
            return outline
        cone, near = _robust_cone(points, size, focal_length, max(OUTLIER, 0.25 * half if index == 0 else OUTLIER))
        found = outline_of(cone, size, focal_length, points[near], float(near.sum()) / RAYS)
    return found


def outline_of(
    cone: Cone, size: tuple[int, int], focal_length: float, points: np.ndarray | None = None, coverage: float = 1.0
) -> Outline:
    """The outline that a cone draws.

    points : (N, 2) seen on it; those of the ellipse itself unless given
    coverage : the share of it that was seen
    """
    rim, _ = cone.silhouette(size, focal_length)
    centre = (rim.max(0) + rim.min(0)) / 2
    spread = np.linalg.norm(rim - centre, axis=1)
    major, minor = float(spread.max()), float(spread.min())
    towards = rim[int(np.argmax(spread))] - centre
    return Outline(
        rim if points is None else points,
        (float(centre[0]), float(centre[1])),
        float(np.sqrt(major * minor)),
        coverage,
        (major, minor),
        float(np.arctan2(towards[1], towards[0]) % np.pi),
    )


def _edges(picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, half: float, blur: float) -> np.ndarray:
    """Where along its normal each rim point has its edge, pixels outward; NaN where none is clear."""
    blurred = gaussian_filter(picture, blur)
    steps = np.arange(-2 * half, 2 * half + 0.25, 0.5)
    slope = np.abs(np.gradient(_profiles(blurred, rim, normals, steps), axis=1))
    drawn = slope * np.exp(-0.5 * (steps / half) ** 2)
    best, rows = np.argmax(drawn[:, 1:-1], axis=1) + 1, np.arange(len(rim))
    before, here, after = slope[rows, best - 1], slope[rows, best], slope[rows, best + 1]
    bend = np.minimum(before - 2 * here + after, -1e-12)
    edge = steps[best] + 0.5 * np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
    clear = (here >= before) & (here >= after) & (here > 1.5 * np.median(slope, axis=1)) & (here > 0.002)
    at = rim + normals * edge[:, None]
    clear &= np.all((at > 0) & (at < np.array(picture.shape[::-1])), axis=1)
    return np.where(clear, edge, np.nan)


def _in_linear_light(bright: np.ndarray, rim: np.ndarray, normals: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The same edges, each at the middle of its slope in linear light within 2 pixels."""
    steps = np.arange(-2.5, 2.51, 0.125)
    start = rim + normals * np.nan_to_num(places)[:, None]
    slope = np.diff(_profiles(gaussian_filter(bright, 0.6), start, normals, steps), axis=1)
    middle = (steps[1:] + steps[:-1]) / 2
    # Only what changes the way the edge does counts, and its flanks less than its steepest part.
    sign = np.sign((slope * np.exp(-(middle**2))).sum(1, keepdims=True))
    share = np.maximum(slope * sign, 0) ** 2
    total = share.sum(1)
    moved = np.divide((share * middle).sum(1), total, out=np.zeros_like(total), where=total > 0)
    return places + moved


def _profiles(picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray) -> np.ndarray:
    at = rim[:, None, :] + normals[:, None, :] * steps[None, :, None]
    return np.asarray(map_coordinates(picture, [at[..., 1] - 0.5, at[..., 0] - 0.5], order=1, mode="nearest"))


def _off(points: np.ndarray, cone: Cone, size: tuple[int, int], focal_length: float) -> np.ndarray:
    """How far outside a cone's silhouette points lie, pixels, to first order."""
    offset = np.concatenate([points - np.array(size) / 2, np.full((len(points), 1), focal_length)], axis=1)
    cosine = focal_length / np.linalg.norm(offset, axis=1)
    angle = np.arccos(np.clip(normalised(offset) @ cone.axis, -1, 1))
    return (angle - cone.half_angle) * focal_length / cosine**2


def _robust_cone(
    points: np.ndarray, size: tuple[int, int], focal_length: float, tolerance: float
) -> tuple[Cone, np.ndarray]:
    """The cone that most points lie on within `tolerance` pixels, and which they are."""
    generator = np.random.default_rng(1998)
    best = np.zeros(len(points), bool)
    for _ in range(200):
        chosen = points[generator.choice(len(points), 3, replace=False)]
        near = np.abs(_off(points, cone_through(chosen, size, focal_length), size, focal_length)) < tolerance
        if near.sum() > best.sum():
            best = near
    cone = cone_through(points[best], size, focal_length)
    for _ in range(5):
        off = _off(points, cone, size, focal_length)
        # What lies far to one side was another edge: the tolerance closes in on the scatter.
        spread = 1.4826 * float(np.median(np.abs(off[best]))) if best.any() else tolerance
        near = np.abs(off) < min(tolerance, max(3 * spread, 0.15))
        if near.sum() < 3:
            break
        best = near
        cone = cone_through(points[best], size, focal_length)
    return cone, best
