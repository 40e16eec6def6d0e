"""What was marked in photographs, and how far the marks lie from the model's edges, with exact derivatives.

A marked point of an edge misses by its distance from the projected edge's line (Debevec, Taylor & Malik 1996, §2.4.1,
whose integral along the marked segment is a sum over its points here: then an error's deviation is that of a mark).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from relume.scene.places.place_tables import PlaceTables, require_known
from relume.scene.places.quantities import Model

STEP = 1e-30
"""Of the imaginary part, by which an analytic function's derivative is exact to rounding (Squire & Trapp 1998)."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A marked edge that is not straight.

    rows : which of the line marks are its points
    chain : (K, 3, 1 + lengths) factors of the points along it
    """

    rows: np.ndarray
    chain: np.ndarray


@dataclass(frozen=True, eq=False)
class Sightings:
    """Marked points, N on edges and M at corners.

    photograph, turn : (N,) numbers of the photograph and of the block's turn
    pixels : (N, 2), from the upper left corner
    ends : (N, 2, 3, 1 + lengths) factors of the edge's two ends; of a curve those of the chord that is nearest
    segments : pairs of rows that span a straight edge, the farthest two points of each mark
    directions : (N, 3) the unit vector along the edge in its frame, NaN where it hangs on unknown sizes
    corner_… : the same of the corners
    labels : of each of the N + M points, for messages
    """

    photograph: np.ndarray
    turn: np.ndarray
    pixels: np.ndarray
    ends: np.ndarray
    segments: np.ndarray
    directions: np.ndarray
    corner_photograph: np.ndarray
    corner_turn: np.ndarray
    corner_pixels: np.ndarray
    corner_points: np.ndarray
    labels: tuple[str, ...]
    curves: tuple[Curve, ...] = field(default=())


def sightings(tables: PlaceTables, model: Model) -> Sightings:
    """The marks of a place file; raises ValueError naming an edge or corner that its block does not have."""
    names = [photograph.name for photograph in tables.photographs]
    index = {block.name: i for i, block in enumerate(model.blocks)}
    lines: list[tuple[int, int, tuple[float, float], np.ndarray, np.ndarray, str]] = []
    corners: list[tuple[int, int, tuple[float, float], np.ndarray, str]] = []
    segments, curves = [], []
    for photograph, marked in tables.marks.items():
        for block_name, edges in marked.items():
            b = index[block_name]
            block = model.blocks[b]
            for edge, points in edges.items():
                where = f"marks.{photograph}.{block_name}.{edge}"
                require_known(
                    edge, [*block.body.edges, *block.body.corners], where, f"edge or corner of a {block.kind}"
                )
                label, of = f"{block_name}.{edge} in {photograph!r}", (names.index(photograph), block.turn)
                if edge in block.body.corners:
                    if len(points) != 1:
                        raise ValueError(f"{where}: {len(points)} points; a corner is one point")
                    corners.append((*of, points[0], model.points(b, [block.body.corners[edge]])[0], label))
                    continue
                chain = model.points(b, block.body.edges[edge])
                straight = len(chain) == 2
                rows = np.arange(len(lines), len(lines) + len(points))
                along = np.diff(block.body.vertices[list(block.body.edges[edge][:2])], axis=0)[0]
                # Along an axis the direction is known before the sizes are.
                direction = along if straight and np.count_nonzero(along) == 1 else np.full(3, np.nan)
                lines += [(*of, point, chain[:2], direction, label) for point in points]
                if straight and len(points) > 1:
                    segments.append(rows[list(_farthest(np.array(points)))])
                elif not straight:
                    curves.append(Curve(rows, chain))
    size = 1 + len(model.lengths)
    return Sightings(
        np.array([line[0] for line in lines], int), np.array([line[1] for line in lines], int),
        np.array([line[2] for line in lines], np.float64).reshape(-1, 2),
        np.array([line[3] for line in lines], np.float64).reshape(-1, 2, 3, size),
        np.array(segments, int).reshape(-1, 2),
        np.array([line[4] for line in lines], np.float64).reshape(-1, 3),
        np.array([corner[0] for corner in corners], int), np.array([corner[1] for corner in corners], int),
        np.array([corner[2] for corner in corners], np.float64).reshape(-1, 2),
        np.array([corner[3] for corner in corners], np.float64).reshape(-1, 3, size),
        tuple([line[5] for line in lines] + [corner[4] for corner in corners]), tuple(curves),
    )  # fmt: skip


def _farthest(points: np.ndarray) -> tuple[int, int]:
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    a, b = np.unravel_index(int(np.argmax(apart)), apart.shape)
    return (int(a), int(b)) if a != b else (0, 1)


def rotation_of(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices (…, 3, 3) of rotation vectors (…, 3), which may be complex."""
    square = np.sum(vectors * vectors, axis=-1)
    small = np.abs(square) < 1e-8
    angle = np.sqrt(np.where(small, 1.0, square))
    first = np.where(small, 1 - square / 6, np.sin(angle) / angle)[..., None, None]
    second = np.where(small, 0.5 - square / 24, (1 - np.cos(angle)) / angle**2)[..., None, None]
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    zero = np.zeros_like(x)
    cross = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2)
    return np.eye(3) + first * cross + second * (cross @ cross)


