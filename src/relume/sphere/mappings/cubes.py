"""Mappings onto the six faces of a cube, laid out in one image.

A direction falls on the face of its largest coordinate, at s to the right and t down in [0, 1]² of that face.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from relume.sphere.mappings.mapping import refuse_size

_X, _Y, _Z = np.eye(3)
OUTWARD = np.array([_X, -_X, _Y, -_Y, _Z, -_Z])


@dataclass(frozen=True, eq=False)
class Axes:
    """How the six faces lie: the directions to the right and down in each, (6, 3)."""

    right: np.ndarray
    down: np.ndarray

    def directions(self, face: np.ndarray | int, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Unit directions (…, 3) of points (s, t) of faces; beyond [0, 1] the face's plane goes on."""
        across, downward = (2 * s - 1)[..., None], (2 * t - 1)[..., None]
        towards = OUTWARD[face] + across * self.right[face] + downward * self.down[face]
        return towards / np.linalg.norm(towards, axis=-1, keepdims=True)

    def points(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Face and (s, t) of directions (…, 3); on an edge the first face is taken."""
        outward = directions @ OUTWARD.T
        face = outward.argmax(-1)
        depth = 2 * np.take_along_axis(outward, face[..., None], -1)[..., 0]
        s, t = ((directions * axes[face]).sum(-1) / depth + 0.5 for axes in (self.right, self.down))
        return face, s, t


OPENGL = Axes(np.array([-_Z, _Z, _X, _X, _X, -_X]), np.array([-_Y, -_Y, _Z, -_Z, -_Y, -_Y]))
"""As OpenGL, Direct3D and KTX2 read cubes (see `relume.sphere.mip_cube`)."""
_INSIDE = Axes(np.array([_Z, -_Z, _X, _X, -_X, _X]), np.array([-_Y, -_Y, -_Z, _Z, -_Y, -_Y]))
"""As seen from inside, with the back beside the right face."""
_INSIDE_VERTICAL = Axes(np.array([_Z, -_Z, _X, _X, _X, _X]), np.array([-_Y, -_Y, -_Z, _Z, _Y, -_Y]))
"""As seen from inside, with the back below the bottom, so that it stands on its head."""


def face_solid_angles(size: int) -> np.ndarray:
    """Steradians of the (size, size) texels of a face, exact; they sum to 4π/6.

    A rectangle from the middle of a face to (x, y) covers atan(xy / √(x² + y² + 1)) of the sphere round it.
    """
    edges = np.linspace(-1, 1, size + 1)
    x, y = edges[None, :], edges[:, None]
    corners = np.arctan(x * y / np.sqrt(x**2 + y**2 + 1))
    return np.diff(np.diff(corners, axis=0), axis=1)


class _Layout:
    """Six square faces on a grid of cells."""

    name = ""
    axes: ClassVar[Axes]
    grid: ClassVar[tuple[int, int]]
    """Rows and columns of cells."""
    cells: ClassVar[np.ndarray]
    """(6, 2) row and column of each face's cell."""

    def shape(self, size: int) -> tuple[int, int]:
        refuse_size(size, self.name, self.grid[0])
        return size, size // self.grid[0] * self.grid[1]

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        face, s, t = self.axes.points(np.asarray(directions, np.float64))
        # A point on the far rim of a face would belong to the next cell, which may show nothing.
        row, column = np.moveaxis(self.cells[face], -1, 0)
        s, t = np.clip(s, 0, 1 - 1e-12), np.clip(t, 0, 1 - 1e-12)
        return np.stack([(column + s) / self.grid[1], (row + t) / self.grid[0]], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        across, down = np.asarray(points)[..., 0] * self.grid[1], np.asarray(points)[..., 1] * self.grid[0]
        row = np.clip(down.astype(int), 0, self.grid[0] - 1)
        column = np.clip(across.astype(int), 0, self.grid[1] - 1)
        owners = np.full(self.grid, -1)
        owners[self.cells[:, 0], self.cells[:, 1]] = np.arange(6)
        face = owners[row, column]
        directions = self.axes.directions(face, across - column, down - row)
        return np.where((face >= 0)[..., None], directions, np.nan)

    def shown(self, points: np.ndarray) -> np.ndarray:
        return points

    def solid_angles(self, size: int) -> np.ndarray:
        rows, columns = self.shape(size)
        side = rows // self.grid[0]
        image, face = np.zeros((rows, columns)), face_solid_angles(side)
        for row, column in self.cells:
            image[row * side : (row + 1) * side, column * side : (column + 1) * side] = face
        return image


@dataclass(frozen=True)
class CubeCross(_Layout):
    """A cube unfolded as seen from inside, 4:3: front (−Z) in the middle, the back at the far right."""

    name = "cross"
    axes: ClassVar[Axes] = _INSIDE
    grid: ClassVar[tuple[int, int]] = (3, 4)
    cells: ClassVar[np.ndarray] = np.array([[1, 2], [1, 0], [0, 1], [2, 1], [1, 3], [1, 1]])


@dataclass(frozen=True)
class VerticalCubeCross(_Layout):
    """A cube unfolded as seen from inside, 3:4, as HDR Shop writes it: the back, lowest, stands on its head."""

    name = "cross-vertical"
    axes: ClassVar[Axes] = _INSIDE_VERTICAL
    grid: ClassVar[tuple[int, int]] = (4, 3)
    cells: ClassVar[np.ndarray] = np.array([[1, 2], [1, 0], [0, 1], [2, 1], [3, 1], [1, 1]])


@dataclass(frozen=True)
class Strip(_Layout):
    """Six faces in a row, +X −X +Y −Y +Z −Z, each as OpenGL reads it: 6:1. Six files hold the same faces."""

    name = "strip"
    axes: ClassVar[Axes] = OPENGL
    grid: ClassVar[tuple[int, int]] = (1, 6)
    cells: ClassVar[np.ndarray] = np.array([[0, face] for face in range(6)])
