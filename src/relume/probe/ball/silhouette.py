"""The silhouette of a ball under perspective: the cone of rays that graze it, and the ellipse they draw.

Pixel frame: x right, y down, z forward; the principal point is the picture's middle. A ball whose centre lies
`distance` radii away along `axis` is touched by the rays d with d·axis = cos α, sin α = 1/distance; the picture
cuts this cone in an ellipse, a circle only where the ball lies in the picture's middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from relume.sphere.directions import normalised

RAYS = 720
"""Points at which a silhouette is looked at, half a degree apart."""
TELEPHOTO = 200.0
"""Focal length, in widths of the picture, that stands for an unknown one: a ball's silhouette is a circle in it."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The ball's silhouette: points on it, and the circle or ellipse through them.

    points : (N, 2) pixel coordinates (x, y) on the silhouette
    centre : (x, y) of its middle
    radius : pixels; of an ellipse the root of the product of its semi-axes
    coverage : the share of it where an edge was seen, 0 to 1
    semi_axes : pixels, the greater first; None for a circle
    tilt : of the greater one against x, towards y, radians
    rivals : (x, y, radius) of other curves round the same place that are seen about as well; a doubt
    focal_length : pixels, where the shape of the ellipse gave it; None where it was known, or a circle does as well
    roughly : whether the ball was recognised only in a picture so small that a place without one may look like it
    """

    points: np.ndarray
    centre: tuple[float, float]
    radius: float
    coverage: float
    semi_axes: tuple[float, float] | None = None
    tilt: float = 0.0
    rivals: tuple[tuple[float, float, float], ...] = ()
    focal_length: float | None = None
    roughly: bool = False

    def cut(self, size: tuple[float, float]) -> float:
        """The share of the disc that lies outside a picture of `size` (width, height)."""
        steps = (np.arange(200) + 0.5) / 100 - 1
        x, y = np.meshgrid(steps, steps)
        inside = x * x + y * y < 1
        x, y = self.centre[0] + self.radius * x, self.centre[1] + self.radius * y
        seen = inside & (x > 0) & (y > 0) & (x < size[0]) & (y < size[1])
        return 1 - float(seen.sum() / inside.sum())


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

    def silhouette(
        self, size: tuple[float, float], focal_length: float, count: int = RAYS
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points (count, 2) on the silhouette, pixels, and the unit normals (count, 2) that point away from the ball.

        size : (width, height) of the picture
        focal_length : pixels
        """
        across = np.stack(self._across())
        around, turning = _turns(count)
        rays = self.axis + np.tan(self.half_angle) * (around @ across)
        points = np.array(size) / 2 + focal_length * rays[:, :2] / rays[:, 2:]
        # How a point moves along the silhouette, by the quotient rule.
        turned = turning @ across
        along = turned[:, :2] * rays[:, 2:] - rays[:, :2] * turned[:, 2:]
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
        return points, normals * np.sign((normals[0] * (points[0] - points.mean(0))).sum())

    def _across(self) -> tuple[np.ndarray, np.ndarray]:
        """Two unit vectors that stand on the axis and on each other."""
        x, y, z = self.axis.tolist()
        sideways = np.array([z, 0.0, -x]) if abs(y) < 0.9 else np.array([0.0, -z, y])
        sideways /= np.linalg.norm(sideways)
        a, b, c = sideways.tolist()
        return sideways, np.array([y * c - z * b, z * a - x * c, x * b - y * a])


