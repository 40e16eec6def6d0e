"""Residuals of a whole place and their Jacobian, in the order of its unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.scene.places.quantities import Model
from relume.scene.places.sightings import (
    Sightings,
    corner_errors,
    derivatives,
    in_camera,
    line_errors,
    nearest_chords,
    rotation_of,
)


@dataclass(frozen=True, eq=False)
class View:
    """A photograph's camera as the fit starts.

    rotation : (3, 3) world-from-camera; position : (3,) metres; focal : pixels
    lens : the number of the lens whose focal length is sought, or None where it is given
    """

    rotation: np.ndarray
    position: np.ndarray
    focal: float
    lens: int | None


@dataclass(frozen=True, eq=False)
class Distance:
    """A measured distance between two points of blocks: factors (3, 1 + lengths) and turns of both, metres."""

    a: np.ndarray
    b: np.ndarray
    turns: tuple[int, int]
    metres: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Fit:
    """The problem: unknown lengths, unknown turns, then six numbers a camera, then the lenses' logarithms of focal
    length.

    seen : (N, 2) and corner_seen (M, 2), straightened, x right and y up from the principal points, pixels
    deviation : of a mark, pixels
    priors : (lens, logarithm of focal length, its deviation) of those that files give nearly
    """

    model: Model
    marks: Sightings
    seen: np.ndarray
    corner_seen: np.ndarray
    views: tuple[View, ...]
    distances: tuple[Distance, ...]
    deviation: float
    priors: tuple[tuple[int, float, float], ...]
    lenses: int

    @property
    def unknown_turns(self) -> tuple[int, ...]:
        return tuple(i for i, turn in enumerate(self.model.turns) if turn.angle is None)

    @property
    def first_camera(self) -> int:
        """Where the cameras' numbers begin."""
        return len(self.model.lengths) + len(self.unknown_turns)

    @property
    def first_lens(self) -> int:
        return self.first_camera + 6 * len(self.views)

    @property
    def count(self) -> int:
        return self.first_lens + self.lenses

    def angles(self, values: np.ndarray) -> np.ndarray:
        """Of every turn, radians."""
        found = np.array([0.0 if turn.angle is None else turn.angle for turn in self.model.turns])
        found[list(self.unknown_turns)] = values[len(self.model.lengths) : self.first_camera]
        return found

    def cameras(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotation vectors and positions (K, 3), and focal lengths (K,)."""
        six = values[self.first_camera : self.first_lens].reshape(-1, 6)
        logs = values[self.first_lens :]
        focal = np.array([v.focal if v.lens is None else np.exp(logs[v.lens]) for v in self.views])
        return six[:, :3], six[:, 3:], focal

    def rotations(self, values: np.ndarray) -> np.ndarray:
        """(K, 3, 3) world-from-camera."""
        return np.stack([v.rotation for v in self.views]) @ rotation_of(self.cameras(values)[0])

    def start(self, lengths: np.ndarray, turns: Sequence[float], focal: Sequence[float]) -> np.ndarray:
        """The unknowns where the views have them; focal : pixels of each lens."""
        six = np.concatenate([np.concatenate([np.zeros(3), v.position]) for v in self.views])
        return np.concatenate([lengths, np.asarray(turns, np.float64), six, np.log(np.asarray(focal, np.float64))])

    def errors(self, values: np.ndarray) -> np.ndarray:
        """All residuals, each in its standard deviation."""
        return self._evaluated(values, False)[0]

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """(residuals, unknowns)."""
        return self._evaluated(values, True)[1]

    def _evaluated(self, values: np.ndarray, wanted: bool) -> tuple[np.ndarray, np.ndarray]:
        one = np.concatenate([[1.0], values[: len(self.model.lengths)]])
        angles, (turned, position, focal) = self.angles(values), self.cameras(values)
        start = np.stack([v.rotation for v in self.views])
        rows, slopes = [], []

        # Points on edges.
        marks = self.marks
        upright = about_y(angles[marks.turn])
        ends = self._chords(one, upright, values)
        k = marks.photograph
        a, b = (np.einsum("nij,nj->ni", upright, ends[:, i] @ one) for i in (0, 1))
        arguments: list[np.ndarray] = [a, b, turned[k], position[k], focal[k]]
        rows.append(line_errors(a, b, turned[k], position[k], focal[k], start[k], self.seen) / self.deviation)
        if wanted:
            by = derivatives(line_errors, arguments, start[k], self.seen)
            slope = np.zeros((len(k), self.count))
            for by_point, factors in ((by[0], ends[:, 0]), (by[1], ends[:, 1])):
                self._by_point(slope, by_point, factors, marks.turn, angles, one)
            self._by_camera(slope, by[2:], k, focal)
            slopes.append(slope / self.deviation)

        # Corners, x then y.
        k, factors = marks.corner_photograph, marks.corner_points
        if len(k):
            a = np.einsum("nij,nj->ni", about_y(angles[marks.corner_turn]), factors @ one)
            arguments = [a, turned[k], position[k], focal[k]]
            rows.append(corner_errors(a, turned[k], position[k], focal[k], start[k], self.corner_seen) / self.deviation)
            if wanted:
                by = derivatives(corner_errors, arguments, start[k], self.corner_seen)
                slope = np.zeros((2 * len(k), self.count))
                twice = [np.concatenate([each, each]) for each in (factors, marks.corner_turn, k)]
                self._by_point(slope, by[0], twice[0], twice[1], angles, one)
                self._by_camera(slope, by[1:], twice[2], focal)
                slopes.append(slope / self.deviation)

        # Measured distances, and focal lengths that files give.
        for distance in self.distances:
            turns = np.array(distance.turns)
            points = np.einsum("nij,nj->ni", about_y(angles[turns]), np.stack([distance.a, distance.b]) @ one)
            apart = points[1] - points[0]
            length = float(np.linalg.norm(apart))
            rows.append(np.array([(length - distance.metres) / distance.deviation]))
            if wanted:
                slope, unit = np.zeros((1, self.count)), apart[None] / max(length, 1e-12)
                self._by_point(slope, -unit, distance.a[None], turns[:1], angles, one)
                self._by_point(slope, unit, distance.b[None], turns[1:], angles, one)
                slopes.append(slope / distance.deviation)
        for lens, logarithm, deviation in self.priors:
            rows.append(np.array([(values[self.first_lens + lens] - logarithm) / deviation]))
            if wanted:
                slope = np.zeros((1, self.count))
                slope[0, self.first_lens + lens] = 1 / deviation
                slopes.append(slope)
        return np.concatenate(rows), np.concatenate(slopes) if wanted else np.empty((0, 0))

    def _by_point(
        self, slope: np.ndarray, by: np.ndarray, factors: np.ndarray, turn: np.ndarray, angles: np.ndarray,
        one: np.ndarray,
    ) -> None:  # fmt: skip
        """Add what the derivatives by world points (N, 3) make of the lengths and the turns."""
        local = np.einsum("ni,nij->nj", by, about_y(angles[turn]))
        slope[:, : len(self.model.lengths)] += np.einsum("ni,nip->np", local, factors[..., 1:])
        along = np.einsum("ni,nij,nj->n", by, about_y(angles[turn], slope=True), factors @ one)
        for number, unknown in enumerate(self.unknown_turns):
            slope[:, len(self.model.lengths) + number] += np.where(turn == unknown, along, 0.0)

    def _by_camera(self, slope: np.ndarray, by: Sequence[np.ndarray], k: np.ndarray, focal: np.ndarray) -> None:
        columns = self.first_camera + 6 * k[:, None] + np.arange(6)
        np.put_along_axis(slope, columns, np.concatenate(by[:2], axis=1), axis=1)
        for row, number in enumerate(k):
            if (lens := self.views[number].lens) is not None:
                slope[row, self.first_lens + lens] += by[2][row, 0] * focal[number]

    def _chords(self, one: np.ndarray, upright: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The factors of the edges' ends, of each point on a curve those of the chord next to it."""
        ends = self.marks.ends
        if not self.marks.curves:
            return ends
        ends = ends.copy()
        turned, position, focal = self.cameras(values)
        start = np.stack([v.rotation for v in self.views])
        for curve in self.marks.curves:
            k = int(self.marks.photograph[curve.rows[0]])
            points = (curve.chain @ one) @ upright[curve.rows[0]].T
            many = len(points)
            local = in_camera(points, np.repeat(start[k : k + 1], many, 0), np.repeat(turned[k : k + 1], many, 0),
                              np.repeat(position[k : k + 1], many, 0))  # fmt: skip
            with np.errstate(divide="ignore", invalid="ignore"):
                shown = focal[k] * local[:, :2] / -local[:, 2:]
            nearest = nearest_chords(shown, self.seen[curve.rows])
            ends[curve.rows, 0], ends[curve.rows, 1] = curve.chain[nearest], curve.chain[nearest + 1]
        return ends


def about_y(angles: np.ndarray, *, slope: bool = False) -> np.ndarray:
    """Rotations (N, 3, 3) about +Y, or their derivatives by the angle."""
    cos, sin = (-np.sin(angles), np.cos(angles)) if slope else (np.cos(angles), np.sin(angles))
    zero, one = np.zeros_like(cos), np.zeros_like(cos) if slope else np.ones_like(cos)
    return np.stack(
        [np.stack([cos, zero, sin], -1), np.stack([zero, one, zero], -1), np.stack([-sin, zero, cos], -1)], -2
    )
