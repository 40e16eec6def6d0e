"""The nested curves near a ball's rim, and which of them is the rim: the outermost seen nearly as well as the best.

Near its rim a ball shows bright walls and lamps squeezed into bands that run along it, and their edges are often
stronger than the rim's own. So every edge near a first outline counts alike, not only the strongest along each normal,
and ellipses are tried a little inside and outside. Reflections lie within the rim, and what is behind the ball follows
no ellipse round it: among those that are seen nearly equally well the outermost is the rim.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from relume.probe.ball.edge_tracking import robust_cone, slopes
from relume.probe.ball.silhouette import RAYS, Outline, cone_through, outline_of

SOUGHT = 0.1
"""How far inside and outside a first outline ellipses are tried, in radii: bands of reflections lie in there."""
LEAST_SOUGHT = 4.0
"""Pixels: the same at least."""
SEEN = 0.7
"""Support, against the best, below which a curve is not one that competes."""
NEARLY = 0.72
"""Support, against the best, from which on an ellipse farther out is the rim: 0.78 to 1 in photographs of a ball under
a bright ceiling, whose rims then agree to half a pixel; round other balls nothing farther out reaches 0.65."""
FARTHER = 0.4
"""Support that an ellipse farther out has at least: in a noisy dark picture curves reach 0.37 by chance."""
RIVALLING = 0.9
"""Support, against the chosen one, from which on another ellipse makes the choice a doubt."""
APART = 0.02
"""Least distance, in radii, of ellipses that are two curves and not one seen twice; at least `LEAST_APART` pixels."""
LEAST_APART = 1.5
NEAR = 0.75
"""Pixels from an ellipse within which an edge supports it."""
STEP = 0.5
"""Pixels between samples along a normal."""
RINGING, GHOST = 3.0, 0.2
"""Pixels to either side of a strong edge, and shares of its slope: JPEG and sharpening leave ghosts of it there."""


@dataclass(frozen=True, eq=False)
class Curves:
    """The curves near an outline.

    rim, normals : (N, 2) of the outline, and out of it
    steps : (K,) pixels along the normals
    edges : (N, K) bool, where the picture changes most
    offsets : (C, 3) pixels right, down and outward from the outline to each curve, the best supported first
    support : (C,) share of each that lies in the picture and has an edge on it
    apart : pixels by which two of them differ at least
    """

    rim: np.ndarray
    normals: np.ndarray
    steps: np.ndarray
    edges: np.ndarray
    offsets: np.ndarray
    support: np.ndarray
    apart: float


def outermost(
    picture: np.ndarray, outline: Outline, focal_length: float, size: tuple[float, float] | None = None
) -> Outline:
    """The outermost ellipse round a first outline that edges support nearly as well as any.

    picture : (H, W) luminance, `evened`
    outline : one of the nested curves; given back in its place where it is the rim itself
    focal_length : pixels
    size : twice the principal point; that of the picture, (width, height), unless given

    The `rivals` of what is given back are ellipses seen about as well, between which the picture does not decide.
    """
    size = size or (picture.shape[1], picture.shape[0])
    curves = curves_near(picture, outline, focal_length, size, SOUGHT)
    chosen = outer_of(curves)
    rivals = tuple(
        (outline.centre[0] + float(x), outline.centre[1] + float(y), outline.radius + float(out))
        for (x, y, out), support in zip(curves.offsets, curves.support, strict=True)
        if support > RIVALLING * curves.support[chosen]
        and distance(np.array([x, y, out]), curves.offsets[chosen]) > curves.apart
    )
    same = distance(curves.offsets[chosen], np.zeros(3)) < curves.apart
    found = outline if same else along(curves, chosen, focal_length, size)
    return replace(found, rivals=rivals)


def curves_near(
    picture: np.ndarray, outline: Outline, focal_length: float, size: tuple[float, float], reach: float
) -> Curves:
    """The best supported ellipses that lie apart from better ones, moved by up to `reach` radii."""
    radius = outline.radius
    rim, normals = cone_through(outline.points, size, focal_length).silhouette(size, focal_length)
    most = max(SOUGHT * radius, LEAST_SOUGHT)
    steps = np.arange(-1.6 * most, 1.6 * most + STEP / 2, STEP)
    edges, shown = _edges(picture, rim, normals, steps, max(0.8, radius / 300))
    most = max(reach * radius, LEAST_SOUGHT)
    moves = np.linspace(-most, most, int(np.ceil(2 * most / max(0.5, radius / 150))) | 1)
    near = np.asarray(maximum_filter1d(edges.astype(np.float32), 2 * int(NEAR / STEP) + 1, axis=1))
    offsets = np.stack(np.meshgrid(moves, moves, moves, indexing="ij"), axis=-1).reshape(-1, 3)
    offsets = offsets[np.hypot(offsets[:, 0], offsets[:, 1]) + np.abs(offsets[:, 2]) <= 1.5 * most]
    support = _supports(near, normals, steps, offsets)
    apart = max(APART * radius, LEAST_APART)
    chosen: list[int] = []
    left = support.copy()
    while len(chosen) < 12:
        best = int(np.argmax(left))
        if chosen and left[best] < SEEN * support[chosen[0]]:
            break
        chosen.append(best)
        left[distance(offsets, offsets[best]) < apart] = -1
    # What was found before stays one of them, where it is, lest the grid of ellipses shift it.
    own = np.flatnonzero(distance(offsets, np.zeros(3)) < apart)
    first = int(own[np.argmax(support[own])])
    if first not in chosen:
        chosen.append(first)
    # The grid is coarser than an edge is sharp: each curve is moved to where it is best seen.
    finer = np.linspace(-0.75, 0.75, 7) * (moves[1] - moves[0])
    around = np.stack(np.meshgrid(finer, finer, finer, indexing="ij"), axis=-1).reshape(-1, 3)
    places, seen = [], []
    for curve in offsets[chosen]:
        support = _supports(near, normals, steps, curve + around)
        places.append(curve + around[int(np.argmax(support))])
        seen.append(float(support.max()) / max(float(shown.mean()), 1e-6))
    kept: list[int] = []
    for curve in np.argsort(seen)[::-1]:
        if all(distance(places[curve], places[other]) >= apart for other in kept):
            kept.append(int(curve))
    return Curves(rim, normals, steps, edges, np.array(places)[kept], np.array(seen)[kept], apart)


def outer_of(curves: Curves) -> int:
    """The outermost that is seen nearly as well as the best, counted from the outline where that is one of them."""
    enough = curves.support >= NEARLY * curves.support[0]
    own = (distance(curves.offsets, np.zeros(3)) < curves.apart) & enough
    first = int(np.argmax(np.where(own, curves.support, 0))) if own.any() else 0
    enough &= curves.support >= FARTHER
    farther = np.flatnonzero(enough & lies_outside(curves.offsets - curves.offsets[first]))
    return int(max(farther, key=lambda c: curves.offsets[c][2], default=first))


def along(curves: Curves, chosen: int, focal_length: float, size: tuple[float, float]) -> Outline:
    """The outline through the edges that support a curve."""
    offset = curves.offsets[chosen]
    wanted = offset[2] + curves.normals @ offset[:2]
    off = np.where(curves.edges, np.abs(curves.steps - wanted[:, None]), np.inf)
    points = (curves.rim + curves.normals * curves.steps[np.argmin(off, axis=1)][:, None])[off.min(1) < 2 * NEAR]
    if len(points) < 3:
        points = curves.rim + curves.normals * wanted[:, None]
    cone, near = robust_cone(points, size, focal_length, NEAR)
    return outline_of(cone, size, focal_length, points[near], float(near.sum()) / RAYS)


def _edges(
    picture: np.ndarray, rim: np.ndarray, normals: np.ndarray, steps: np.ndarray, blur: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where along the normals the picture changes most, (N, K) bool, and which rim points lie in it, (N,).

    Ghosts beside stronger edges are left out.
    """
    slope, lasting = slopes(picture, rim, normals, steps, blur)
    peak = slope == maximum_filter1d(slope, 3, axis=1)
    beside = maximum_filter1d(slope, 2 * int(RINGING / STEP) + 1, axis=1)
    clear = (slope > 2 * np.median(slope, axis=1, keepdims=True)) & (slope > 0.004) & (slope > GHOST * beside)
    at = rim[:, None] + normals[:, None] * steps[None, :, None]
    inside = np.all((at > 1) & (at < np.array(picture.shape[::-1]) - 1), axis=-1)
    return peak & clear & inside & lasting, inside[:, len(steps) // 2]


def _supports(near: np.ndarray, normals: np.ndarray, steps: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The share of each ellipse that has an edge near it, (M,), of ellipses moved by `offsets` (M, 3)."""
    support = np.zeros(len(offsets), np.float32)
    for normal, row in zip(normals[::2], near[::2], strict=True):
        place = offsets[:, 2] + offsets[:, 0] * normal[0] + offsets[:, 1] * normal[1]
        support += row[np.clip(np.rint((place - steps[0]) / STEP).astype(np.intp), 0, len(steps) - 1)]
    return support / len(normals[::2])


def lies_outside(moved: np.ndarray) -> np.ndarray:
    """Whether ellipses moved so from another one, (…, 3), lie outside it over most of them: larger by a third of it."""
    return moved[..., 2] > 0.3 * np.hypot(moved[..., 0], moved[..., 1])


def distance(offsets: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The most by which ellipses lie off another one, pixels: (M,)."""
    apart = offsets - other
    return np.hypot(apart[..., 0], apart[..., 1]) + np.abs(apart[..., 2])
