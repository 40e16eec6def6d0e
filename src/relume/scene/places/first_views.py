"""Where a place's cameras and sizes start: turns from vanishing lines, then positions and sizes by linear equations.

With a camera's rotation known, each marked edge lies in the plane through the lens and its two marked points, which is
linear in the camera's position and in the sizes (Debevec, Taylor & Malik 1996, §2.4.3; Taylor & Kriegman 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from relume.scene.cameras.vanishing_lines import AXES, AxisLines, turn_from_lines
from relume.scene.places.fitting import Distance, about_y
from relume.scene.places.quantities import Model
from relume.scene.places.sightings import Sightings
from relume.sphere.directions import normalised

DOUBTFUL = 0.15
"""Of a focal length, the share of deviation from which on that of the other photographs is the better start."""
FIELD = 1.2
"""Focal length in picture widths where nothing gives one: between a telephone's and a normal lens."""
PRIOR = 1e-4
"""Weight of sizes near the known ones: decides only what no mark does."""
CURVED = 0.01
"""Weight of curved edges against straight ones: they are met only nearly, so that they decide what those leave open."""
TOGETHER = 4
"""Photographs whose half turns are tried all at once; others join one by one."""
BEHIND = 10.0
"""Cost of a mark behind its camera, or of a negative size: more than any angle."""
STEPS = 72
"""Turns that are tried for a block whose turn is unknown: every 5°."""
HALF_TURN = np.diag([-1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Lens:
    """What is known of a photograph's lens: size and principal point, pixels, and the focal length or None."""

    size: tuple[int, int]
    centre: tuple[float, float]
    focal: float | None


@dataclass(frozen=True, eq=False)
class Start:
    """First values: sizes, turns of the unknown ones, rotations (K, 3, 3), positions (K, 3), focal lengths."""

    lengths: np.ndarray
    turns: tuple[float, ...]
    rotations: np.ndarray
    positions: np.ndarray
    focal: tuple[float, ...]


def first_views(
    model: Model, marks: Sightings, seen: np.ndarray, lenses: Sequence[Lens], names: Sequence[str],
    distances: Sequence[Distance],
) -> Start:  # fmt: skip
    """Find cameras and sizes near those that fit; raises ValueError naming a photograph whose edges show no turn.

    seen : (N, 2) marked points on edges, straightened, x right and y up from the principal point, pixels
    """
    focal, rotations = _turns(model, marks, seen, lenses, names)
    angles = np.array([0.0 if turn.angle is None else turn.angle for turn in model.turns])
    known = np.array([turn.angle is not None for turn in model.turns])
    rays = np.column_stack([seen, -np.array(focal)[marks.photograph]])

    # Which way along its axis each edge runs is not seen: half a turn about +Y remains, and is tried.
    order = sorted(range(len(lenses)), key=lambda k: -int(np.sum(marks.photograph == k)))
    flips: dict[int, bool] = {}
    while order:
        joining, order = (order[:TOGETHER], order[TOGETHER:]) if not flips else (order[:1], order[1:])
        best = None
        for choice in product([False, True], repeat=len(joining)):
            tried = flips | dict(zip(joining, choice, strict=True))
            found = _solved(model, marks, rays, rotations, tried, angles, known, distances)
            if best is None or found[0] < best[0]:
                best = (found[0], tried)
        assert best is not None
        flips = best[1]

    # Blocks whose turn is unknown, one after the other.
    turns = []
    for unknown in np.flatnonzero(~known):
        costs = []
        for angle in np.linspace(-np.pi, np.pi, STEPS, endpoint=False):
            angles[unknown] = angle
            now = known | (np.arange(len(known)) == unknown)
            costs.append((_solved(model, marks, rays, rotations, flips, angles, now, distances)[0], float(angle)))
        angles[unknown] = min(costs)[1]
        known[unknown] = True
        turns.append(float(angles[unknown]))
    _, lengths, positions = _solved(model, marks, rays, rotations, flips, angles, known, distances)
    turned = np.stack([HALF_TURN @ r if flips[k] else r for k, r in enumerate(rotations)])
    return Start(lengths, tuple(turns), turned, positions, tuple(focal))


def _turns(
    model: Model, marks: Sightings, seen: np.ndarray, lenses: Sequence[Lens], names: Sequence[str]
) -> tuple[list[float], list[np.ndarray]]:
    """Focal lengths and rotations, up to half a turn, from edges along the frame's axes."""
    straight = np.array([turn.angle is not None and turn.angle == 0 for turn in model.turns])
    found: list[tuple[float | None, AxisLines]] = []
    for k, lens in enumerate(lenses):
        pairs = [pair for pair in marks.segments if marks.photograph[pair[0]] == k]
        pairs = [pair for pair in pairs if straight[marks.turn[pair[0]]] and not np.isnan(marks.directions[pair[0], 0])]
        sets: list[list[np.ndarray]] = [[], [], []]
        for pair in pairs:
            points = lens.centre + seen[pair] * [1, -1]
            if np.linalg.norm(points[1] - points[0]) >= 2:
                sets[int(np.argmax(np.abs(marks.directions[pair[0]])))].append(points)
        if sum(bool(each) for each in sets) < 2:
            there = " and ".join(AXES[axis] for axis in range(3) if sets[axis]) or "none"
            raise ValueError(
                f"photograph {names[k]!r} shows edges along {there} of the axes only; mark two points on edges along "
                "two axes or more, two edges along one of them"
            )
        x, y, z = (np.array(each).reshape(-1, 2, 2) for each in sets)
        lines = AxisLines(x, y, z)
        focal = lens.focal
        if focal is None:
            try:
                focal, _, spread = turn_from_lines(lens.size, lines, None, lens.centre)
                focal = focal if spread <= DOUBTFUL and 0.2 < focal / max(lens.size) < 20 else None
            except ValueError:
                focal = None
        found.append((focal, lines))
    shares = [focal / max(lens.size) for (focal, _), lens in zip(found, lenses, strict=True) if focal is not None]
    usual = float(np.median(shares)) if shares else FIELD
    focals, rotations = [], []
    for name, lens, (focal, lines) in zip(names, lenses, found, strict=True):
        focals.append(usual * max(lens.size) if focal is None else focal)
        try:
            rotations.append(turn_from_lines(lens.size, lines, focals[-1], lens.centre)[1])
        except ValueError as error:
            raise ValueError(f"photograph {name!r}: the edges do not show how the camera was turned: {error}") from None
    return focals, rotations


def _solved(
    model: Model, marks: Sightings, rays: np.ndarray, rotations: Sequence[np.ndarray], flips: dict[int, bool],
    angles: np.ndarray, known: np.ndarray, distances: Sequence[Distance],
) -> tuple[float, np.ndarray, np.ndarray]:  # fmt: skip
    """Cost, sizes and positions (K, 3) by linear least squares, from the photographs in `flips`."""
    pairs = np.array([p for p in marks.segments if marks.photograph[p[0]] in flips and known[marks.turn[p[0]]]], int)
    count, cameras = len(model.lengths), len(rotations)
    if not len(pairs):
        return np.inf, np.ones(count), np.zeros((cameras, 3))
    k = marks.photograph[pairs[:, 0]]
    turned = np.stack([HALF_TURN @ r if flips.get(i, False) else r for i, r in enumerate(rotations)])
    world = np.einsum("nij,npj->npi", turned[k], normalised(rays[pairs]))
    normals = normalised(np.cross(world[:, 0], world[:, 1]))
    upright = about_y(angles[marks.turn[pairs[:, 0]]])
    # Both ends of the edge lie in the plane of its two rays.
    scale, free = _scale(model)
    rows, right = [], []
    for end in (0, 1):
        factors = np.einsum("nij,njp->nip", upright, marks.ends[pairs[:, 0], end])
        _add_planes(rows, right, normals, factors, k, cameras)
    for curve in marks.curves:
        first = curve.rows[0]
        if marks.photograph[first] in flips and known[marks.turn[first]]:
            camera, turn = int(marks.photograph[first]), about_y(angles[marks.turn[first]][None])[0]
            planes, factors = _curve_planes(rays[curve.rows], turn @ curve.chain, turned[camera], scale)
            _add_planes(rows, right, CURVED * planes, factors, np.full(len(planes), camera), cameras)
    prior = PRIOR * np.eye(count + 3 * cameras)
    prior_right = np.concatenate([np.full(count, PRIOR * scale), np.zeros(3 * cameras)])
    if free:  # no size is given: their mean is one, until a measured distance sets it
        rows.append(np.concatenate([np.ones(count), np.zeros(3 * cameras)])[None])
        right.append(np.array([float(count)]))
    matrix, wanted = np.concatenate([*rows, prior]), np.concatenate([*right, prior_right])
    values = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    lengths, positions = values[:count], values[count:].reshape(-1, 3)
    if free:
        factor = _rescaling(lengths, angles, distances)
        lengths, positions = lengths * factor, positions * factor

    # As angles at the camera, so that a place that shrinks to nothing is no better.
    one = np.concatenate([[1.0], lengths])
    cost = 0.0
    for end in (0, 1):
        points = np.einsum("nij,nj->ni", upright, marks.ends[pairs[:, 0], end] @ one)
        away = points - positions[k]
        cost += float(np.sum((np.sum(normals * away, -1) / np.maximum(np.linalg.norm(away, axis=-1), 1e-9)) ** 2))
        depth = -np.einsum("ni,ni->n", away, turned[k][:, :, 2])
        cost += BEHIND * float(np.mean(depth <= 0))
    sizes = [model.row(q) @ one for block in model.blocks for q in block.size]
    return cost + BEHIND * float(np.mean(np.array(sizes) < 0)), lengths, positions


def _add_planes(
    rows: list[np.ndarray], right: list[np.ndarray], normals: np.ndarray, factors: np.ndarray, k: np.ndarray,
    cameras: int,
) -> None:  # fmt: skip
    """Add equations: world points, factors (N, 3, 1 + lengths), lie in planes (N, 3) through the cameras k (N,)."""
    along = np.einsum("ni,nip->np", normals, factors)
    block = np.zeros((len(k), along.shape[1] - 1 + 3 * cameras))
    block[:, : along.shape[1] - 1] = along[:, 1:]
    np.put_along_axis(block, along.shape[1] - 1 + 3 * k[:, None] + np.arange(3), -normals, axis=1)
    rows.append(block)
    right.append(-along[:, 0])


def _curve_planes(
    rays: np.ndarray, chain: np.ndarray, rotation: np.ndarray, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Planes (3, 3) through the camera and the points, factors (3, 3, 1 + lengths), that lie in them nearly.

    Which point of a curve a mark shows is not known before its size is; the outermost marks to the left and to the
    right are about its outermost points, and the marks lie on the mean about as high as its points.
    """
    across = (chain @ np.array([1.0, *np.full(chain.shape[2] - 1, scale)])) @ rotation[:, 0]
    left, right = int(np.argmin(rays[:, 0])), int(np.argmax(rays[:, 0]))
    planes = np.stack([
        np.cross(rays[left], [0.0, 1.0, 0.0]), np.cross(rays[right], [0.0, 1.0, 0.0]),
        np.cross(rays.mean(0), [1.0, 0.0, 0.0]),
    ])  # fmt: skip
    points = np.stack([chain[int(np.argmin(across))], chain[int(np.argmax(across))], chain.mean(0)])
    return normalised(planes) @ rotation.T, points


def _scale(model: Model) -> tuple[float, bool]:
    """A usual size, metres, and whether only measured distances set the scale."""
    given = [abs(q.constant) for block in model.blocks for q in (*block.size, *block.low) if q.constant]
    if given:
        return float(np.median(given)), False
    return 1.0, True


def _rescaling(lengths: np.ndarray, angles: np.ndarray, distances: Sequence[Distance]) -> float:
    one = np.concatenate([[0.0], lengths])
    factors = []
    for distance in distances:
        upright = about_y(angles[list(distance.turns)])
        apart = upright[1] @ (distance.b @ one) - upright[0] @ (distance.a @ one)
        factors.append(distance.metres / max(float(np.linalg.norm(apart)), 1e-9))
    return float(np.median(factors)) if factors else 1.0
