"""Point spreads that are the same when turned by half a turn, in polar coordinates about the point.

All glare here falls as a power of the distance and is drawn out along rays; both are smooth in the fourth root of the
distance, which is therefore the tables' coordinate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from relume.image.kernel import kernel
from relume.virtual_camera.lens.glare.convolution import NEAR, Canvas, Transfer, symmetric_transfer

SAMPLES = 8192
"""Of the radial table: interpolated linearly, a fall by the cube of the distance is off by 1e-5."""
BALANCED = 150
"""Pixels within which light is counted; rays are wider than pixels' pitch beyond."""
LEVELS = 192
"""Of the pattern: its rays change over a tenth of their length and more."""


@dataclass(frozen=True, eq=False)
class PolarSpread:
    """Light per pixel that leaves a point, by distance and angle.

    kept : (3,) shares of the light that stay in the point's own pixel
    radial : (3, SAMPLES) float32, mean light of a pixel at equal steps of the fourth root of its distance, from 0
    pattern : (3, LEVELS, angles) float32, light over that mean at equal steps of the same root, from 0, and of the
        angle, over half a turn
    near : (3, 2n + 1, 2n + 1) float32, light of the pixels round the point; 0 in the middle
    reach : pixels, the distance at which the tables end
    """

    kept: np.ndarray
    radial: np.ndarray
    pattern: np.ndarray
    near: np.ndarray
    reach: float

    def nearby(self) -> np.ndarray:
        """(2 NEAR + 1, 2 NEAR + 1, 3) light of the pixels round the point; 0 in the middle."""
        square = self.draw(NEAR, NEAR).astype(np.float64)
        square[NEAR, NEAR] = 0
        return square

    def transfer(self, channel: int, canvas: Canvas) -> Transfer | None:
        """The transform of what goes farther than that; None where the picture ends sooner."""
        if max(canvas.height, canvas.width) <= NEAR + 1:
            return None
        return symmetric_transfer(lambda begin, end: self.rows(channel, begin, end, canvas, hole=NEAR), canvas)

    def rows(self, channel: int, begin: int, end: int, canvas: Canvas, *, hole: int = -1) -> np.ndarray:
        """Rows begin…end below the point, (n, padded columns) float32: 0, 1, …, −2, −1 pixels right of it.

        hole : pixels from the point to all sides that are left at 0
        """
        rows = np.empty((end - begin, canvas.columns), np.float32)
        root = self.reach**0.25
        step, level_step = (np.float32((count - 1) / root) for count in (SAMPLES, self.pattern.shape[1]))
        parts = (self.radial[channel], level_step, self.pattern[channel], self.near[channel])
        draw_rows(begin, canvas.width, hole, step, *parts, rows)
        return rows

    def draw(self, half_height: int, half_width: int) -> np.ndarray:
        """The spread as a picture (2 half_height + 1, 2 half_width + 1, 3) float32, `kept` in its middle."""
        canvas = Canvas(half_height + 1, half_width + 1)
        planes = []
        for channel in range(3):
            rows = self.rows(channel, 0, half_height + 1, canvas)
            below = np.concatenate([rows[:, canvas.columns - half_width :], rows[:, : half_width + 1]], axis=1)
            below[0, half_width] = self.kept[channel]
            planes.append(np.concatenate([below[:0:-1, ::-1], below]))
        return np.stack(planes, axis=-1)


def balanced(spread: PolarSpread, expected: Callable[[float], np.ndarray]) -> PolarSpread:
    """The spread with so much kept that all light is there: rays that fall between pixels' middles are made up for.

    expected : gives the (3,) light that belongs within a radius in pixels
    """
    radius = int(min(BALANCED, spread.reach - 1))
    size = 2 * radius + 1
    fine = (np.arange(size * 8) + 0.5) / 8 - radius - 0.5
    covered = (np.hypot(fine, fine[:, None]) < radius).reshape(size, 8, size, 8).mean((1, 3))
    held = np.einsum("ij,ijc->c", covered, spread.draw(radius, radius).astype(np.float64))
    return replace(spread, kept=spread.kept + expected(radius) - held)


def table_distances(reach: float, count: int) -> np.ndarray:
    """(count,) distances in pixels of a table's entries."""
    return (np.linspace(0, reach**0.25, count)) ** 4


def pixel_means(density: Callable[[np.ndarray], np.ndarray], distances: np.ndarray) -> np.ndarray:
    """What pixels at distances (N,) receive of a smooth radial density, light per square pixel.

    The mean over a square of side 1 is p + ∇²p / 24 up to fourth derivatives, with ∇²p = p″ + p′ / r.
    Within two pixels, where that does not hold, it is the density itself; `near` stands for it there.
    """
    value = density(distances)
    safe = np.maximum(distances, 2.0)
    step = 0.02 * safe
    before, middle, after = density(safe - step), density(safe), density(safe + step)
    bend = (after - 2 * middle + before) / step**2 + (after - before) / (2 * step * safe)
    return np.where(distances > 2, value + bend / 24, value)


