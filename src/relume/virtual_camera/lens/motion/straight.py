"""Motion blur along a straight line, the same for the whole picture (Debevec & Malik 1997, §3, Fig. 9)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from relume.image.bands import in_threads
from relume.image.blurring import line_weights
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

_BAND = 32
_RUNNING = 4
"""Half a window, pixels, from which on running sums beat the sum of all taps."""


@dataclass(frozen=True)
class StraightMotion(Relative):
    """The picture moves straight and evenly by `dx` pixels right and `dy` down while the shutter is open.

    shutter : how the light is shared out over that time

    The picture given shows the middle of the exposure, and every pixel becomes the integral along the line of the
    bilinear interpolation of radiance: Debevec & Malik's 37×1 box (1997, §3, Fig. 9b), of any length and angle. Its
    weights are not negative, so that a sun has no dark rings, and they sum to 1: light whose streak ends at least a
    length within the border is kept. Nearer to it a pixel is averaged over the time for which the picture shows what
    it saw (`coverage`): even light stays even.

    A level or upright line behind a box shutter costs the same whatever its length.
    Raises ValueError for a motion that is not finite, or longer than any picture (65536 pixels).
    """

    dx: float
    dy: float = 0.0
    shutter: Shutter = field(default_factory=Shutter)

    def __post_init__(self) -> None:
        if not np.hypot(self.dx, self.dy) <= 65536:
            raise ValueError(f"the motion is ({self.dx}, {self.dy}); expected at most 65536 pixels right and down")

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 that the sensor gathers.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        from relume.virtual_camera.lens.motion.kernels import gathered, level_sums, upright_sums

        rows, columns, weights = self._weights()
        height, width = radiance.shape[:2]
        radiance = np.ascontiguousarray(radiance, np.float32)
        result = np.empty_like(radiance)
        flat, out = radiance.reshape(height, -1), result.reshape(height, -1)
        length = float(np.hypot(self.dx, self.dy))
        half = int(np.floor(length / 2 - 1))
        if self.shutter.opening == 0 and 0 in (self.dx, self.dy) and half >= _RUNNING:
            level = self.dy == 0
            ends = _ends(columns if level else rows, weights, half)
            totals = _totals(ends, half, 1 / length, width if level else height)
            sums, count, chunk = (level_sums, height, _BAND) if level else (upright_sums, 3 * width, 3 * 4 * _BAND)
            in_threads(lambda b, e: sums(flat, half, 1 / length, *ends, totals, out, b, e), count, chunk=chunk)
            return result
        in_threads(lambda b, e: gathered(flat, rows, columns, weights, out, b, e), height, chunk=_BAND)
        return result

    def coverage(self, shape: tuple[int, int], view: View) -> np.ndarray:
        """The share (H, W) float32 of a pixel's light that a picture of that shape (rows, columns) shows.

        view : the picture's view (`VirtualCamera.view`)
        """
        height, width = shape
        steps = np.zeros((height + 1, width + 1))
        for row, column, weight in zip(*self._weights(), strict=True):
            # A tap is inside for a rectangle of pixels: its weight begins at one corner and ends at the other.
            top, bottom = np.clip([-row, height - row], 0, height)
            left, right = np.clip([-column, width - column], 0, width)
            steps[top, left] += weight
            steps[top, right] -= weight
            steps[bottom, left] -= weight
            steps[bottom, right] += weight
        share = steps.cumsum(0).cumsum(1)[:-1, :-1]
        return np.clip(share, 0, 1).astype(np.float32)

    def _weights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return line_weights(self.dx, self.dy, self.shutter.light, self.shutter.bends)


def _ends(offsets: np.ndarray, weights: np.ndarray, half: int) -> tuple[float, float]:
    """The weights of the two taps beyond each end of a window of 2·half + 1 equal ones."""
    return float(weights[offsets == half + 1].sum()), float(weights[offsets == half + 2].sum())


def _totals(ends: tuple[float, float], half: int, weight: float, size: int) -> np.ndarray:
    """What the weights inside a line of `size` pixels sum to, (size,) float64."""
    taps = np.full(2 * half + 5, weight)
    taps[[1, -2]], taps[[0, -1]] = ends
    places = np.arange(size)
    before = np.concatenate([[0.0], np.cumsum(taps)])
    first = np.clip(half + 2 - places, 0, len(taps))
    last = np.clip(half + 2 - places + size, 0, len(taps))
    return before[last] - before[first]
