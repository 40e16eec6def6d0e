"""Which way is up in a photograph, found from its own straight edges: a Manhattan world (Coughlan & Yuille 1999).

What people build and furnish runs along three directions at right angles, one of them upright. The straight edges of a
photograph vote for the turn of the camera whose three vanishing points they run towards; a weak prior says that
photographers hold the horizon level and look a little down at what stands on a table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose_from_ball import up_of
from relume.sphere.directions import angle_between, normalised

SIDE = 1400
"""Longer side, pixels, of the picture in which edges are sought: finer ones are noise and grain."""
SHORTEST = 0.02
"""Of the picture's diagonal: shorter edges point nowhere well enough."""
MOST = 800
"""Edges that vote, the longest."""
TOLERANCE = np.radians(1.2)
"""By which an edge may miss a vanishing point; beyond twice that it does not vote."""
LOWEST, HIGHEST, LEAN = np.radians(-20), np.radians(80), np.radians(8)
"""How far up and down cameras look, and how far they lean, that are tried."""
USUAL, SPREAD, UPRIGHT = np.radians(22), np.radians(25), np.radians(2.5)
"""The prior: photographers look down at a table by 22° ± 25°, and lean by no more than ± 2.5°."""
PRIOR = 0.15
"""What the prior weighs against the edges, as a share of their votes: enough to choose between rivals, no more."""
LEAST_SHARE = 0.3
"""Share of the edges' length that must run along the three directions: chance gives about a fifth."""
ROUNDS, STEP = 8, 1e-4
"""Of the fit, and radians over which its slopes are taken."""
RIVAL_APART = np.radians(6)
"""Two turns whose up differs by more are two answers."""
LEAST_LEAD = 0.06
"""By what share the best answer must lead the next."""


@dataclass(frozen=True)
class Horizon:
    """How the camera was held.

    pitch : how far it looked down, radians
    roll : how far it leant, radians; see `up_of`
    share : of the edges' length that agrees
    deviation : of the pitch, radians, by how the votes fall off
    """

    pitch: float
    roll: float
    share: float
    deviation: float

    @property
    def up(self) -> np.ndarray:
        """(3,) in the camera's coordinates."""
        return up_of(self.pitch, self.roll)


def find_horizon(radiance: np.ndarray, lens: Camera) -> Horizon | None:
    """How the camera was held that took a picture, or None where its edges do not say.

    radiance : (H, W, 3), of the lens's size
    lens : its pose does not matter
    """
    segments = straight_edges(radiance)
    if len(segments) < 12:
        return None
    return horizon_of(segments, lens)


def straight_edges(radiance: np.ndarray) -> np.ndarray:
    """The picture's longest straight edges (N, 2, 2), pixels from the corner (LSD: Grompone von Gioi et al. 2010)."""
    import cv2

    scale = min(1.0, SIDE / max(radiance.shape))
    small = radiance
    if scale < 1:
        small = cv2.resize(radiance, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    light = luminance(small).astype(np.float32)
    # In the logarithm an edge in the shade is as strong as one in the light.
    low, high = np.percentile(light[light > 0], (2, 98)) if (light > 0).any() else (1.0, 2.0)
    level = np.log(np.clip(light, low, high) / low) / max(float(np.log(high / low)), 1e-6)
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(np.rint(255 * level).astype(np.uint8))[0]
    if found is None:
        return np.empty((0, 2, 2))
    segments = (found.reshape(-1, 2, 2).astype(np.float64) + 0.5) / scale
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=-1)
    chosen = np.argsort(-lengths)[:MOST]
    chosen = chosen[lengths[chosen] > SHORTEST * np.hypot(*radiance.shape[:2])]
    return segments[chosen]


