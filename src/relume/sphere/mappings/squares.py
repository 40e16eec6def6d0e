"""Mappings of the whole sphere onto a square: an octahedron unfolded, and its equal-area sibling.

Both show the sphere like a plan seen from above: +Y in the middle, −Y in the four corners, +X to the right and +Z down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.sphere.mappings.mapping import refuse_size


class _Folded:
    """A square whose inner diamond is the upper half of the sphere and whose corners are folded under it."""

    name = ""

    def shape(self, size: int) -> tuple[int, int]:
        refuse_size(size, self.name)
        return size, size

    def shown(self, points: np.ndarray) -> np.ndarray:
        return points


@dataclass(frozen=True)
class Octahedral(_Folded):
    """The sphere on an octahedron, unfolded (Engelhardt & Dachsbacher 2008): (x, z)/(|x| + |y| + |z|)."""

    name = "octahedral"

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2)."""
        directions = np.asarray(directions, np.float64)
        directions = directions / np.abs(directions).sum(-1, keepdims=True)
        return _folded(directions[..., 0], directions[..., 2], directions[..., 1] < 0)

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2)."""
        x, z = 2 * points[..., 0] - 1, 2 * points[..., 1] - 1
        y = 1 - np.abs(x) - np.abs(z)
        below = np.maximum(-y, 0)
        directions = np.stack([x - np.copysign(below, x), y, z - np.copysign(below, z)], axis=-1)
        return directions / np.linalg.norm(directions, axis=-1, keepdims=True)

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel of an image of `size` rows, (rows, columns); they sum to 4π."""
        rows, _ = self.shape(size)
        if rows % 2:
            # Folds run along the diagonals of the pixels of an even number only.
            return self.solid_angles(2 * rows).reshape(rows, 2, rows, 2).sum((1, 3))
        # One quarter gives all four, and in it the fold x + z = 1 halves the pixels along their diagonals.
        half = rows // 2
        places = np.arange(half + 1) / half
        x, z = places[None, :], places[:, None]
        y = 1 - x - z
        below = np.maximum(-y, 0)
        corners = np.stack([x - below, y, z - below], axis=-1)
        corners /= np.linalg.norm(corners, axis=-1, keepdims=True)
        near, right, low, far = corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1], corners[1:, 1:]
        quarter = _triangle(near, right, low) + _triangle(right, far, low)
        whole = np.concatenate([quarter[::-1], quarter])
        return np.concatenate([whole[:, ::-1], whole], axis=1)


@dataclass(frozen=True)
class EqualArea(_Folded):
    """The equal-area square of Clarberg (2008), which pbrt-v4 reads: every pixel is 4π/size² steradians."""

    name = "equalarea"

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2)."""
        x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
        radius = np.sqrt(np.maximum(1 - np.abs(y), 0))
        along = radius * np.arctan2(np.abs(z), np.abs(x)) * 2 / np.pi
        return _folded(np.copysign(radius - along, x), np.copysign(along, z), y < 0)

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2)."""
        across, down = 2 * points[..., 0] - 1, 2 * points[..., 1] - 1
        depth = 1 - np.abs(across) - np.abs(down)
        radius = 1 - np.abs(depth)
        turn = np.divide(np.abs(down) - np.abs(across), radius, out=np.zeros_like(radius), where=radius > 0)
        angle = (turn + 1) * np.pi / 4
        ring = radius * np.sqrt(2 - radius**2)
        x, z = np.copysign(ring * np.cos(angle), across), np.copysign(ring * np.sin(angle), down)
        return np.stack([x, np.copysign(1 - radius**2, depth), z], axis=-1)

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel of an image of `size` rows, (rows, columns); they sum to 4π."""
        return np.broadcast_to(4 * np.pi / size**2, self.shape(size))


def _folded(across: np.ndarray, down: np.ndarray, under: np.ndarray) -> np.ndarray:
    """Image points of points of the diamond [−1, 1]², those of the lower half folded out into the corners."""
    out = np.copysign(1 - np.abs(down), across), np.copysign(1 - np.abs(across), down)
    return 0.5 + np.stack([np.where(under, out[0], across), np.where(under, out[1], down)], axis=-1) / 2


def _triangle(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Solid angles of triangles of unit corners (…, 3) (Van Oosterom & Strackee 1983)."""
    volume = np.abs((a * np.cross(b, c)).sum(-1))
    return 2 * np.arctan2(volume, 1 + (a * b).sum(-1) + (b * c).sum(-1) + (c * a).sum(-1))
