"""A camera with a pose and a lens: world points to pixels and pixels to rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.scene.cameras.distortion import Distortion
from relume.sphere.directions import look_at


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a picture was taken from, and through which lens.

    width, height : pixels
    focal_length : pixels; both ways alike
    position : (3,) metres, world
    rotation : (3, 3) world-from-camera; columns are right, up and backward, so the camera looks along −Z
    centre : the principal point, pixels from the upper left corner, x right and y down; the picture's middle if None
    distortion : of the lens; none if None
    aperture : radius of the lens, metres; 0 for a pinhole, which is sharp everywhere
    focus : distance of the plane in focus along the viewing axis, metres

    `project` and `rays` are those of the lens's middle; an aperture spreads rays about it, which only renderers do.
    """

    width: int
    height: int
    focal_length: float
    position: np.ndarray
    rotation: np.ndarray
    centre: tuple[float, float] | None = None
    distortion: Distortion | None = None
    aperture: float = 0.0
    focus: float = np.inf

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not 0 < self.focal_length < np.inf:
            raise ValueError(f"a camera of {self.width}×{self.height} pixels and focal length {self.focal_length}")
        if not np.all(np.abs(self.position) < 1e15):
            raise ValueError(f"a camera at {self.position}; expected metres, less than 1e15 from the origin")
        if self.centre is not None and not (len(self.centre) == 2 and np.all(np.isfinite(self.centre))):
            raise ValueError(f"a camera whose principal point is {self.centre}; expected two numbers, in pixels")
        if not 0 <= self.aperture < np.inf or not self.focus > 0:
            raise ValueError(
                f"a camera of aperture {self.aperture} and focus {self.focus}; expected metres, a radius of 0 or more "
                "and a distance above 0"
            )
        if self.distortion is not None and not np.isfinite(self.rays_through(border(self.width, self.height))).all():
            raise ValueError(
                f"{self.distortion} folds over within a picture of {self.width}×{self.height} pixels and focal length "
                f"{self.focal_length:g}; check its coefficients, which are those of normalised coordinates"
            )

    @staticmethod
    def looking_at(position: np.ndarray, target: np.ndarray, *, width: int, height: int, focal_length: float) -> Camera:
        """A camera at `position` that looks at `target`, horizon level."""
        position = np.asarray(position, np.float64)
        return Camera(width, height, focal_length, position, look_at(position, np.asarray(target, np.float64)))

    @property
    def principal_point(self) -> tuple[float, float]:
        """Where the viewing axis meets the picture, pixels from the upper left corner."""
        return (self.width / 2, self.height / 2) if self.centre is None else self.centre

    def pinhole(self) -> Camera:
        """The same camera without distortion."""
        return replace(self, distortion=None)

    def resized(self, width: int, height: int) -> Camera:
        """The same field of view across, in other pixels; another aspect crops or extends above and below alike."""
        scale, centre = width / self.width, None
        if self.centre is not None:
            x, y = self.centre
            centre = (x * scale, height / 2 + (y - self.height / 2) * scale)
        return replace(self, width=width, height=height, focal_length=self.focal_length * scale, centre=centre)

    def rays(self) -> np.ndarray:
        """Unit directions (H, W, 3), world, through the pixel centres."""
        x, y = np.arange(self.width) + 0.5, np.arange(self.height) + 0.5
        return self.rays_through(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1))

    def rays_through(self, points: np.ndarray) -> np.ndarray:
        """Unit directions (…, 3), world, through pixel coordinates (…, 2), x right and y down from the corner.

        NaN where the distortion model has folded over, which is never within the picture.
        """
        across, down = self.principal_point
        if self.distortion is None:
            x, y = points[..., 0] - across, down - points[..., 1]
            local = np.stack(np.broadcast_arrays(x, y, -self.focal_length), axis=-1)
        else:
            seen = (np.asarray(points, np.float64) - [across, down]) / self.focal_length
            straight = self.distortion.undistorted(seen)
            local = np.stack(np.broadcast_arrays(straight[..., 0], -straight[..., 1], -1.0), axis=-1)
        local = local / np.linalg.norm(local, axis=-1, keepdims=True)
        return local @ self.rotation.T

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixel coordinates (…, 2), x right and y down, of world points (…, 3).

        NaN behind the camera and beyond where the distortion model folds over.
        """
        local = (np.asarray(points, np.float64) - self.position) @ self.rotation
        depth = np.where(local[..., 2] < 0, -local[..., 2], np.nan)
        across, down = self.principal_point
        if self.distortion is None:
            x = across + self.focal_length * local[..., 0] / depth
            return np.stack([x, down - self.focal_length * local[..., 1] / depth], axis=-1)
        straight = np.stack([local[..., 0] / depth, -local[..., 1] / depth], axis=-1)
        return np.array([across, down]) + self.focal_length * self.distortion.distorted(straight)


def border(width: int, height: int) -> np.ndarray:
    """Points (64, 2) along the edge of a picture: what folds over nowhere there does so nowhere inside."""
    along = np.linspace(0, 1, 16, endpoint=False)
    zero, one = np.zeros_like(along), np.ones_like(along)
    sides = [(along, zero), (one, along), (1 - along, one), (zero, 1 - along)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides]) * [width, height]