@dataclass(frozen=True, eq=False)
class _Edges:
    """Straight edges as planes through the camera.

    normals : (N, 3) of the planes, in the camera's coordinates
    weights : (N,) shares of the whole length
    """

    normals: np.ndarray
    weights: np.ndarray

    @staticmethod
    def of(segments: np.ndarray, lens: Camera) -> _Edges:
        rays = lens.rays_through(segments) @ lens.rotation
        lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=-1)
        return _Edges(normalised(np.cross(rays[:, 0], rays[:, 1])), lengths / lengths.sum())

    def votes(self, pitch: float, roll: float, headings: np.ndarray) -> np.ndarray:
        """(H,) the share of the edges' length that runs along the axes of a turn, near misses counting less."""
        axes = _axes(pitch, roll)
        upright, first, second = (self.normals @ axis for axis in axes)
        cosine, sine = np.cos(headings), np.sin(headings)
        across = np.abs(first[:, None] * cosine + second[:, None] * sine)
        along = np.abs(second[:, None] * cosine - first[:, None] * sine)
        missed = np.minimum(np.minimum(across, along), np.abs(upright)[:, None])
        return self.weights @ np.maximum(1 - (missed / (2 * TOLERANCE)) ** 2, 0)

    def fitted(self, turn: np.ndarray) -> tuple[np.ndarray, float]:
        """The turn (pitch, roll, heading) fitted to the edges that agree with one, by least squares, and the standard
        deviation of its pitch, radians."""
        spread, curvature = np.pi, np.eye(3)
        for _ in range(ROUNDS):
            here = self._missed(turn)
            nearest = np.argmin(np.abs(here), axis=1)
            rows = np.flatnonzero(np.abs(here).min(1) < 2 * TOLERANCE)
            if len(rows) < 3:
                break
            here, weight = here[rows, nearest[rows]], self.weights[rows] / self.weights[rows].sum()
            slopes = np.stack(
                [(self._missed(turn + STEP * e)[rows, nearest[rows]] - here) / STEP for e in np.eye(3)], axis=1
            )
            curvature = slopes.T @ (weight[:, None] * slopes)
            turn = turn - np.linalg.pinv(curvature) @ (slopes.T @ (weight * here))
            # Edges of one thing err together: a tenth of them count as independent.
            spread = float(weight @ here**2) / max(len(rows) / 10 - 3, 1)
        return turn, float(np.sqrt(np.linalg.pinv(curvature)[0, 0] * spread))

    def _missed(self, turn: np.ndarray) -> np.ndarray:
        """(N, 3) by how much each edge misses each axis of a turn, radians, signed."""
        pitch, roll, heading = turn.tolist()
        upright, first, second = _axes(pitch, roll)
        across = np.cos(heading) * first + np.sin(heading) * second
        along = np.cos(heading) * second - np.sin(heading) * first
        return np.stack([self.normals @ axis for axis in (upright, across, along)], axis=1)


def _axes(pitch: float, roll: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Up, and two level directions at right angles, the first to the camera's right; in its coordinates."""
    up = up_of(pitch, roll)
    right = normalised(np.array([1.0, 0.0, 0.0]) - up[0] * up)
    return up, right, np.cross(right, up)


def _likely(pitch: float, roll: float) -> float:
    """The prior's vote."""
    return PRIOR * float(np.exp(-0.5 * ((pitch - USUAL) / SPREAD) ** 2 - 0.5 * (roll / UPRIGHT) ** 2))


def horizon_of(segments: np.ndarray, lens: Camera) -> Horizon | None:
    """How the camera was held by straight edges (N, 2, 2), pixels; None where they do not say.

    lens : its pose does not matter
    """
    from scipy.optimize import minimize

    edges = _Edges.of(segments, lens)
    # Every turn of a coarse grid, whose steps are within reach of the tolerance.
    pitches, rolls = np.arange(LOWEST, HIGHEST, np.radians(1.5)), np.arange(-LEAN, LEAN + 1e-9, np.radians(2))
    headings = np.arange(0, np.pi / 2, np.radians(1.5))
    tried: list[tuple[float, float, float, float]] = []
    for pitch in pitches:
        for roll in rolls:
            votes = edges.votes(float(pitch), float(roll), headings)
            index = int(np.argmax(votes))
            tried.append((float(votes[index]) + _likely(pitch, roll), float(pitch), float(roll), headings[index]))
    tried.sort(key=lambda each: -each[0])

    # The best, refined; and the best of those whose up lies elsewhere.
    def refined(start: tuple[float, float, float, float]) -> tuple[float, np.ndarray]:
        found = minimize(
            lambda v: -float(edges.votes(v[0], v[1], v[2:])[0]) - _likely(v[0], v[1]), np.array(start[1:]),
            method="Nelder-Mead", options={"initial_simplex": np.array(start[1:]) + np.vstack(
                [np.zeros(3), np.radians(1.0) * np.eye(3)]), "xatol": 1e-4, "fatol": 1e-5, "maxiter": 300},
        )  # fmt: skip
        return -float(found.fun), found.x

    score, turn = refined(tried[0])
    start = up_of(*turn[:2])
    turn, deviation = edges.fitted(turn)
    up = up_of(*turn[:2])
    # A fit that runs away from what was voted for is one of chance: nothing holds it.
    if float(angle_between(up, start)) > RIVAL_APART / 2 or abs(turn[1]) > 1.5 * LEAN:
        return None
    others = [each for each in tried if angle_between(up, up_of(each[1], each[2])) > RIVAL_APART]
    share = float(edges.votes(turn[0], turn[1], turn[2:])[0])
    if share < LEAST_SHARE:
        return None
    if others:
        rival, other = refined(others[0])
        apart = float(angle_between(up, up_of(*other[:2])))
        if apart > RIVAL_APART and rival > (1 - LEAST_LEAD) * score:
            deviation = max(deviation, apart)
    return Horizon(float(turn[0]), float(turn[1]), share, deviation)
