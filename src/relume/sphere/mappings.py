"""Mappings between directions and points of a square or 2:1 image, each with the exact solid angle of its pixels.

Image points (…, 2) are (u, v) in [0, 1]², u to the right and v down; the centre of pixel (column i, row j) is
((i + ½)/W, (j + ½)/H). `size` is always the number of rows.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np


class Mapping(Protocol):
    """How the sphere of directions is laid out in an image."""

    name: ClassVar[str]
    aspect: ClassVar[int]

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2)."""
        ...

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2); NaN where the image shows none."""
        ...

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel, (size, aspect·size); they sum to 4π."""
        ...


def pixel_points(mapping: Mapping, size: int, subdivision: int = 1) -> np.ndarray:
    """Image points of pixel centres, or of subdivision² cells in each pixel: (size·s, aspect·size·s, 2)."""
    rows, columns = size * subdivision, mapping.aspect * size * subdivision
    v, u = (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns
    return np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)


@dataclass(frozen=True)
class LatLong:
    """Latitude–longitude: row 0 is +Y, the centre is −Z and +X lies to its right, as seen from inside."""

    name: ClassVar[str] = "latlong"
    aspect: ClassVar[int] = 2

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
        u = 0.5 + np.arctan2(x, -z) / (2 * np.pi)
        return np.stack([u % 1.0, np.arctan2(np.hypot(x, z), y) / np.pi], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        longitude, polar = 2 * np.pi * (points[..., 0] - 0.5), np.pi * points[..., 1]
        ring = np.sin(polar)
        return np.stack([ring * np.sin(longitude), np.cos(polar), -ring * np.cos(longitude)], axis=-1)

    def solid_angles(self, size: int) -> np.ndarray:
        cosines = np.cos(np.pi * np.arange(size + 1) / size)
        rows = (cosines[:-1] - cosines[1:]) * np.pi / size
        return np.repeat(rows[:, None], 2 * size, axis=1)


class _Disc(ABC):
    """A mapping whose polar angle from the image's centre depends on the radius alone: θ(r), r = 1 at the rim."""

    aspect: ClassVar[int] = 1
    pole: ClassVar[float]
    """The z of the direction at the image's centre."""

    @abstractmethod
    def _angle(self, radius: np.ndarray) -> np.ndarray:
        """The polar angle of a radius."""

    @abstractmethod
    def _radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius of a polar angle."""

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
        ring = np.hypot(x, y)
        radius = self._radius(np.arctan2(ring, self.pole * z))
        # At the two poles every azimuth is right; the first one is taken.
        scale = np.divide(radius, ring, out=np.zeros_like(ring), where=ring > 0)
        across = np.where(ring > 0, x * scale, radius)
        return np.stack([0.5 + across / 2, 0.5 - y * scale / 2], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        across, upward = 2 * points[..., 0] - 1, 1 - 2 * points[..., 1]
        radius = np.hypot(across, upward)
        angle = self._angle(np.where(radius <= 1, radius, np.nan))
        scale = np.divide(np.sin(angle), radius, out=np.zeros_like(radius), where=radius > 0)
        directions = np.stack([across * scale, upward * scale, self.pole * np.cos(angle)], axis=-1)
        return np.where((radius <= 1)[..., None], directions, np.nan)

    def solid_angles(self, size: int) -> np.ndarray:
        # Green's theorem: ∬ sin θ dθ dψ = ∮ (1 − cos θ(r)) dψ round the pixel. Beyond the rim 1 − cos θ is the
        # constant 2, whose integral round a closed path is 0, so pixels outside get 0 and all sum to 4π.
        nodes, weights = np.polynomial.legendre.leggauss(16)
        edges = np.linspace(-1, 1, size + 1)
        along = edges[:-1, None] + (nodes + 1) / size
        straight, moving = edges[:, None, None], along[None]
        squared = straight**2 + moving**2
        cap = 1 - np.cos(self._angle(np.minimum(np.sqrt(squared), 1.0)))
        turn = straight / np.maximum(squared, 1e-300)
        integral = (cap * turn * weights).sum(-1) / size
        # integral[e, k] walks cell k of the line `coordinate = edges[e]` upwards, counter-clockwise for a right edge.
        vertical = (integral[1:] - integral[:-1]).T
        horizontal = integral[1:] - integral[:-1]
        return np.maximum(vertical + horizontal, 0.0)[::-1]


@dataclass(frozen=True)
class Angular(_Disc):
    """Debevec's angular map (light probe): the centre is −Z and the radius is the angle from it, r = acos(−z)/π."""

    name: ClassVar[str] = "angular"
    pole: ClassVar[float] = -1.0

    def _angle(self, radius: np.ndarray) -> np.ndarray:
        return np.pi * radius

    def _radius(self, angle: np.ndarray) -> np.ndarray:
        return angle / np.pi


@dataclass(frozen=True)
class MirrorBall(_Disc):
    """A mirrored ball seen from far away on +Z: the centre reflects +Z, the rim −Z, θ = 2 asin r."""

    name: ClassVar[str] = "ball"
    pole: ClassVar[float] = 1.0

    def _angle(self, radius: np.ndarray) -> np.ndarray:
        return 2 * np.arcsin(radius)

    def _radius(self, angle: np.ndarray) -> np.ndarray:
        return np.sin(angle / 2)


MAPPINGS: dict[str, Mapping] = {m.name: m for m in (LatLong(), Angular(), MirrorBall())}
