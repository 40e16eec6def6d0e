"""From views of a mirrored ball to one illumination map.

Every view is blind behind the ball, sees it squeezed near the silhouette and sees its own camera in the middle;
what one view lacks comes from another (Debevec 1998, §5.1: two views ninety degrees apart).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.optimize import least_squares

from relume.image.colour import luminance
from relume.probe.ball import BallView
from relume.sphere.directions import rotation_from_vector
from relume.sphere.illumination import IlluminationMap
from relume.sphere.mappings import LatLong, pixel_points

CAMERA_CONE = np.radians(14)
"""Half-angle round each camera that its own view must not show: tripod and photographer at arm's length of 1 m."""
TURN_LIMIT = np.radians(6)
"""The farthest that registration turns a view: what a tape measure and a level leave uncertain."""
NEAREST = 0.2
"""The greatest nearness registration may find: walls five ball radii away."""
LIKENESS = 0.7
"""Correlation of ln luminance below which two views do not show one light; the room's two reach 0.995, and −0.04 to
0.84 where a camera is said to have stood elsewhere."""
EVEN_LIGHT = 0.05
"""Standard deviation of ln luminance below which there is nothing to correlate."""
BRIGHTNESS_LIMIT = 0.1
"""Natural logarithm of the brightness ratio of two views above which it is told."""
SHARPNESS = 8
"""Power of the weights: high, so that a near lamp that two views show in two places is taken from one of them."""


@dataclass(frozen=True, eq=False)
class Probe:
    """An illumination map with what it was assembled from.

    light : lat-long illumination map
    corrections : radians by which registration turned each view; the first view stays
    nearness : ball radius over the distance of what surrounds it, as registration found it; 0 for a lone view
    clipped_solid_angle : steradians whose light was saturated in every photograph of the view it came from
    confidence : (size, 2·size) float32, 0 where no view saw the direction well, 1 where one faced it squarely
    notes : doubts about the views, a line each
    """

    light: IlluminationMap
    corrections: tuple[float, ...]
    nearness: float
    clipped_solid_angle: float
    confidence: np.ndarray
    notes: tuple[str, ...] = ()


def assemble(views: Sequence[BallView], *, size: int = 512) -> Probe:
    """Register the views of a ball to the first and blend them into a lat-long illumination map.

    size : rows of the map; 512 is what a ball 600 pixels wide resolves
    A direction that no view sees takes the light of the nearest that one does, and its confidence is 0.
    """
    registered, corrections, nearness = [views[0]], [0.0], []
    notes: list[str] = []
    for number, view in enumerate(views[1:], start=2):
        turn, near, doubts = _registration(views[0], view)
        registered.append(view.turned(rotation_from_vector(turn)))
        corrections.append(float(np.linalg.norm(turn)))
        nearness.append(near)
        notes.extend(f"view {number} of the ball {doubt}" for doubt in doubts)
    near = float(np.median(nearness)) if nearness else 0.0

    # Cells no wider than a pixel of the ball, or a lamp falls between them.
    ball_pixel = 2 / max(view.outline.radius for view in views)
    subdivision = max(2, int(np.ceil(np.pi / size / ball_pixel)))
    points = pixel_points(LatLong(), size, subdivision)
    cell = LatLong().solid_angles(size * subdivision)[:, 0]
    total, weight, clipped = np.zeros((size, 2 * size, 3)), np.zeros((size, 2 * size)), 0.0
    for chosen in np.array_split(np.arange(size), min(size, 8 * subdivision)):
        rows = slice(chosen[0] * subdivision, (chosen[-1] + 1) * subdivision)
        directions = LatLong().directions(points[rows])
        seen = [view.look_up(directions, near) for view in registered]
        # A lone view keeps its camera in the picture: nothing else could stand there.
        trust = [
            _trust(view, directions, cosine) if len(registered) > 1 else cosine**SHARPNESS
            for view, (_, cosine) in zip(registered, seen, strict=True)
        ]
        cells = (len(chosen), subdivision, 2 * size, subdivision)
        for view, (radiance, _), share in zip(registered, seen, trust, strict=True):
            clipped += float((view.saturated(directions, near) * share / sum(trust, 1e-300)).sum(1) @ cell[rows])
            total[chosen] += (radiance * share[..., None]).reshape(*cells, 3).sum((1, 3))
            weight[chosen] += share.reshape(cells).sum((1, 3))
    confidence = np.minimum(weight / subdivision**2, 1) ** (1 / SHARPNESS)
    radiance = total / np.maximum(weight, 1e-300)[..., None]
    light = IlluminationMap(_filled(radiance, confidence > 0.05).astype(np.float32))
    return Probe(light, tuple(corrections), near, clipped, confidence.astype(np.float32), tuple(notes))