@lru_cache(maxsize=8)
def _turns(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (count, 2) at even turns, and those that they turn towards."""
    turns = 2 * np.pi * np.arange(count) / count
    cosine, sine = np.cos(turns), np.sin(turns)
    return np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)


@dataclass(frozen=True, eq=False)
class Grazing:
    """Points of a silhouette as rays, in terms of order one, to lay cones through some of them: d·m = 1 on each.

    m = axis / cos α. Rays of a long lens differ by a thousandth only. So with d = (w, 1)/n, w = (x, y)/f, n = |(w, 1)|
    the unknowns are those of the plane a·(w − w̄)/s + c = n − 1, and tan²α = m² − 1 is summed of small terms.

    terms : (N, 3), (w − w̄)/s and 1, each over n
    beyond : (N,), (n − 1)/n
    middle, spread : w̄ and s
    steep : (N,) n, the cosine of a ray's angle from the lens's axis, inverted
    """

    terms: np.ndarray
    beyond: np.ndarray
    middle: np.ndarray
    spread: float
    steep: np.ndarray

    @staticmethod
    def of(points: np.ndarray, size: tuple[float, float], focal_length: float) -> Grazing:
        """Of points (N, 2), pixels."""
        place = (points - np.array(size) / 2) / focal_length
        squared = (place * place).sum(1)
        steep = np.sqrt(1 + squared)
        middle = place.mean(0)
        spread = max(float(np.abs(place - middle).max()), 1e-12)
        terms = np.concatenate([(place - middle) / spread, np.ones((len(place), 1))], axis=1) / steep[:, None]
        return Grazing(terms, squared / (1 + steep) / steep, middle, spread, steep)

    def plane(self, used: np.ndarray | slice) -> np.ndarray:
        """The (a, c) of the cone that lies nearest to some of the rays, by least squares."""
        terms = self.terms[used]
        return np.linalg.lstsq(terms.T @ terms, terms.T @ self.beyond[used], rcond=None)[0]

    def planes(self, threes: np.ndarray) -> np.ndarray:
        """The (a, c) of the cones through three rays each, (C, 3) of `threes` (C, 3); none where they lie on a line."""
        terms, beyond = self.terms[threes], self.beyond[threes]
        first, second, third = terms[:, 0], terms[:, 1], terms[:, 2]
        crossed = np.stack([np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return (beyond[:, :, None] * crossed).sum(1) / (first * crossed[:, 0]).sum(1)[:, None]

    def tangent_squared(self, planes: np.ndarray) -> np.ndarray:
        """tan²α of cones (…, 3)."""
        aside = planes[..., :2] / self.spread
        along = planes[..., 2] - aside @ self.middle
        return np.maximum((aside**2).sum(-1) + 2 * along + along**2, 1e-12)

    def near(self, planes: np.ndarray, focal_length: float, tolerance: float) -> np.ndarray:
        """Which rays lie within so many pixels of cones' silhouettes, to first order: (…, N) of (…, 3)."""
        # |angle − α| < τ, from cos(angle) = cos α·(1 + δ).
        angle = tolerance / focal_length / self.steep**2
        # Three rays on a line have no plane: its numbers are none, and no ray is near it.
        with np.errstate(invalid="ignore"):
            off = planes @ self.terms.T - self.beyond + 2 * np.sin(angle / 2) ** 2
            return np.abs(off) < np.sqrt(self.tangent_squared(planes))[..., None] * np.sin(angle)

    def cone(self, plane: np.ndarray) -> Cone:
        """The cone of one."""
        aside = plane[:2] / self.spread
        axis = np.array([*aside, 1 + plane[2] - aside @ self.middle])
        return Cone(normalised(axis), float(np.sqrt(1 + 1 / self.tangent_squared(plane))))


def cone_through(points: np.ndarray, size: tuple[float, float], focal_length: float) -> Cone:
    """The cone through points (N ≥ 3, 2) of a silhouette, by least squares.

    size : (width, height) of the picture
    focal_length : pixels
    """
    rays = Grazing.of(points, size, focal_length)
    return rays.cone(rays.plane(slice(None)))


def outline_of(
    cone: Cone, size: tuple[float, float], focal_length: float, points: np.ndarray | None = None, coverage: float = 1.0
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


def outline_through(points: ArrayLike) -> Outline:
    """The outline through points picked by hand on the rim, (N ≥ 3, 2) pixels.

    Raises ValueError for fewer, and for points on a line.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < 3:
        raise ValueError(f"points have shape {points.shape}; three points (x, y) on the rim are needed at least")
    x, y, radius = _circle_through(points)
    spread = float(np.linalg.norm(np.ptp(points, axis=0)))
    thickness = np.linalg.svd(points - points.mean(0), compute_uv=False)[1]
    if not np.isfinite(radius) or thickness < 1e-3 * spread or spread == 0:
        raise ValueError("the points lie on a line; pick three round the rim, far from one another")
    return Outline(points, (x, y), radius, 1.0)


def outline_of_circle(x: float, y: float, radius: float) -> Outline:
    """The outline given as a circle, pixels; raises ValueError unless its radius is above 0.

    x, y : the middle, pixels from the upper left corner
    radius : pixels
    """
    if not radius > 0:
        raise ValueError(f"radius is {radius}; a ball's outline has a radius above 0")
    turns = 2 * np.pi * np.arange(RAYS) / RAYS
    points = np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)
    return Outline(points, (x, y), radius, 1.0)


def _circle_through(points: np.ndarray) -> tuple[float, float, float]:
    """Least squares circle, x² + y² = 2ax + 2by + c (Kåsa's form)."""
    middle = points.mean(0)
    x, y = (points - middle).T
    (a, b, c), *_ = np.linalg.lstsq(np.stack([2 * x, 2 * y, np.ones_like(x)], 1), x**2 + y**2, rcond=None)
    return float(a + middle[0]), float(b + middle[1]), float(np.sqrt(max(c + a * a + b * b, 0.0)))
