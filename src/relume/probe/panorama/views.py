"""Views of a panorama: pictures from one place, each with where it looked and through which lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import NotAPanorama
from relume.image.radiance import RadianceMap
from relume.sphere.directions import normalised, rotation_about

FACES: dict[str, tuple[float, float]] = {
    "front": (0.0, 0.0),
    "right": (90.0, 0.0),
    "back": (180.0, 0.0),
    "left": (270.0, 0.0),
    "up": (0.0, 90.0),
    "down": (0.0, -90.0),
}
"""Yaw and pitch in degrees of the six photographs on a cube's faces (Miller & Hoffman 1984, §5.1); up and down are
tilted from the front."""


@dataclass(frozen=True, eq=False)
class PanoramaView:
    """One picture of a panorama.

    picture : the radiance map; its principal point is the middle
    focal_length : pixels, at the middle of the picture
    rotation : (3, 3) world-from-camera, as of `Camera`; None where it is to be found by matching
    name : for messages
    distortion : k of r' = r (1 + k r²), with r the tangent of the angle from the axis and r' where the lens puts it
    """

    picture: RadianceMap
    focal_length: float
    rotation: np.ndarray | None = None
    name: str = "view"
    distortion: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.focal_length < np.inf:
            raise ValueError(f"{self.name}: the focal length is {self.focal_length}; expected pixels, above 0")
        if not abs(self.distortion) < 1:
            raise ValueError(
                f"{self.name}: the distortion is {self.distortion}; expected a share of the radius, like −0.1"
            )
        if self.rotation is not None:
            turn = np.asarray(self.rotation)
            if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-5) or np.linalg.det(turn) < 0:
                raise ValueError(f"{self.name}: the rotation is {turn.tolist()}; expected a 3×3 rotation matrix")

    @property
    def axis(self) -> np.ndarray:
        """The unit direction it looks in, world; its rotation must be known."""
        return -self.placed[:, 2]

    @property
    def placed(self) -> np.ndarray:
        """The rotation, known by now."""
        if self.rotation is None:
            raise ValueError(f"{self.name}: where it looked is not known yet; match the views first")
        return self.rotation

    def rays(self, points: np.ndarray) -> np.ndarray:
        """Unit directions (…, 3), of the camera's own frame, through pixels `points` (…, 2), x right and y down."""
        width, height = self.picture.size
        seen = (points - np.array([width / 2, height / 2])) / self.focal_length
        return rays_through(seen, self.distortion)

    def points(self, directions: np.ndarray) -> np.ndarray:
        """Pixel coordinates (…, 2) of world directions (…, 3); NaN behind the camera and where the lens folds."""
        local = np.asarray(directions, np.float64) @ self.placed
        depth = np.where(local[..., 2] < -1e-9, -local[..., 2], np.nan)
        straight = np.stack([local[..., 0] / depth, -local[..., 1] / depth], axis=-1)
        square = (straight**2).sum(-1, keepdims=True)
        square = np.where(square < fold(self.distortion), square, np.nan)
        width, height = self.picture.size
        return np.array([width / 2, height / 2]) + self.focal_length * straight * (1 + self.distortion * square)


def fold(distortion: float) -> float:
    """The square of the tangent at which a picture bent by a negative distortion turns back; infinite for others."""
    return 1 / (-3 * distortion) if distortion < 0 else np.inf


def undistorted(seen: np.ndarray, distortion: float) -> np.ndarray:
    """Tangents (…, 2) before the lens of those (…, 2) behind it; beyond the fold those of the fold."""
    if distortion == 0:
        return seen
    radius = np.linalg.norm(seen, axis=-1, keepdims=True)
    farthest = np.sqrt(min(fold(distortion), 1e6))
    bound = np.minimum(radius, farthest * (1 + distortion * farthest**2) * 0.999)
    straight = bound.copy()
    for _ in range(12):  # Newton; each step doubles the digits
        straight -= (straight * (1 + distortion * straight**2) - bound) / (1 + 3 * distortion * straight**2)
    return seen * np.divide(straight, radius, out=np.ones_like(radius), where=radius > 0)


def rays_through(seen: np.ndarray, distortion: float) -> np.ndarray:
    """Unit directions (…, 3) of the camera's frame, of tangents (…, 2) behind the lens."""
    straight = undistorted(seen, distortion)
    return normalised(np.stack([straight[..., 0], -straight[..., 1], -np.ones(straight.shape[:-1])], axis=-1))


def orientation(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """World-from-camera rotation of a camera on a panorama head; angles in radians.

    yaw : to the right from −Z
    pitch : up
    roll : of the camera, clockwise as the photographer sees it
    The order is that of panorama programs: roll, then pitch, then yaw, each about the fixed axes of the head.
    """
    turned = rotation_about([0, 1, 0], -yaw) @ rotation_about([1, 0, 0], pitch)
    return turned @ rotation_about([0, 0, 1], -roll)


def angles_of(rotation: np.ndarray) -> tuple[float, float, float]:
    """Yaw, pitch and roll, radians, of a rotation: the inverse of `orientation`. Straight up or down roll is 0."""
    forward, right = -rotation[:, 2], rotation[:, 0]
    pitch = float(np.arcsin(np.clip(forward[1], -1, 1)))
    if np.hypot(forward[0], forward[2]) < 1e-9:
        return float(np.arctan2(right[2], right[0])), pitch, 0.0
    yaw = float(np.arctan2(forward[0], -forward[2]))
    unrolled = orientation(yaw, pitch).T @ rotation
    return yaw, pitch, float(np.arctan2(-unrolled[1, 0], unrolled[0, 0]))


def focal_length_of(field: float, width: int) -> float:
    """Pixels, of a field of view across in radians; raises ValueError outside 0 to π."""
    if not 0 < field < np.pi:
        raise ValueError(f"the field of view is {np.degrees(field):g}°; expected more than 0 and less than 180")
    return float(width / 2 / np.tan(field / 2))


def refuse_unusable(views: list[PanoramaView]) -> None:
    """Raise NotAPanorama for a lone view, pixels that are no light, and views of different units."""
    if len(views) < 2:
        names = views[0].name if views else "no view"
        raise NotAPanorama(f"{names}: a panorama needs two views at least; give the others too")
    for view in views:
        if not np.all(np.isfinite(view.picture.radiance)) or view.picture.radiance.min() < 0:
            raise NotAPanorama(f"{view.name}: holds negative or non-finite radiance; clip or repair it first")
        if view.picture.unit != views[0].picture.unit:
            raise NotAPanorama(
                f"{view.name} is in {view.picture.unit}, {views[0].name} in {views[0].picture.unit}; calibrate both or "
                "neither"
            )
