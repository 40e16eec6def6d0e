"""Finding the outline of a mirrored ball in a picture, anywhere in it.

At every centre and radius, the share of the circle on which the brightness changes across it and not along it is
taken (a Hough transform by convolution, blind to how strong the edges are); the best circles are then fitted at
full resolution as the ellipses of balls in perspective, and followed. Pixel coordinates: x right, y down, (0, 0) the
outer corner of the first pixel.
"""

from __future__ import annotations

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter, gaussian_filter1d, map_coordinates, maximum_filter, zoom
from scipy.optimize import minimize

from relume.errors import BallNotFound
from relume.image.colour import luminance
from relume.probe.ball.edge_tracking import evened, follow
from relume.probe.ball.rim_selection import outermost
from relume.probe.ball.silhouette import RAYS, TELEPHOTO, Cone, Outline
from relume.sphere.directions import normalised

SEARCH_SIDE = 200
"""Longer side, in pixels, of the picture in which circles are sought; finer ones are fitted afterwards."""
CIRCLES = 12
"""The likeliest circles, which are fitted."""
RIVAL = 0.75
"""How well, against the best, another outline beside it must be seen to make the choice a guess."""
COVERAGE_NEEDED = 1 / 3
"""The share of the outline that must be seen: below it, curves inside rooms are taken for balls."""


def find_outline(radiance: np.ndarray, name: str = "picture", focal_length: float | None = None) -> Outline:
    """Find the ball's silhouette in a radiance map (H, W, 3).

    focal_length : pixels; where it is unknown the silhouette is taken for a circle
    Raises BallNotFound when no outline shows an edge along a third of its length, and when two that lie apart are seen
    about equally well. The outline's `rivals` are curves round the same place that might be the rim instead.
    """
    picture = evened(luminance(radiance))
    focal = float(TELEPHOTO * picture.shape[1]) if focal_length is None else focal_length
    slopes = _slopes(picture)
    height, width = picture.shape
    outlines = []
    for circle in _circles(picture):
        x, y, radius = _fitted(slopes, focal, *circle)
        if 0 < x < width and 0 < y < height and 4 < radius < 0.7 * max(width, height):
            outlines.append(follow(picture, _cone_at((x, y, radius), (width, height), focal), focal, (0.02, 0.012)))
    seen = [o for o in outlines if o is not None and o.coverage >= COVERAGE_NEEDED]
    if not seen:
        raise BallNotFound(f"{name}: no mirrored ball found; it must be round, whole in the picture and sharp")
    best = max(seen, key=_worth)
    for other in seen:
        apart = np.hypot(other.centre[0] - best.centre[0], other.centre[1] - best.centre[1])
        if apart > 0.9 * (other.radius + best.radius) and _worth(other) > RIVAL * _worth(best):
            places = " and ".join(f"{o.centre[0]:.0f},{o.centre[1]:.0f},{o.radius:.0f}" for o in (best, other))
            raise BallNotFound(f"{name}: two balls, at x,y,radius {places} pixels; pick the one that is meant")
    return outermost(picture, best, focal)


def _worth(outline: Outline) -> float:
    """Rooms mirrored in the ball hold smaller circles: among well-seen ones the larger is the ball."""
    return outline.coverage * float(np.sqrt(outline.radius))


