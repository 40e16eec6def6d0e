"""How far from where the changes divide a mirrored ball's rim lies: two ways, both of a picture that is continuous.

Change fades outward of the rim as blur, pixels and the looking up between them carry it; and profiles across the rim
are lines outside that go on as polynomials of the root of the depth inside. Pixel frame as in `silhouette`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.optimize import minimize

from relume.probe.ball.edge_tracking import evened, profiles
from relume.probe.ball.silhouette import Cone, cone_through

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


def changes(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Ln of how much the picture changes over half a pixel at places along the normals, (N, K), and where it is one."""
    wide = np.concatenate([[steps[0] - SPACING], steps, [steps[-1] + SPACING]])
    seen = profiles(picture, rim, normals, wide)
    shown = profiles(np.ones_like(picture), rim, normals, wide, mode="constant") > 0.99
    return np.log(np.abs(seen[:, 2:] - seen[:, :-2]) + 0.002), shown[:, 2:] & shown[:, :-2]


def sum_along(by: np.ndarray, cost: np.ndarray, steps: np.ndarray, normals: np.ndarray) -> float:
    """The sum of a cost (N, K) along an ellipse moved right, down and outward."""
    place = (np.clip(by[2] + normals @ by[:2], steps[0], steps[-1]) - steps[0]) / (steps[1] - steps[0])
    index = np.clip(place.astype(int), 0, len(steps) - 2)
    part, rows = place - index, np.arange(len(normals))
    return float(((1 - part) * cost[rows, index] + part * cost[rows, index + 1]).sum())


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
    found = []
    for blur in BLURS:
        left = np.stack([((_unexplained(blur, tuple(steps - move)) @ seen.T) ** 2).sum(0) for move in moves], axis=1)
        noise = float(np.median(left[shown].min(1))) if shown.any() else 1.0
        cost = np.where(shown[:, None], np.log(left + (noise + MISFIT**2 * varied + 1e-12)[:, None]), 0)

        def unlikely(by: np.ndarray, cost: np.ndarray = cost) -> float:
            beyond = max(0, np.hypot(by[0], by[1]) - STEADY) + max(0, INWARD - by[2]) + max(0, by[2] - OUTWARD)
            return sum_along(by, cost, moves, normals) + 1e3 * beyond

        start = min((np.array([0, 0, out]) for out in np.arange(INWARD, OUTWARD, 0.1)), key=unlikely)
        simplex = start + 0.2 * np.vstack([np.zeros(3), np.eye(3)])
        options = {"initial_simplex": simplex, "xatol": 0.01, "fatol": 0.05}
        result = minimize(unlikely, start, method="Nelder-Mead", options=options)
        found.append((float(result.fun), blur, result.x))
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