def in_camera(points: np.ndarray, start: np.ndarray, turned: np.ndarray, position: np.ndarray) -> np.ndarray:
    """World points (N, 3) in the cameras' axes, right, up and backward.

    start : (N, 3, 3) world-from-camera rotations; turned : (N, 3) rotation vectors in the camera that follow them
    """
    first = np.einsum("nji,nj->ni", start, points - position)
    return np.einsum("nji,nj->ni", rotation_of(turned), first)


def line_errors(
    a: np.ndarray, b: np.ndarray, turned: np.ndarray, position: np.ndarray, focal: np.ndarray, start: np.ndarray,
    seen: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Signed distances (N,), pixels, of points (N, 2) from the projected lines through world points a and b (N, 3).

    focal : (N,) pixels; seen : x right and y up from the principal point
    """
    normal = np.cross(in_camera(a, start, turned, position), in_camera(b, start, turned, position))
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    return (x * seen[:, 0] + y * seen[:, 1] - focal * z) / np.sqrt(x * x + y * y)


def nearest_chords(shown: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Which chord (N,) of a curve that is shown through points (K, 2) is nearest to each of the points (N, 2) seen."""
    middle = 0.5 * (shown[1:] + shown[:-1])
    away = np.linalg.norm(seen[:, None] - middle, axis=-1)
    return np.argmin(np.where(np.isfinite(away), away, np.inf), axis=1)


def corner_errors(
    a: np.ndarray, turned: np.ndarray, position: np.ndarray, focal: np.ndarray, start: np.ndarray, seen: np.ndarray
) -> np.ndarray:
    """From points (N, 2) to the projected world points a (N, 3), pixels, x then y: (2N,)."""
    local = in_camera(a, start, turned, position)
    shown = focal[:, None] * local[:, :2] / -local[:, 2:]
    return (shown - seen).T.reshape(-1)


def derivatives(function, arguments: Sequence[np.ndarray], *fixed: np.ndarray) -> list[np.ndarray]:
    """Of a function's values (M,) by each column of each argument (N, k) or (N,), as (M, k): complex steps."""
    found = []
    for number, argument in enumerate(arguments):
        columns = []
        for column in range(argument.shape[1] if argument.ndim == 2 else 1):
            moved = argument.astype(complex)
            moved[(slice(None), column) if argument.ndim == 2 else slice(None)] += 1j * STEP
            given = [moved if i == number else each for i, each in enumerate(arguments)]
            columns.append(function(*given, *fixed).imag / STEP)
        found.append(np.stack(columns, axis=-1))
    return found
