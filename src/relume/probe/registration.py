"""Laying the views of a ball on one another: how each is turned against the first, how near the walls are.

All views are compared in the logarithm of luminance, at directions spread evenly over the sphere, weighted by how well
each view shows them. Rays to a near wall leave the ball in different places for different cameras, which looks like a
turn; so the walls' distance is found together with the turns. The first view stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from relume.errors import BallNotFound
from relume.image.colour import luminance
from relume.probe.ball import BallView
from relume.probe.turn_search import likeliest_turns
from relume.probe.weights import trust
from relume.sphere.directions import rotation_from_vector

TURN_LIMIT = np.radians(6)
"""The farthest that registration turns a view whose camera's place is told: what a tape measure leaves uncertain."""
NEAREST = 0.2
"""The greatest nearness registration may find: walls five ball radii away."""
LIKENESS = 0.7
"""Correlation of ln luminance below which two views do not show one light; the room's two reach 0.995, and −0.04 to
0.84 where a camera is said to have stood elsewhere."""
EVEN_LIGHT = 0.05
"""Standard deviation of ln luminance below which there is nothing to correlate."""
BRIGHTNESS_LIMIT = 0.1
"""Natural logarithm of the brightness ratio of two views above which it is told."""
HORIZON = 0.1
"""Least y of the directions that are compared: what the ball stands on is nearer than all else."""
DIRECTIONS = 20_000
"""Spread over the sphere; half of those above the horizon are compared."""


@dataclass(frozen=True, eq=False)
class Registration:
    """How the views of a ball lie.

    turns : (N, 3, 3) rotations of each view's world into the first one's; the first is the identity
    corrections : (N,) the angle of each turn, radians
    nearness : ball radius over the distance of what surrounds it; 0 for a lone view
    gains : (N,) how many times as bright as the first each view is
    likenesses : (N,) correlation of ln luminance with the other views; 1 for the first, and in even light
    doubts : a line each
    """

    turns: np.ndarray
    corrections: tuple[float, ...]
    nearness: float
    gains: tuple[float, ...]
    likenesses: tuple[float, ...]
    doubts: tuple[str, ...] = ()


class RegistrationMethod(Protocol):
    """How views are laid on one another."""

    def __call__(self, views: Sequence[BallView]) -> Registration: ...


@dataclass(frozen=True)
class ToldPlaces:
    """The cameras' places are told; each view is turned by no more than their uncertainty.

    limit : the most a view is turned, radians; 6°, what tape measure and level leave uncertain
    """

    limit: float = float(TURN_LIMIT)

    def __call__(self, views: Sequence[BallView]) -> Registration:
        starts = np.zeros((len(views), 3))
        return _laid(views, np.stack([np.eye(3)] * len(views)), starts, self.limit)


@dataclass(frozen=True)
class UnknownTurns:
    """Nothing is told of how the views are turned against the first: it is sought, then refined.

    tilt : the most by which a camera leant or looked down more than the first one's, radians; turns about the vertical
        are free. 45°, since photographers keep the horizon upright

    Raises BallNotFound for views that do not overlap or do not show one light.
    """

    tilt: float = float(np.radians(45))
    limit: float = float(np.radians(8))

    def __call__(self, views: Sequence[BallView]) -> Registration:
        turns = [np.eye(3)]
        for number, view in enumerate(views[1:], start=2):
            tried: list[tuple[float, np.ndarray]] = []
            for start in likeliest_turns(views[0], view, tilt=self.tilt):
                found = _laid((views[0], view), np.stack([np.eye(3), start]), np.zeros((2, 3)), self.limit, quick=True)
                tried.append((found.likenesses[1], found.turns[1]))
            likeness, turn = max(tried, key=lambda each: each[0])
            if not likeness > LIKENESS:
                raise BallNotFound(
                    f"view {number} of the ball shows nothing that fits the first one, however it is turned; "
                    "leave it out, or tell where its camera stood"
                )
            turns.append(turn)
        return _laid(views, np.stack(turns), np.zeros((len(views), 3)), self.limit)


def spread_directions(count: int) -> np.ndarray:
    """Unit vectors (count, 3), evenly spread (a Fibonacci spiral)."""
    y = 1 - 2 * (np.arange(count) + 0.5) / count
    longitude = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - y * y)
    return np.stack([ring * np.sin(longitude), y, -ring * np.cos(longitude)], axis=1)