def _circles(picture: np.ndarray) -> list[tuple[float, float, float]]:
    """The likeliest circles (x, y, radius), in pixels of `picture`."""
    scale = min(1.0, SEARCH_SIDE / max(picture.shape))
    small = np.asarray(zoom(gaussian_filter(picture, 0.4 / scale), scale, order=1)) if scale < 1 else picture
    side = min(small.shape)
    margin = side // 8
    padded = np.pad(small, margin, mode="edge").astype(np.float32)  # twice as fast as doubles, and fine enough
    gx, gy = _gradient(padded, 1.0)
    strength = gx**2 + gy**2
    # Each direction of change counts alike once it stands out of the noise.
    level = strength + np.percentile(strength, 50) + 1e-8
    across, along = _spectrum((gx**2 - gy**2) / level), _spectrum(2 * gx * gy / level)

    height, width = padded.shape
    y, x = np.indices((height, width))
    x, y = (x + width // 2) % width - width // 2, (y + height // 2) % height - height // 2
    distance, angle = np.hypot(x, y).astype(np.float32), np.arctan2(y, x)
    double, other = np.cos(2 * angle).astype(np.float32), np.sin(2 * angle).astype(np.float32)
    found: list[tuple[float, float, float, float]] = []
    for radius in np.arange(max(4.0, 0.06 * side), 0.6 * side, 0.75):
        ring = np.exp(-0.5 * ((distance - np.float32(radius)) / np.float32(0.8)) ** 2)
        ring /= ring.sum()
        # Change across the circle minus change along it: (g·n)² − (g·t)², with n at angle ψ.
        spectrum = across * np.conj(_spectrum(ring * double)) + along * np.conj(_spectrum(ring * other))
        share = np.asarray(fft.irfft2(spectrum, s=(height, width)))
        share = share[margin : height - margin, margin : width - margin]
        peak = np.where(share == maximum_filter(share, 7), share, 0)
        for index in np.argpartition(peak, -3, axis=None)[-3:]:
            row, column = divmod(int(index), share.shape[1])
            found.append((float(share[row, column]), column + 0.5, row + 0.5, float(radius)))
    # A short circle is matched by chance more easily than a long one.
    found.sort(key=lambda circle: -circle[0] * circle[3] ** 0.25)
    chosen: list[tuple[float, float, float]] = []
    for _, cx, cy, radius in found:
        if all(np.hypot(cx - a, cy - b) + abs(radius - r) > max(3.0, 0.12 * radius) for a, b, r in chosen):
            chosen.append((cx, cy, radius))
        if len(chosen) == CIRCLES:
            break
    return [(cx / scale, cy / scale, radius / scale) for cx, cy, radius in chosen]


def _spectrum(image: np.ndarray) -> np.ndarray:
    return np.asarray(fft.rfft2(image))


def _slopes(picture: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
    """Blur in pixels, and how the picture so blurred changes to the right and down; coarse to fine."""
    step = max(2.0, max(picture.shape) / SEARCH_SIDE)
    blurs = (step, step / 2, max(step / 4, 0.8))
    return [(b, *_gradient(picture, b)) for b in blurs]


def _gradient(picture: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """The derivative of the blurred picture to the right and down."""
    right, down = (np.asarray(gaussian_filter1d(picture, blur, axis=axis, order=1)) for axis in (1, 0))
    return gaussian_filter1d(right, blur, axis=0), gaussian_filter1d(down, blur, axis=1)


def _fitted(
    slopes: list[tuple[float, np.ndarray, np.ndarray]], focal_length: float, x: float, y: float, radius: float
) -> tuple[float, float, float]:
    """The ball near a guess, as its axis' place and its radius, across whose rim the picture changes on most of it."""
    size = (slopes[0][1].shape[1], slopes[0][1].shape[0])
    circle = np.array([x, y, radius])
    for blur, gx, gy in slopes:
        noise = float(np.median(np.abs(gx))) + 1e-6

        def unseen(c: np.ndarray, gx: np.ndarray = gx, gy: np.ndarray = gy, noise: float = noise) -> float:
            rim, normals = _cone_at((c[0], c[1], c[2]), size, focal_length).silhouette(size, focal_length, RAYS // 2)
            at = [rim[:, 1] - 0.5, rim[:, 0] - 0.5]
            right, down = (map_coordinates(g, at, order=1, mode="nearest") for g in (gx, gy))
            # The logarithm lets a long weak edge outweigh a short strong one.
            return -float(np.log1p(((right * normals[:, 0] + down * normals[:, 1]) / noise) ** 2).mean())

        simplex = circle + np.vstack([np.zeros(3), np.eye(3) * blur])
        options = {"initial_simplex": simplex, "xatol": 0.05, "fatol": 1e-4, "maxiter": 120}
        circle = minimize(unseen, circle, method="Nelder-Mead", options=options).x
    return float(circle[0]), float(circle[1]), float(circle[2])


def _cone_at(circle: tuple[float, float, float], size: tuple[int, int], focal_length: float) -> Cone:
    """The cone whose silhouette lies round (x, y), `radius` pixels away across the line to the picture's middle."""
    x, y, radius = circle
    axis = np.array([x - size[0] / 2, y - size[1] / 2, focal_length])
    return Cone(normalised(axis), float(np.hypot(1, np.linalg.norm(axis) / max(radius, 1e-6))))
