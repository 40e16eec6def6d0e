"""Depth and normals of one camera made one surface: each where it is the better of the two (Nehab et al. 2005).

Triangulated points are right on the large and noisy on the small; normals of photometric stereo are fine on the small,
but bend on the large, for their errors are not noise: lights stand elsewhere than assumed, or the surface is no matte
one. So normals are first turned so that, smoothed, they agree with the points'; then the points move along their rays
so that both are met, each by its own deviation: sparse linear least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import linalg

from relume.lightstage.geometry.meshing import surface_normals
from relume.lightstage.geometry.triangulation import ScannedPoints
from relume.scene.cameras.camera import Camera


@dataclass(frozen=True)
class FusionSettings:
    """How much points and normals of a scan are believed.

    smoothing : pixels, the deviation of the Gaussian beyond which the points' normals are right and the others bend
    normal_deviation : radians, of the normals on the small; 2° is what photometric stereo of some dozens of lights has
    least_depth_deviation : metres, of the points along their rays, besides their own: the rig is not exact
    """

    smoothing: float = 6.0
    normal_deviation: float = 0.035
    least_depth_deviation: float = 5e-5


def corrected_normals(
    normals: np.ndarray, points: np.ndarray, camera: Camera, settings: FusionSettings = FusionSettings()
) -> np.ndarray:
    """Normals (H, W, 3) turned so that, smoothed, they agree with the points'; the points' own where there are none.

    normals : (H, W, 3) unit, the points' frame, 0 or NaN where unknown; points : (H, W, 3), NaN where there is none
    Source: Nehab et al. 2005, §4.1.
    """
    of_points = surface_normals(points, camera)
    there = np.isfinite(of_points[..., 0])
    given = np.nan_to_num(normals)
    both = there & (np.linalg.norm(given, axis=-1) > 0.5)
    smooth_given = smoothed_normals(given, both, settings.smoothing)
    smooth_points = smoothed_normals(np.nan_to_num(of_points), both, settings.smoothing)
    turned = _turned(given, smooth_given, smooth_points)
    return np.where(both[..., None], turned, of_points)


def fused_points(
    scanned: ScannedPoints,
    kept: np.ndarray,
    normals: np.ndarray,
    camera: Camera,
    settings: FusionSettings = FusionSettings(),
) -> np.ndarray:
    """The points (H, W, 3) moved along the camera's rays so that their surface has these normals; NaN elsewhere.

    kept : (H, W) bool, which points; normals : (H, W, 3), as `corrected_normals` gives them, NaN where unknown
    Source: Nehab et al. 2005, §4.2, with both errors measured by their own deviations instead of one weight.
    """
    rays = camera.rays()
    number = np.full(kept.shape, -1)
    number[kept] = np.arange(kept.sum())
    distance = np.linalg.norm(scanned.points - camera.position, axis=-1)
    # The points' own distances.
    variance = np.einsum("...i,...ij,...j->...", rays, scanned.covariance, rays)[kept]
    weight = 1 / np.sqrt(variance + settings.least_depth_deviation**2)
    count = len(weight)
    blocks = [sparse.dia_array((weight[None], [0]), shape=(count, count)).tocsr()]
    wanted = [weight * distance[kept]]
    # The chord between neighbours is at right angles to the mean of their normals.
    for axis in (0, 1):
        first = [slice(None), slice(None)]
        second = list(first)
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        one, other = tuple(first), tuple(second)
        normal = normals[one] + normals[other]
        chosen = (number[one] >= 0) & (number[other] >= 0) & np.isfinite(normal[..., 0])
        chosen &= np.abs(distance[other] - distance[one]) < 6 * distance[one] / camera.focal_length
        normal = normal[chosen] / np.linalg.norm(normal[chosen], axis=-1, keepdims=True)
        chord = np.linalg.norm(scanned.points[other] - scanned.points[one], axis=-1)[chosen]
        scale = 1 / (settings.normal_deviation * chord)
        near = scale * np.einsum("nk,nk->n", normal, rays[one][chosen])
        far = scale * np.einsum("nk,nk->n", normal, rays[other][chosen])
        rows = np.arange(chosen.sum())
        entries = np.concatenate([-near, far]), (np.tile(rows, 2), np.r_[number[one][chosen], number[other][chosen]])
        blocks.append(sparse.csr_array(entries, shape=(len(rows), count)))
        wanted.append(np.zeros(len(rows)))
    system = sparse.vstack(blocks).tocsr()
    found = linalg.spsolve((system.T @ system).tocsc(), system.T @ np.concatenate(wanted))
    points = np.full(scanned.points.shape, np.nan)
    points[kept] = camera.position + np.asarray(found)[:, None] * rays[kept]
    return points


def smoothed_normals(normals: np.ndarray, where: np.ndarray, width: float) -> np.ndarray:
    """Normals (H, W, 3) averaged over a Gaussian of known pixels (H, W), unit; width : its deviation, pixels."""
    total = ndimage.gaussian_filter(np.where(where[..., None], normals, 0), (width, width, 0))
    return total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-30)


def _turned(vectors: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Vectors turned by the least rotation that takes unit `start` to unit `end`."""
    axis = np.cross(start, end)
    cosine = np.einsum("...k,...k->...", start, end)[..., None]
    along = np.einsum("...k,...k->...", axis, vectors)[..., None]
    return vectors * cosine + np.cross(axis, vectors) + axis * along / np.maximum(1 + cosine, 1e-6)
