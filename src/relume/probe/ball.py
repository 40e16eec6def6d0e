"""Unwrapping a photographed mirrored ball with the true perspective of its camera.

Camera frame here: x right, y down, z forward, as pixels run. The ball is the unit sphere; the camera stands
`distance` radii from its centre. A direction at angle β from the camera's is seen in the ball where the normal
makes the angle γ, with β = γ + atan2(D sin γ, D cos γ − 1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.radiance import SATURATED, RadianceMap
from relume.image.resample import bilinear
from relume.probe.outline import Outline, find_outline
from relume.sphere.directions import look_at, normalised, rotation_between

CAMERA_FROM_PIXELS = np.diag([1.0, -1.0, -1.0])
"""Turns the pixel frame (y down, z forward) into the camera frame of the world's conventions (y up, z backward)."""


@dataclass(frozen=True, eq=False)
class BallView:
    """One radiance map of the ball, with where its camera stood: everything needed to look light up in it.

    picture : the radiance map
    focal_length : pixels; the principal point is the picture's middle
    axis : unit vector from the camera to the ball's centre, pixel frame
    distance : from the camera to the ball's centre, in ball radii
    world_from_pixels : rotation of the pixel frame into the world
    outline : the silhouette the ball was found by
    """

    picture: RadianceMap
    focal_length: float
    axis: np.ndarray
    distance: float
    world_from_pixels: np.ndarray
    outline: Outline

    @property
    def towards_camera(self) -> np.ndarray:
        """The direction from the ball to its camera, in the world."""
        return -self.world_from_pixels @ self.axis

    def turned(self, rotation: np.ndarray) -> BallView:
        """The same view with its world turned by `rotation`."""
        return BallView(
            self.picture, self.focal_length, self.axis, self.distance, rotation @ self.world_from_pixels, self.outline
        )

    def look_up(self, directions: np.ndarray, nearness: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Radiance (…, 3) seen in the ball from world directions (…, 3), and how squarely, cos of incidence (…).

        nearness : ball radius over the distance of what is seen; directions are those from the ball's centre, and
            the ray that leaves its surface meets them there. 0 is light at infinity.
        The cosine is 1 where the ball faces the camera and falls to 0 at the silhouette, where the whole
        neighbourhood of the direction behind the ball is squeezed into no width; in the blind cone it is 0.
        """
        x, y, incidence = self._seen_at(directions, nearness)
        height, width = self.picture.radiance.shape[:2]
        incidence = np.where((x >= 0) & (x <= width) & (y >= 0) & (y <= height), incidence, 0)
        return bilinear(self.picture.radiance, x, y), incidence

    def saturated(self, directions: np.ndarray, nearness: float = 0.0) -> np.ndarray:
        """Whether the light from world directions (…, 3) was saturated in every photograph: (…) bool."""
        if self.picture.clipped is None:
            return np.zeros(directions.shape[:-1], bool)
        x, y, _ = self._seen_at(directions, nearness)
        return bilinear((self.picture.clipped == SATURATED).astype(np.float32), x, y) > 0.5

    def _seen_at(self, directions: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pixel coordinates where directions are seen, and the cosine of incidence there."""
        local = np.asarray(directions, np.float64) @ self.world_from_pixels
        normal = self._normal(local)
        if nearness:
            # From the surface point n (in radii) the point at 1/nearness lies along ω − nearness·n.
            normal = self._normal(normalised(local - nearness * normal))
        point = self.distance * self.axis + normal
        x, y = self._project(point)
        return x, y, np.maximum(-(normalised(point) * normal).sum(-1), 0)

    def _normal(self, directions: np.ndarray) -> np.ndarray:
        """The normals (…, 3) at which directions (…, 3), in the pixel frame, are reflected to the camera."""
        back = -self.axis
        cosine = np.clip(directions @ back, -1, 1)
        sideways = directions - cosine[..., None] * back
        length = np.linalg.norm(sideways, axis=-1, keepdims=True)
        sideways = np.divide(sideways, length, out=np.zeros_like(sideways), where=length > 0)
        gamma = np.linspace(0, np.arccos(1 / self.distance), 8192)
        beta = gamma + np.arctan2(self.distance * np.sin(gamma), self.distance * np.cos(gamma) - 1)
        angle = np.interp(np.arccos(cosine), beta, gamma)[..., None]
        return np.cos(angle) * back + np.sin(angle) * sideways

    def _project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        width, height = self.picture.size
        x = width / 2 + self.focal_length * points[..., 0] / points[..., 2]
        return x, height / 2 + self.focal_length * points[..., 1] / points[..., 2]


def view_ball(
    picture: RadianceMap,
    *,
    camera: np.ndarray,
    centre: np.ndarray,
    focal_length: float | None = None,
    radius: float | None = None,
    name: str = "picture",
) -> BallView:
    """Find the ball in a radiance map and place its view in the world.

    camera, centre : where the camera and the ball's centre were, metres, world; the horizon is level
    focal_length : pixels; taken from the ball's size and distance when unknown
    radius : the ball's, metres; needed only when the focal length is unknown
    Raises BallNotFound; ValueError when neither focal length nor radius is given.
    """
    camera, centre = np.asarray(camera, np.float64), np.asarray(centre, np.float64)
    outline = find_outline(picture.radiance, name)
    if focal_length is None:
        if radius is None:
            raise ValueError(f"{name}: no focal length in its EXIF; give the ball's radius, so that it can be found")
        sine = radius / float(np.linalg.norm(camera - centre))
        focal_length = outline.radius * float(np.sqrt(1 - sine**2)) / sine
    axis, distance = _cone(outline, picture.size, focal_length)
    # The camera that looks straight at the ball, then turned in itself so that the ball lies where it is seen.
    straight = look_at(camera, centre) @ CAMERA_FROM_PIXELS
    world_from_pixels = straight @ rotation_between(axis, np.array([0.0, 0.0, 1.0]))
    return BallView(picture, focal_length, axis, distance, world_from_pixels, outline)


def _cone(outline: Outline, size: tuple[int, int], focal_length: float) -> tuple[np.ndarray, float]:
    """Axis and distance in radii from the silhouette: its rays d satisfy d·axis = cos α, and D = 1/sin α."""
    x, y = outline.points[:, 0] - size[0] / 2, outline.points[:, 1] - size[1] / 2
    rays = normalised(np.stack([x, y, np.full_like(x, focal_length)], axis=1))
    # Linear in m = axis / cos α: d·m = 1 on every ray.
    m, *_ = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)
    cosine = 1 / float(np.linalg.norm(m))
    return normalised(m), 1 / np.sqrt(max(1 - cosine**2, 1e-12))
