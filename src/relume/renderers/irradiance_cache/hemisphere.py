"""The hemisphere above a place, in M rings of N cells that bring equal light, and what is known from its rays.

Ward & Heckbert 1992, "Irradiance gradients": from the same rays as the irradiance, how it changes where the surface
turns and where one moves along it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.sphere.sampling import frames


@dataclass(frozen=True)
class Hemisphere:
    """rings : M, from the normal to the horizon; sectors : N, round it."""

    rings: int
    sectors: int

    @staticmethod
    def of(rays: int) -> Hemisphere:
        """About that many rays, in cells that are as high as wide: N ≈ π M."""
        rings = max(round(np.sqrt(rays / np.pi)), 2)
        return Hemisphere(rings, max(round(rays / rings), 4))

    def directions(self, normal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """A unit direction (M·N, 3) in each cell, by chance in proportion to the cosine; ring after ring."""
        u = random.random((self.rings, self.sectors, 2))
        sine = np.sqrt((np.arange(self.rings)[:, None] + u[..., 0]) / self.rings)
        angle = 2 * np.pi * (np.arange(self.sectors) + u[..., 1]) / self.sectors
        across, along = frames(normal)
        flat = (sine * np.cos(angle))[..., None] * across + (sine * np.sin(angle))[..., None] * along
        directions = (flat + np.sqrt(1 - sine**2)[..., None] * normal).reshape(-1, 3)
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def irradiance(self, radiance: np.ndarray) -> np.ndarray:
        """E = π/(MN) Σ L of K hemispheres' radiance (K, M·N, 3): (K, 3)."""
        return np.pi * radiance.mean(axis=1)

    def turning(self, radiance: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """The rotational gradient (K, 3 axes, 3 channels): (n_i × n)·∇ is what E gains where the normal is n.

        A ring counts by ∫ sin²θ dθ, which is the paper's tan θ of its cosine's share, integrated.
        """
        cells = radiance.reshape(-1, self.rings, self.sectors, 3)
        edges = np.arcsin(np.sqrt(np.arange(self.rings + 1) / self.rings))
        ring = np.diff(edges / 2 - np.sin(2 * edges) / 4)
        angle = 2 * np.pi * (np.arange(self.sectors) + 0.5) / self.sectors
        round_ = self._vectors(normals, angle + np.pi / 2)
        return 2 * np.pi / self.sectors * np.einsum("j,kjsc,ksx->kxc", ring, cells, round_)

    def moving(self, radiance: np.ndarray, closeness: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """The translational gradient (K, 3 axes, 3 channels), per metre (Ward & Heckbert 1992, §3).

        closeness : (K, M·N) 1/r, per metre, of what each ray met; 0 where it met nothing
        """
        cells = radiance.reshape(-1, self.rings, self.sectors, 3)
        near = closeness.reshape(-1, self.rings, self.sectors, 1)
        edges = np.arcsin(np.sqrt(np.arange(self.rings + 1) / self.rings))
        begin = 2 * np.pi * np.arange(self.sectors) / self.sectors
        # Between a ring and the one within: where one moves towards what is seen, the outer one grows.
        steps = np.maximum(near[:, 1:], near[:, :-1]) * (cells[:, 1:] - cells[:, :-1])
        wall = np.sin(edges[1:-1]) * np.cos(edges[1:-1]) ** 2 * 2 * np.pi / self.sectors
        outward = np.einsum("j,kjsc->ksc", wall, steps)
        towards = self._vectors(normals, begin + np.pi / self.sectors)
        # Between a sector and the one before.
        before = np.roll(cells, 1, axis=2), np.roll(near, 1, axis=2)
        turns = np.maximum(near, before[1]) * (cells - before[0])
        sideways = np.einsum("j,kjsc->ksc", np.diff(np.sin(edges)), turns)
        across = self._vectors(normals, begin + np.pi / 2)
        return np.einsum("ksc,ksx->kxc", outward, towards) + np.einsum("ksc,ksx->kxc", sideways, across)

    def _vectors(self, normals: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Unit vectors (K, N, 3) in K surfaces, at angles (N,) round their normals."""
        across, along = frames(normals)
        return np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * along[:, None]
