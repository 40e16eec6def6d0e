"""A pinhole camera with a pose: world points to pixels and pixels to rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.sphere.directions import look_at


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a picture was taken from, and through which lens.

    width, height : pixels
    focal_length : pixels; both ways alike
    position : (3,) metres, world
    rotation : (3, 3) world-from-camera; columns are right, up and backward, so the camera looks along −Z
    """

    width: int
    height: int
    focal_length: float
    position: np.ndarray
    rotation: np.ndarray

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not 0 < self.focal_length < np.inf:
            raise ValueError(f"a camera of {self.width}×{self.height} pixels and focal length {self.focal_length}")
        if not np.all(np.abs(self.position) < 1e15):
            raise ValueError(f"a camera at {self.position}; expected metres, less than 1e15 from the origin")

    @staticmethod
    def looking_at(position: np.ndarray, target: np.ndarray, *, width: int, height: int, focal_length: float) -> Camera:
        """A camera at `position` that looks at `target`, horizon level."""
        position = np.asarray(position, np.float64)
        return Camera(width, height, focal_length, position, look_at(position, np.asarray(target, np.float64)))

    def rays(self) -> np.ndarray:
        """Unit directions (H, W, 3), world, through the pixel centres."""
        x, y = np.arange(self.width) + 0.5, np.arange(self.height) + 0.5
        return self.rays_through(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1))

    def rays_through(self, points: np.ndarray) -> np.ndarray:
        """Unit directions (…, 3), world, through pixel coordinates (…, 2), x right and y down from the corner."""
        x, y = points[..., 0] - self.width / 2, self.height / 2 - points[..., 1]
        local = np.stack(np.broadcast_arrays(x, y, -self.focal_length), axis=-1)
        local = local / np.linalg.norm(local, axis=-1, keepdims=True)
        return local @ self.rotation.T

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixel coordinates (…, 2), x right and y down, of world points (…, 3); NaN behind the camera."""
        local = (np.asarray(points, np.float64) - self.position) @ self.rotation
        depth = np.where(local[..., 2] < 0, -local[..., 2], np.nan)
        x = self.width / 2 + self.focal_length * local[..., 0] / depth
        return np.stack([x, self.height / 2 - self.focal_length * local[..., 1] / depth], axis=-1)
