"""Lens distortion: where a lens puts what a pinhole would have put elsewhere (Brown 1966)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

STEPS = 60
"""Newton steps before a point counts as one that no pinhole point goes to; five are usual, the rest are halvings."""
EXACT = 1e-13
"""Steps smaller than this, in units of the focal length, end the search: 1e-9 pixels of a lens of 10 000."""


@dataclass(frozen=True)
class Distortion:
    """Radial and tangential distortion of image points, on coordinates in units of the focal length.

    k1, k2, k3 : radial; below zero draws the corners in (barrel), above zero out (pincushion)
    p1, p2 : tangential, of a lens that is not square to its sensor

    With x right and **y down** from the principal point and r² = x² + y², a point goes to
    (x·R + 2·p1·x·y + p2·(r² + 2x²), y·R + p1·(r² + 2y²) + 2·p2·x·y), R = 1 + k1·r² + k2·r⁴ + k3·r⁶.
    These are the model, order and signs of OpenCV's first five coefficients, so that its calibrations can be used.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not np.isfinite(getattr(self, field.name)):
                raise ValueError(f"distortion {field.name} is {getattr(self, field.name)}; expected a finite number")

    @property
    def reach(self) -> float:
        """The radius at which the radial model folds over, in units of the focal length; infinite where it never does.

        Farther out the model would bring points back towards the middle, which no lens does.
        """
        # d/dr of r·R, in powers of r².
        roots = np.roots([7 * self.k3, 5 * self.k2, 3 * self.k1, 1.0])
        real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
        return float(np.sqrt(np.min(real[real > 0], initial=np.inf)))

    def distorted(self, points: np.ndarray) -> np.ndarray:
        """Where the lens puts pinhole points (…, 2); NaN for those beyond the fold."""
        points = np.asarray(points, np.float64)
        moved, _, upright = self._at(points[..., 0], points[..., 1])
        inside = upright & (np.sum(points**2, axis=-1) < self.reach**2)
        return np.where(inside[..., None], moved, np.nan)

    def undistorted(self, points: np.ndarray) -> np.ndarray:
        """The pinhole points (…, 2) that the lens puts at `points`: Newton's method; NaN where there is none."""
        points = np.asarray(points, np.float64)
        start = self._without_radial(points)
        if self.p1 == self.p2 == 0:
            return start
        x, y = start[..., 0].copy(), start[..., 1].copy()
        left = np.full(x.shape, np.inf)
        with np.errstate(invalid="ignore"):
            for _ in range(STEPS):
                moved, (a, b, d), _ = self._at(x, y)
                error = moved - points
                determinant = a * d - b * b
                across = (d * error[..., 0] - b * error[..., 1]) / determinant
                down = (a * error[..., 1] - b * error[..., 0]) / determinant
                x, y, left = x - across, y - down, np.hypot(across, down)
                if not np.any(left > EXACT):
                    break
            _, _, upright = self._at(x, y)
            inside = upright & (x**2 + y**2 < self.reach**2) & (left < 1e-9)
        return np.where(inside[..., None], np.stack([x, y], axis=-1), np.nan)

    def _at(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, ...], np.ndarray]:
        """Distorted points, the derivatives (∂x'/∂x, ∂x'/∂y = ∂y'/∂x, ∂y'/∂y), and where they keep orientation."""
        square = x * x + y * y
        with np.errstate(over="ignore", invalid="ignore"):
            radial = 1 + square * (self.k1 + square * (self.k2 + square * self.k3))
            slope = self.k1 + square * (2 * self.k2 + square * 3 * self.k3)
            moved = np.stack(
                [
                    x * radial + 2 * self.p1 * x * y + self.p2 * (square + 2 * x * x),
                    y * radial + self.p1 * (square + 2 * y * y) + 2 * self.p2 * x * y,
                ],
                axis=-1,
            )
            a = radial + 2 * x * x * slope + 2 * self.p1 * y + 6 * self.p2 * x
            b = 2 * x * y * slope + 2 * self.p1 * x + 2 * self.p2 * y
            d = radial + 2 * y * y * slope + 6 * self.p1 * y + 2 * self.p2 * x
            return moved, (a, b, d), (a * d - b * b > 0) & (a + d > 0)

    def _without_radial(self, points: np.ndarray) -> np.ndarray:
        """The points before the radial part: Newton's method on the radius, kept within a bracket that halves."""
        target = np.linalg.norm(points, axis=-1)
        low = np.zeros_like(target)
        high = np.full_like(target, self.reach if np.isfinite(self.reach) else 1.0)
        if not np.isfinite(self.reach):
            finite = np.isfinite(target)
            while np.any(short := finite & (self._radius(high)[0] < target)):
                high = np.where(short, 2 * high, high)
        top = self._radius(high)[0]
        radius = np.minimum(target, high)
        for _ in range(STEPS):
            value, slope = self._radius(radius)
            above = value > target
            low, high = np.where(above, low, radius), np.where(above, radius, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = radius - (value - target) / slope
            step = np.where((step >= low) & (step <= high), step, (low + high) / 2)
            done = not np.any(np.abs(step - radius) > EXACT)
            radius = step
            if done:
                break
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(target > 0, radius / target, 1.0)
        return np.where((target < top)[..., None], points * share[..., None], np.nan)

    def _radius(self, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The distorted radius and its derivative."""
        square = radius * radius
        value = radius * (1 + square * (self.k1 + square * (self.k2 + square * self.k3)))
        return value, 1 + square * (3 * self.k1 + square * (5 * self.k2 + square * 7 * self.k3))
