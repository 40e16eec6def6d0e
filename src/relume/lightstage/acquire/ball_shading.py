"""Light directions from a matte ball in the pictures: how a ball is shaded says where the lamp stands.

A matte surface of one albedo shows max(n · s, 0) under a lamp towards s (Lambert), and a ball shows every normal n that
faces the camera. s is fitted to the ball's pixels as a Lambertian lobe is to a pixel's values under many lights
(`lambertian_fit`): pixels in shadow, stains, glints and light from the table are departures that soon stop counting.
"""

from __future__ import annotations

import numpy as np

from relume.image.colour import luminance
from relume.lightstage.acquire.ball_highlights import MirrorBall
from relume.lightstage.surface.photometric_stereo import lambertian_fit

_ACROSS = 64
"""Points across the ball at which it is looked at: 3000 in all, so that noise moves the light by no more than 0.1°."""
_RIM = 0.95
"""Share of the radius that is looked at; beyond it a pixel spans many normals, and an outline that is off by a
hundredth changes most."""


def read_shading(light: np.ndarray, ball: MirrorBall) -> tuple[np.ndarray, float]:
    """The direction (3,) unit from a matte ball to the lamp, world, and the share of its shading that this explains.

    light : (H, W, 3) scene-linear
    The share is 1 − Σ (v − max(n·s, 0))² / Σ (v − mean v)², 1 for a perfect match and 0 or less for none, and 0 where
    nothing can be fitted. A ball without a camera has its normals as from far away.
    """
    points, normals = _facing(ball)
    height, width = light.shape[:2]
    seen = (points >= 0).all(axis=1) & (points[:, 0] < width) & (points[:, 1] < height)
    points, normals = points[seen].astype(int), normals[seen]
    values = luminance(light[points[:, 1], points[:, 0]].astype(np.float64)).astype(np.float32)[:, None]
    finite = np.isfinite(values[:, 0])
    values, normals = values[finite], normals[finite]
    if len(values) < 3:
        return np.array([0.0, 0.0, 1.0]), 0.0
    vector = lambertian_fit(values, normals, np.ones(len(values))).vectors[0].astype(np.float64)
    length = float(np.linalg.norm(vector))
    spread = float(np.square(values - values.mean()).sum())
    if length == 0 or spread == 0:
        return np.array([0.0, 0.0, 1.0]), 0.0
    missed = float(np.square(values[:, 0] - np.maximum(normals @ vector, 0)).sum())
    return vector / length, 1 - missed / spread


def _facing(ball: MirrorBall) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (N, 2) of the ball and its normals (N, 3) there, world."""
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS * 2 - 1
    across = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    inside = across[np.square(across).sum(axis=1) < _RIM**2]
    points = np.asarray(ball.outline.centre) + ball.outline.radius * inside
    normals = ball.normals(points)
    known = np.isfinite(normals).all(axis=1)
    return points[known], normals[known]
