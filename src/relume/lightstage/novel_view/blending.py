"""How much each source camera counts in a new view (view-dependent texture mapping: Debevec, Yu, Borshukov 1998).

A camera counts the more the nearer its direction is to the new view's, the more the surface faces it, and the farther
the place is from where its sight of the surface ends: all three go to nothing smoothly, so that no seam shows where
one camera takes over from another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.novel_view.projection import Outline


@dataclass(frozen=True)
class Blending:
    """Weights of source cameras.

    angle : radians between two directions of view at which a camera counts e^−½ of one that looks from the new view
        itself. 20°: what eq. 9 carries that far is still near what was measured
    facing : power of the cosine between normal and view; 2, since a pixel covers the more of the surface, one way, the
        less it faces it, and its highlights are the less to be trusted
    feather : pixels of the source over which its weight rises from the border of what it sees. 8: a seam narrower than
        that is seen as a line
    """

    angle: float = np.radians(20)
    facing: float = 2.0
    feather: float = 8.0

    def __post_init__(self) -> None:
        if not (0 < self.angle < np.inf and 0 <= self.facing < np.inf and 0 <= self.feather < np.inf):
            raise ValueError(f"{self}: expected an angle in radians above 0, and two numbers that are not below 0")

    def weights(
        self, normals: np.ndarray, view: np.ndarray, new_view: np.ndarray, certainty: np.ndarray, border: np.ndarray
    ) -> np.ndarray:
        """The weight (N,) of one source at N places, above 0 where it sees them and 0 elsewhere.

        normals, view, new_view : (N, 3) unit, world; views from the surface to the source and to the new camera
        certainty : (N,) of what was sampled, 0…1 (`view_projection.sampled`)
        border : (N,) pixels of the source to the border of what it sees (`border_distance`)
        """
        cosine = np.clip(np.einsum("pk,pk->p", view, new_view), -1, 1)
        near = np.exp(-0.5 * (np.arccos(cosine) / self.angle) ** 2)
        faced = np.maximum(np.einsum("pk,pk->p", normals, view), 0.01) ** self.facing
        inside = np.clip(border / self.feather, 0, 1) if self.feather > 0 else np.ones_like(border)
        smooth = inside * inside * (3 - 2 * inside)
        # Never nothing where something is seen: alone, it fills the place.
        return np.where(certainty > 0, certainty * faced * np.maximum(near, 1e-12) * np.maximum(smooth, 1e-4), 0)


def border_distance(source: Outline) -> np.ndarray:
    """Pixels (H, W) from each pixel to where the source's sight of that surface ends; 0 where it has none."""
    from scipy.ndimage import distance_transform_edt

    inside = np.pad(source.usable, 1)
    return np.asarray(distance_transform_edt(inside))[1:-1, 1:-1]


def blended(values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The weighted mean (N, C) of values (K, N, C) of K sources with weights (K, N); and whether any counted (N,)."""
    total = weights.sum(axis=0)
    mean = np.einsum("kn,knc->nc", weights, values) / np.maximum(total, 1e-300)[:, None]
    return mean, total > 0
