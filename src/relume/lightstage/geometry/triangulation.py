"""Where the camera's ray and the projector's ray of one place pass each other nearest: the point that both see.

Rays do not quite meet, because places and the rig have errors. The point is the middle between them; how far apart they
pass says how well the rig explains the places, and the places' deviations give each point a covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.geometry.decoding import ProjectorPlaces
from relume.lightstage.geometry.rig import ScannerRig

STEP = 0.05
"""Projector pixels by which a place is moved to see how its point moves: above rounding, below a lens."""


@dataclass(frozen=True, eq=False)
class ScannedPoints:
    """A point for each pixel of the camera, metres, in the rig's frame; NaN where there is none.

    points : (H, W, 3) float64
    covariance : (H, W, 3, 3) float64, of the places' noise alone: errors of the rig move all points together
    gap : (H, W) float64, how far apart the two rays pass, metres
    """

    points: np.ndarray
    covariance: np.ndarray
    gap: np.ndarray

    @property
    def known(self) -> np.ndarray:
        """Where (H, W) bool there is a point."""
        return np.isfinite(self.points[..., 0])


def triangulated(places: ProjectorPlaces, rig: ScannerRig) -> ScannedPoints:
    """The points that the camera's rays and the projector's rays through these places have in common.

    A point behind the camera or the projector is none. Raises ValueError where the photographs have another size than
    the rig's camera, and for a rig whose rays are parallel.
    """
    height, width = places.known.shape
    if (rig.camera.width, rig.camera.height) != (width, height):
        raise ValueError(
            f"the photographs are {width}×{height} pixels, but the rig's camera takes {rig.camera.width}×"
            f"{rig.camera.height}; give the rig they were taken with"
        )
    if np.linalg.norm(rig.projector.position - rig.camera.position) < 1e-6:
        raise ValueError("the rig's camera and projector stand at one place; nothing can be triangulated")
    known = places.known
    rays = rig.camera.rays()[known]
    shown = places.places[known]
    middle, gap, before = _between(rig, rays, shown)
    # How the point moves with the place, along x and along y of the projector.
    covariance = np.zeros((len(shown), 3, 3))
    for axis in (0, 1):
        moved = np.zeros(2)
        moved[axis] = STEP
        slope = (_between(rig, rays, shown + moved)[0] - _between(rig, rays, shown - moved)[0]) / (2 * STEP)
        slope *= places.deviation[known][:, axis, None]
        covariance += slope[:, :, None] * slope[:, None, :]
    points = np.full((height, width, 3), np.nan)
    spread = np.full((height, width, 3, 3), np.nan)
    apart = np.full((height, width), np.nan)
    kept = np.zeros((height, width), bool)
    kept[known] = before
    points[kept], spread[kept], apart[kept] = middle[before], covariance[before], gap[before]
    return ScannedPoints(points, spread, apart)


def _between(rig: ScannerRig, rays: np.ndarray, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of camera rays (N, 3) and projector places (N, 2): mid-points (N, 3), gaps (N,), and which lie before both."""
    beams = rig.projector.rays_through(shown)
    base = rig.projector.position - rig.camera.position
    cosine = np.einsum("nk,nk->n", rays, beams)
    sine = np.maximum(1 - cosine**2, 1e-12)
    along, across = rays @ base, beams @ base
    first = (along - cosine * across) / sine
    second = (cosine * along - across) / sine
    from_camera = rig.camera.position + first[:, None] * rays
    from_projector = rig.projector.position + second[:, None] * beams
    gap = np.linalg.norm(from_camera - from_projector, axis=-1)
    return 0.5 * (from_camera + from_projector), gap, (first > 0) & (second > 0)