def within_pixel(density: Callable[[np.ndarray], np.ndarray]) -> float:
    """The integral of a radial density over the pixel about its middle, by polar coordinates.

    An eighth of the square: 8 ∫₀^{π/4} ∫₀^{1 / (2 cos φ)} p(r) r dr dφ, the inner one in the logarithm of r.
    """
    nodes, weights = np.polynomial.legendre.leggauss(16)
    edge = 0.5 / np.cos(np.pi / 8 * (nodes + 1))
    # Below a billionth of the edge a bounded density holds nothing.
    grid = np.linspace(np.log(1e-9), 0, 4097)
    radii = edge[:, None] * np.exp(grid)
    along = density(radii) * radii**2
    inner = np.trapezoid(along, grid, axis=1)
    return float(8 * np.pi / 8 * np.sum(weights * inner))


def waves_of(angles: int) -> np.ndarray:
    """(angles // 2 + 1,) waves per radian, times 2π, of the transform of a pattern over half a turn: 0, 2, 4, …"""
    return 2.0 * np.arange(angles // 2 + 1)


def seen_by_pixels(pattern: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """A pattern (levels, angles) averaged over the angle 1 / r that a pixel at distance r (levels,) covers.

    Means stay; the point itself, which lies in every direction, sees the mean alone.
    """
    width = 1 / np.maximum(distances, 1e-3)[:, None]
    waves = np.fft.rfft(pattern, axis=1)
    waves *= np.sinc(waves_of(pattern.shape[1]) * width / (2 * np.pi))
    waves[distances < 0.5, 1:] = 0
    return np.maximum(np.fft.irfft(waves, pattern.shape[1], axis=1), 0)


def pattern_at(pattern: np.ndarray, reach: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A pattern (levels, angles), its levels at equal steps of r^¼ up to `reach`, at pixels x right and y down."""
    levels, angles = pattern.shape
    height = (np.hypot(x, y) / reach) ** 0.25 * (levels - 1)
    level = np.minimum(height.astype(np.intp), levels - 2)
    place = np.arctan2(y, x) % np.pi * (angles / np.pi)
    bin_ = place.astype(np.intp)
    up, across = height - level, place - bin_
    bin_, after = bin_ % angles, (bin_ + 1) % angles
    below = (1 - across) * pattern[level, bin_] + across * pattern[level, after]
    above = (1 - across) * pattern[level + 1, bin_] + across * pattern[level + 1, after]
    return (1 - up) * below + up * above


@kernel
def draw_rows(first, width, hole, step, radial, level_step, pattern, near, rows):
    """Rows first… below the point, (n, padded columns), in the order of transforms: 0, 1, …, −2, −1 pixels right.

    Values are radial(r^¼) · pattern(r^¼, angle), both interpolated linearly, or those of `near` round the point;
    nothing within `hole` pixels of it to all sides.
    """
    reach = near.shape[0] // 2
    levels, angles = pattern.shape
    columns = rows.shape[1]
    turn = angles / np.pi
    for i in range(rows.shape[0]):
        y = first + i
        for x in range(columns):
            rows[i, x] = 0
        for x in range(hole + 1 if y <= hole else 0, width):
            if y <= reach and x <= reach:
                rows[i, x] = near[reach + y, reach + x]
                if x > 0:
                    rows[i, columns - x] = near[reach + y, reach - x]
                continue
            root = np.sqrt(np.sqrt(np.sqrt(np.float32(x * x + y * y))))
            at = root * step
            index = min(int(at), radial.shape[0] - 2)
            part = at - np.float32(index)
            value = radial[index] + part * (radial[index + 1] - radial[index])
            height = root * level_step
            level = min(int(height), levels - 2)
            upper = height - np.float32(level)
            angle = np.float32(np.arctan2(np.float32(y), np.float32(x))) * np.float32(turn)
            for side in range(2):
                # The angle on the left is half a turn less that on the right.
                place = angle if side == 0 else angles - angle
                bin_ = int(place)
                share = place - np.float32(bin_)
                bin_ = bin_ if bin_ < angles else bin_ - angles
                after = bin_ + 1 if bin_ + 1 < angles else 0
                below = pattern[level, bin_] + share * (pattern[level, after] - pattern[level, bin_])
                above = pattern[level + 1, bin_] + share * (pattern[level + 1, after] - pattern[level + 1, bin_])
                drawn = value * (below + upper * (above - below))
                if side == 0:
                    rows[i, x] = drawn
                elif x > 0:
                    rows[i, columns - x] = drawn