def _laid(
    views: Sequence[BallView], turns: np.ndarray, starts: np.ndarray, limit: float, *, quick: bool = False
) -> Registration:
    """All views turned by `turns`, then refined together."""
    count = len(views)
    if count == 1:
        return Registration(turns, (0.0,), 0.0, (1.0,), (1.0,))
    placed = [view.turned(turn) for view, turn in zip(views, turns, strict=True)]
    directions = spread_directions(DIRECTIONS // (8 if quick else 1))
    directions = directions[directions[:, 1] > HORIZON]
    shares = np.stack([trust(view, directions) for view in placed])
    # A direction is compared where two views at least show it well.
    second = np.sort(shares, axis=0)[-2]
    directions = directions[second > np.quantile(second, 0.5)]
    shares = np.stack([trust(view, directions) for view in placed]) ** 2
    shares /= shares.sum(0)
    problem = _Bundle(placed, directions, shares)
    solution = problem.solved(starts, limit)
    vectors, near = problem.parts(solution.x)
    seen = problem.logarithms(vectors, near)
    gains = np.exp(problem.offsets(seen))
    likenesses, doubts = [1.0], []
    for index in range(1, count):
        likeness = problem.likeness(seen, index)
        likenesses.append(likeness)
        far = np.any(np.abs(vectors[index]) > 0.98 * limit) or near > 0.98 * NEAREST
        if likeness <= LIKENESS or far:
            doubts.append(f"view {index + 1} of the ball does not fit the first one; check where its camera stood")
        if abs(np.log(gains[index])) > BRIGHTNESS_LIMIT:
            doubts.append(
                f"view {index + 1} of the ball is {gains[index]:.2f} times as bright as the first; "
                "did the light or the exposure change?"
            )
    refined = [rotation_from_vector(v) @ turn for v, turn in zip(vectors, turns, strict=True)]
    corrections = tuple(float(np.linalg.norm(v)) for v in vectors)
    return Registration(np.stack(refined), corrections, near, tuple(gains.tolist()), tuple(likenesses), tuple(doubts))


@dataclass(frozen=True, eq=False)
class _Bundle:
    """The robust least squares problem of all views but the first, three numbers each, and the nearness."""

    views: Sequence[BallView]
    directions: np.ndarray
    shares: np.ndarray

    def parts(self, guess: np.ndarray) -> tuple[np.ndarray, float]:
        """Rotation vectors (N, 3), the first zero, and the nearness."""
        return np.concatenate([np.zeros((1, 3)), guess[:-1].reshape(-1, 3)]), float(guess[-1])

    def logarithm(self, index: int, vector: np.ndarray, near: float) -> np.ndarray:
        view = self.views[index].turned(rotation_from_vector(vector))
        return np.log(luminance(view.look_up(self.directions, near)[0]) + 1e-9)

    def logarithms(self, vectors: np.ndarray, near: float) -> np.ndarray:
        return np.stack([self.logarithm(i, v, near) for i, v in enumerate(vectors)])

    def offsets(self, seen: np.ndarray) -> np.ndarray:
        """(N,) ln of how much brighter each view is than the first, where both show the directions well."""
        both = np.minimum(self.shares, self.shares[0])
        offsets = [0.0]
        for index in range(1, len(seen)):
            usable = both[index] >= np.median(both[index])
            offsets.append(float(np.median((seen[index] - seen[0])[usable])))
        return np.array(offsets)

    def misfits(self, seen: np.ndarray) -> np.ndarray:
        level = seen - self.offsets(seen)[:, None]
        mean = (self.shares * level).sum(0)
        return (np.sqrt(self.shares) * (level - mean)).ravel()

    def likeness(self, seen: np.ndarray, index: int) -> float:
        """The correlation of a view with the mean of all others; 1 in light that is the same all round."""
        others = np.delete(np.arange(len(seen)), index)
        shares = self.shares[others]
        total = shares.sum(0)
        mean = (shares * (seen - self.offsets(seen)[:, None])[others]).sum(0) / np.maximum(total, 1e-12)
        usable = np.minimum(self.shares[index], total) > 0.02
        if usable.sum() < 100:
            return 0.0
        ours, theirs = seen[index][usable], mean[usable]
        if min(np.std(ours), np.std(theirs)) < EVEN_LIGHT:
            return 1.0
        return float(np.corrcoef(ours, theirs)[0, 1])

    def solved(self, starts: np.ndarray, limit: float) -> OptimizeResult:
        free = 3 * (len(self.views) - 1)
        bounds = [(-limit,) * free + (0.0,), (limit,) * free + (NEAREST,)]
        start = np.array([*starts[1:].ravel(), 0.01])

        def misfit(guess: np.ndarray) -> np.ndarray:
            return self.misfits(self.logarithms(*self.parts(guess)))

        def slopes(guess: np.ndarray) -> np.ndarray:
            # Each turn moves one view alone, so that only this one is looked up again.
            vectors, near = self.parts(guess)
            seen = self.logarithms(vectors, near)
            base, columns = self.misfits(seen), []
            for place in range(free):
                step = np.zeros_like(vectors)
                step[1 + place // 3, place % 3] = STEP
                moved = seen.copy()
                moved[1 + place // 3] = self.logarithm(1 + place // 3, (vectors + step)[1 + place // 3], near)
                columns.append((self.misfits(moved) - base) / STEP)
            further = near + STEP / 4
            columns.append((self.misfits(self.logarithms(vectors, further)) - base) / (STEP / 4))
            return np.stack(columns, axis=1)

        return least_squares(
            misfit, start, jac=slopes, bounds=bounds, loss="soft_l1", f_scale=0.1, x_scale=0.02, xtol=1e-5, ftol=1e-6,
            max_nfev=40,
        )  # pyright: ignore[reportArgumentType] # fmt: skip


STEP = 1e-3
"""Radians by which views are turned to see how the misfit changes: a third of a pixel of a ball of 600 pixels."""
