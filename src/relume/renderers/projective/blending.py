"""What photographs together show of points of a place: the mean of those that see them best, without seams.

Debevec, Taylor & Malik 1996 weight a photograph by the angle between its view and the wanted one, so that what a
simple model lacks in relief is seen nearly as it looked from there; Buehler et al. 2001 ("Unstructured lumigraph
rendering") write it as a penalty, and let a photograph go as another becomes better, so that nothing leaps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.renderers.projective.photographs import Projector, footprints
from relume.scene.cameras.camera import Camera

VIEWS = 3
"""Photographs that a point is shown by at most, as triangles of views are blended in Debevec, Yu & Borshukov 1998."""
COARSE = 0.1
"""Radians that a photograph whose pixel is twice as wide as the wanted one is worth: sharpness beside direction."""
LEAST_PENALTY = 1e-6
"""Radians, far below a pixel: a view of the wanted direction itself leaves others nothing, even at its own edges."""


@dataclass(frozen=True, eq=False)
class Blend:
    """What is shown of N points.

    radiance : (N, 3) float32; 0 where no photograph sees the point
    seen : (N,) bool
    best : (N,) int, the photograph with most say; −1 where none sees the point
    """

    radiance: np.ndarray
    seen: np.ndarray
    best: np.ndarray


def blended(
    among: Sequence[Projector], points: np.ndarray, normals: np.ndarray, eye: Camera | None, views: int = VIEWS
) -> Blend:
    """What photographs show of points (N, 3) of unit normals (N, 3).

    eye : who looks; None for a texture that all will look at, which the finest photographs make
    views : photographs a point at most
    """
    count, most = len(points), len(among)
    at, penalty = np.empty((most, count, 2)), np.full((most, count), np.inf)
    wanted = None if eye is None else footprints(eye, points, normals)
    for index, projector in enumerate(among):
        at[index], say = projector.sees(points)
        there = np.flatnonzero(say > 0)
        if there.size:
            own = _penalty(projector, points[there], normals[there], eye, None if wanted is None else wanted[there])
            penalty[index, there] = (own + LEAST_PENALTY) / say[there]
    return _mixed(among, at, penalty, views)


def _penalty(
    projector: Projector, points: np.ndarray, normals: np.ndarray, eye: Camera | None, wanted: np.ndarray | None
) -> np.ndarray:
    """What speaks against a photograph that sees these points, radians."""
    width = projector.footprints(points, normals)
    if eye is None or wanted is None:
        # Of a texture for all: how wide its pixels are. Weights go by ratios alone, so any length serves as the unit.
        return width
    mine, theirs = (position - points for position in (eye.position, projector.photograph.camera.position))
    crossed = np.linalg.norm(np.cross(mine, theirs), axis=-1)
    angle = np.arctan2(crossed, np.einsum("ij,ij->i", mine, theirs))
    return angle + COARSE * np.maximum(width / np.maximum(wanted, 1e-12) - 1, 0)


def _mixed(among: Sequence[Projector], at: np.ndarray, penalty: np.ndarray, views: int) -> Blend:
    """The weighted mean of what is shown at pixels `at`, (K, N, 2), by penalties (K, N), ∞ for what is not seen."""
    count = penalty.shape[1]
    # The best that is left out sets where a weight ends, so that it has none at the moment it comes in.
    last = np.partition(penalty, views, axis=0)[views] if len(penalty) > views else np.full(count, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(np.isfinite(penalty), np.maximum(1 - penalty / last, 0) / penalty**2, 0.0)
    # Where penalties tie to the last digit none has any say; the first of them then speaks.
    seen = np.asarray(np.isfinite(penalty).any(axis=0))
    best = np.where(seen, penalty.argmin(axis=0), -1)
    silent = np.flatnonzero(seen & ~(weight.sum(axis=0) > 0))
    weight[best[silent], silent] = 1.0
    total = np.maximum(weight.sum(axis=0), 1e-300)
    radiance = np.zeros((count, 3))
    for index, projector in enumerate(among):
        there = np.flatnonzero(weight[index] > 0)
        if there.size:
            radiance[there] += (weight[index, there] / total[there])[:, None] * projector.shown(at[index, there])
    return Blend(radiance.astype(np.float32), seen, best)
