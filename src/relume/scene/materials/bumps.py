"""Wrinkled surfaces: normals turned as if the surface had bumps (Blinn 1978, the paper's reference 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.image.bilinear import bilinear
from relume.sphere.directions import normalised

_STRIP = 4096
"""Points whose waves stay in a core's cache."""


class Bumps(Protocol):
    """How normals are turned."""

    def turned(
        self, normals: np.ndarray, points: np.ndarray, uv: np.ndarray, dp_du: np.ndarray, dp_dv: np.ndarray
    ) -> np.ndarray:
        """Unit normals (N, 3) of the wrinkled surface, at world points (N, 3) with texture coordinates (N, 2)."""
        ...


@dataclass(frozen=True)
class Wrinkles:
    """Irregular waves through space, a sum of sines of random direction and phase: no texture coordinates are needed.

    height : root mean square of the surface's displacement, metres
    wavelength : metres; the waves' lengths spread over an octave about it
    seed : which wrinkles
    """

    height: float = 0.002
    wavelength: float = 0.05
    seed: int = 0
    waves: int = 24

    def __post_init__(self) -> None:
        if not (0 <= self.height < np.inf and 0 < self.wavelength < np.inf and self.waves >= 1):
            raise ValueError(
                f"wrinkles {self.height} m high, {self.wavelength} m long, {self.waves} waves; "
                "expected 0 or more, above 0 and at least 1"
            )

    def turned(
        self, normals: np.ndarray, points: np.ndarray, uv: np.ndarray, dp_du: np.ndarray, dp_dv: np.ndarray
    ) -> np.ndarray:
        numbers, phases, amplitude = self.components()
        turned = np.empty(np.shape(normals))
        # In strips: all waves of all points would go through the memory again and again.
        for begin in range(0, len(turned), _STRIP):
            strip = slice(begin, begin + _STRIP)
            gradient = np.cos(points[strip] @ numbers.T + phases) @ numbers * amplitude
            # The gradient's part along the surface.
            tangential = gradient - np.sum(gradient * normals[strip], -1, keepdims=True) * normals[strip]
            turned[strip] = normalised(normals[strip] - tangential)
        return turned

    def components(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Wave vectors (waves, 3) radians to a metre, phases (waves,), and the amplitude of each, metres."""
        random = np.random.default_rng(self.seed)
        directions = normalised(random.normal(size=(self.waves, 3)))
        numbers = directions * (2 * np.pi / self.wavelength) * 2 ** random.uniform(-0.5, 0.5, (self.waves, 1))
        return numbers, random.uniform(0, 2 * np.pi, self.waves), self.height * float(np.sqrt(2 / self.waves))


@dataclass(frozen=True, eq=False)
class BumpMap:
    """Heights over the texture coordinates.

    heights : (H, W) metres; repeated beyond 0 to 1
    """

    heights: np.ndarray

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or not self.heights.size or not np.all(np.isfinite(self.heights)):
            raise ValueError(f"heights are {self.heights.shape}; expected an image (H, W) of finite metres")

    def turned(
        self, normals: np.ndarray, points: np.ndarray, uv: np.ndarray, dp_du: np.ndarray, dp_dv: np.ndarray
    ) -> np.ndarray:
        rows, columns = self.heights.shape
        tiled = np.pad(self.slopes(), ((1, 1), (1, 1), (0, 0)), mode="wrap")
        along_u, along_v = np.moveaxis(
            bilinear(tiled, uv[:, 0] % 1 * columns + 1, (1 - uv[:, 1] % 1) * rows + 1), -1, 0
        )[..., None]
        # Blinn 1978, eq. 4: N′ = N + (B_u N×P_v − B_v N×P_u) / |N|, with N = P_u × P_v.
        area = np.cross(dp_du, dp_dv)
        outward = np.where(np.sum(area * normals, -1, keepdims=True) < 0, -1.0, 1.0)
        length = np.linalg.norm(area, axis=-1, keepdims=True)
        side = along_u * np.cross(normals, dp_dv) - along_v * np.cross(normals, dp_du)
        return normalised(np.where(length > 0, normals + outward * side / np.maximum(length, 1e-30), normals))

    def slopes(self) -> np.ndarray:
        """Metres to a unit of u and of v at every pixel's middle, (H, W, 2)."""
        rows, columns = self.heights.shape
        # The image's rows go down while v goes up.
        return np.stack(
            [
                (np.roll(self.heights, -1, 1) - np.roll(self.heights, 1, 1)) * columns / 2,
                (np.roll(self.heights, 1, 0) - np.roll(self.heights, -1, 0)) * rows / 2,
            ],
            axis=-1,
        )