def _trust(view: BallView, directions: np.ndarray, incidence: np.ndarray) -> np.ndarray:
    """How far a view is believed, 0 to 1: squarely seen, and not its own camera."""
    angle = np.arccos(np.clip(directions @ view.towards_camera, -1, 1))
    clear = np.clip((angle - CAMERA_CONE) / (0.5 * CAMERA_CONE), 0, 1)
    return (incidence * clear * clear * (3 - 2 * clear)) ** SHARPNESS


def _registration(reference: BallView, view: BallView) -> tuple[np.ndarray, float, list[str]]:
    """The rotation vector that lays `view` on `reference`, the nearness of what both see, and doubts.

    Robust least squares on the logarithm of luminance. Rays to a near wall leave the ball in different places for
    different cameras, which looks like a turn; so the walls' distance is found together with the turn. Only
    directions above the horizon take part: what the ball stands on is nearer than all else.
    """
    directions = _spread_directions(20_000)
    directions = directions[directions[:, 1] > 0.1]
    weights = np.ones(len(directions))
    for each in (reference, view):
        weights = weights * _trust(each, directions, each.look_up(directions)[1])
    directions = directions[weights > np.quantile(weights, 0.5)]

    def misfit(guess: np.ndarray) -> np.ndarray:
        turned = view.turned(rotation_from_vector(guess[:3]))
        seen = [luminance(v.look_up(directions, guess[3])[0]) for v in (turned, reference)]
        difference = np.log(seen[0] + 1e-9) - np.log(seen[1] + 1e-9)
        return difference - np.median(difference)

    bounds = [(-TURN_LIMIT,) * 3 + (0.0,), (TURN_LIMIT,) * 3 + (NEAREST,)]
    start = np.array([0, 0, 0, 0.01])
    solution = least_squares(misfit, start, bounds=bounds, loss="soft_l1", f_scale=0.1, diff_step=0.01, x_scale=0.02)
    turned = view.turned(rotation_from_vector(solution.x[:3]))
    ours, theirs = (luminance(v.look_up(directions, solution.x[3])[0]) + 1e-9 for v in (reference, turned))
    ratio = float(np.median(theirs / ours))
    doubts = []
    # A light that is the same all round says nothing of where the camera stood.
    alike = min(np.std(np.log(seen)) for seen in (ours, theirs)) < EVEN_LIGHT or (
        float(np.corrcoef(np.log(ours), np.log(theirs))[0, 1]) > LIKENESS
    )
    if not alike or np.any(np.abs(solution.x[:3]) > 0.98 * TURN_LIMIT) or solution.x[3] > 0.98 * NEAREST:
        doubts.append("does not fit the first one; check where its camera stood")
    if abs(np.log(ratio)) > BRIGHTNESS_LIMIT:
        doubts.append(f"is {ratio:.2f} times as bright as the first; did the light or the exposure change?")
    return solution.x[:3], float(solution.x[3]), doubts


def _spread_directions(count: int) -> np.ndarray:
    """Directions spread evenly over the sphere (a Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    y, longitude = 1 - 2 * index / count, index * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - y * y)
    return np.stack([ring * np.sin(longitude), y, -ring * np.cos(longitude)], axis=1)


def _filled(radiance: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Unknown pixels take the nearest known one's radiance; the map wraps round."""
    if known.all() or not known.any():
        return radiance
    width = known.shape[1]
    tiled = np.concatenate([known, known, known], axis=1)
    rows, columns = np.asarray(distance_transform_edt(~tiled, return_distances=False, return_indices=True))
    middle = slice(width, 2 * width)
    return radiance[rows[:, middle], columns[:, middle] % width]
