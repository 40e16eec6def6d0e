"""The light on the walls of a box, by radiosity, as pictures to paint on walls that shine and reflect nothing.

So a path that leaves the objects and what they stand on ends where it meets a wall: the truth has a fraction of the
noise, and light that the objects send to the walls does not come back, as relume assumes of its distant scene. Walls
are seen and photographed as any others. Radiance; Z up; no occlusion, as a box without furniture has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image

GRID = 16
"""Patches along each side of a wall."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Wall:
    """A rectangle: its middle and its two full sides; it faces along across × up."""

    centre: np.ndarray
    across: np.ndarray
    up: np.ndarray

    @property
    def normal(self) -> np.ndarray:
        n = np.cross(self.across, self.up)
        return n / np.linalg.norm(n)

    def points(self, grid: int) -> np.ndarray:
        """(grid, grid, 3) middles of its patches, row 0 on top."""
        s = (np.arange(grid) + 0.5) / grid - 0.5
        return self.centre + s[None, :, None] * self.across - s[:, None, None] * self.up

    @property
    def area(self) -> float:
        return float(np.linalg.norm(np.cross(self.across, self.up)))


@dataclass(frozen=True)
class Lamp:
    """Something that shines: many small sources; `normals` zero for a ball, whose disc faces every place.

    power : radiance × area of each source
    """

    points: np.ndarray
    normals: np.ndarray
    power: np.ndarray


def window(wall: Wall, radiance: Vector, grid: int = 8) -> Lamp:
    """A rectangle that shines."""
    count = grid * grid
    power = np.array(radiance) * wall.area / count
    return Lamp(wall.points(grid).reshape(-1, 3), np.tile(wall.normal, (count, 1)), np.tile(power, (count, 1)))


def globe(centre: Vector, radius: float, radiance: Vector) -> Lamp:
    """A ball that shines."""
    return Lamp(np.array([centre]), np.zeros((1, 3)), np.array([radiance]) * np.pi * radius**2)


def walls_of(low: Vector, high: Vector) -> dict[str, Wall]:
    """The six walls of a box, facing inwards."""
    (x, y, z), (X, Y, Z) = low, high
    w, d, h = X - x, Y - y, Z - z
    mx, my, mz = (x + X) / 2, (y + Y) / 2, (z + Z) / 2
    table = {
        "floor": ((mx, my, z), (w, 0, 0), (0, d, 0)), "ceiling": ((mx, my, Z), (w, 0, 0), (0, -d, 0)),
        "left": ((x, my, mz), (0, d, 0), (0, 0, h)), "right": ((X, my, mz), (0, -d, 0), (0, 0, h)),
        "back": ((mx, Y, mz), (w, 0, 0), (0, 0, h)), "front": ((mx, y, mz), (-w, 0, 0), (0, 0, h)),
    }  # fmt: skip
    return {name: Wall(*(np.array(v, float) for v in each)) for name, each in table.items()}


def lit(walls: dict[str, Wall], albedo: dict[str, np.ndarray], lamps: list[Lamp]) -> dict[str, np.ndarray]:
    """(H, W, 3) float32 radiance of each wall, of the size of its albedo (H, W, 3).

    Irradiance of a patch: Σ L A cos θ cos θ' / r² over all sources; twelve rounds of it between the walls.
    """
    points = np.concatenate([wall.points(GRID).reshape(-1, 3) for wall in walls.values()])
    normals = np.concatenate([np.tile(wall.normal, (GRID**2, 1)) for wall in walls.values()])
    areas = np.concatenate([np.full(GRID**2, wall.area / GRID**2) for wall in walls.values()])
    reflected = np.concatenate([_resized(albedo[name], (GRID, GRID)).reshape(-1, 3) for name in walls])
    direct = sum(_received(points, normals, lamp.points, lamp.normals) @ lamp.power for lamp in lamps)
    between = _received(points, normals, points, normals) * areas
    # Patches that share an edge are nearer to one another than the sum at their middles allows.
    between *= np.minimum(1, np.pi / np.maximum(between.sum(1, keepdims=True), 1e-9))
    irradiance = direct
    for _ in range(12):
        irradiance = direct + between @ (reflected * irradiance / np.pi)
    split = irradiance.reshape(len(walls), GRID, GRID, 3)
    return {
        name: (albedo[name] * _resized(split[i], albedo[name].shape[:2]) / np.pi).astype(np.float32)
        for i, name in enumerate(walls)
    }


def _received(points: np.ndarray, normals: np.ndarray, sources: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """cos θ cos θ' / r² from each source (columns) at each point (rows)."""
    towards = sources[None] - points[:, None]
    r2 = np.maximum((towards**2).sum(-1), 1e-4)
    here = np.maximum(np.einsum("psk,pk->ps", towards, normals), 0) / np.sqrt(r2)
    there = np.maximum(np.einsum("psk,sk->ps", -towards, facing), 0) / np.sqrt(r2)
    return here * np.where(np.any(facing, axis=1)[None], there, 1.0) / r2


def _resized(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    planes = [Image.fromarray(pixels[..., c].astype(np.float32)) for c in range(3)]
    return np.stack([np.asarray(p.resize(size[::-1], Image.Resampling.BICUBIC)) for p in planes], -1).clip(0)
