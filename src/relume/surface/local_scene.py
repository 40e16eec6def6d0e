"""Recovering the reflectance of the real surface that receives shadow and light (Debevec 1998, §7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.directions import UP
from relume.sphere.environment_map import EnvironmentMap

FEWEST_PIXELS = 100


@dataclass(frozen=True, eq=False)
class Recovered:
    """A diffuse reflectance with what it was recovered from.

    reflectance : per channel, within 0 to 1
    measured : per channel before it was held to at most 1; above 1 says that the light is too weak for the plate
    spread : per channel, half the distance between the 16th and 84th percentile over the pixels
    pixels : how many of the plate's pixels were looked at
    """

    reflectance: tuple[float, float, float]
    measured: tuple[float, float, float]
    spread: tuple[float, float, float]
    pixels: int


def recover_reflectance(
    plate: RadianceMap, camera: Camera, light: EnvironmentMap, plane: Plane, objects: Sequence[Mesh] = ()
) -> Recovered:
    """One diffuse reflectance for a plane, ρ = π L / E: its radiance in the plate over its irradiance from the light.

    objects : where they will stand, so that the surface is measured round them, where it will be changed; all of
        the plane that the plate shows when none are given
    A lone plane lights itself by nothing, so the paper's iteration ends with its first step.
    Raises ValueError when the camera sees hardly any of the plane.
    """
    seen = _on_plane(camera, plane)
    near = seen & _round(objects, _points(camera, plane))
    looked_at = near if near.sum() >= FEWEST_PIXELS else seen
    if plate.clipped is not None:
        looked_at &= plate.clipped == 0
    if looked_at.sum() < FEWEST_PIXELS:
        raise ValueError(
            f"the camera sees {looked_at.sum()} measured pixels of the plane; give its reflectance instead"
        )
    irradiance = light.irradiance(UP)
    values = np.pi * plate.radiance[looked_at].astype(np.float64) / np.maximum(irradiance, 1e-30)
    low, middle, high = np.percentile(values, [16, 50, 84], axis=0)
    reflectance = np.clip(middle, 0, 1)
    return Recovered(_triple(reflectance), _triple(middle), _triple((high - low) / 2), int(np.count_nonzero(looked_at)))


def _points(camera: Camera, plane: Plane) -> np.ndarray:
    """Where the ray of each pixel meets the plane's level, (H, W, 3); NaN where it goes up."""
    rays = camera.rays()
    fall = np.where(
        (rays[..., 1] < -1e-6) & (camera.position[1] > plane.height),
        (plane.height - camera.position[1]) / np.minimum(rays[..., 1], -1e-6),
        np.nan,
    )
    return camera.position + fall[..., None] * rays


def _on_plane(camera: Camera, plane: Plane) -> np.ndarray:
    points = _points(camera, plane)
    x, z = plane.extent
    with np.errstate(invalid="ignore"):
        return (np.abs(points[..., 0]) <= x / 2) & (np.abs(points[..., 2]) <= z / 2)


def _round(objects: Sequence[Mesh], points: np.ndarray) -> np.ndarray:
    """Points on the ground within an object's height of its footprint, where its shadow falls."""
    near = np.zeros(points.shape[:2], bool)
    for mesh in objects:
        low, high = mesh.vertices.min(0), mesh.vertices.max(0)
        reach = max(float(high[1]), 1e-3)
        with np.errstate(invalid="ignore"):
            near |= np.all(
                (points[..., [0, 2]] > low[[0, 2]] - reach) & (points[..., [0, 2]] < high[[0, 2]] + reach), -1
            )
    return near


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
