"""A light map as some thousand directions: many where it is bright, few where it is dim.

A quadtree over the map; a leaf keeps the exact irradiance of its texels and shines from their mean direction.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.sphere.directions import required_rotation
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_directions

ALL_RAYS = 1 << 30
_BRIGHT, _MIDDLING = 2e-3, 5e-4
"""Shares of a map's light from which on a leaf is looked at by all rays, and by three; many faint ones average."""


@dataclass(frozen=True, eq=False)
class DirectedLight:
    """Light that comes from M directions.

    directions : (M, 3) float64, unit, towards the light
    irradiances : (M, 3) float64, each on a surface that faces it
    radii : (M,) float64, radians, of the disc about each direction that the light fills
    rays : (M, 2) int64, how many of the rays through a pixel look at each light, and which is the first of them; None
        for all of them. A light keeps its own whatever it is put together with, so that pictures add as lights do
    """

    directions: np.ndarray
    irradiances: np.ndarray
    radii: np.ndarray
    rays: np.ndarray | None = None

    def __post_init__(self) -> None:
        count = len(self.directions)
        if self.directions.shape != (count, 3) or self.irradiances.shape != (count, 3) or self.radii.shape != (count,):
            raise ValueError(
                f"directions {self.directions.shape}, irradiances {self.irradiances.shape} and radii "
                f"{self.radii.shape}; expected (M, 3), (M, 3) and (M,)"
            )
        if self.rays is not None and (self.rays.shape != (count, 2) or self.rays.dtype.kind not in "iu"):
            raise ValueError(f"rays are {self.rays.shape} {self.rays.dtype}; expected integers ({count}, 2)")

    @staticmethod
    def of(parts: Sequence[DirectedLight]) -> DirectedLight:
        """Several together; raises ValueError for none."""
        if not parts:
            raise ValueError("no light is given; expected one or more")
        return DirectedLight(
            np.concatenate([part.directions for part in parts]),
            np.concatenate([part.irradiances for part in parts]),
            np.concatenate([part.radii for part in parts]),
            np.concatenate([part.looked_at() for part in parts]),
        )

    def looked_at(self) -> np.ndarray:
        """`rays`, for each light."""
        return np.tile([ALL_RAYS, 0], (len(self.radii), 1)) if self.rays is None else self.rays

    def turned(self, rotation: np.ndarray) -> DirectedLight:
        """The light turned by an active rotation (3, 3)."""
        return DirectedLight(self.directions @ required_rotation(rotation).T, self.irradiances, self.radii, self.rays)


def quadtree_lights(illumination: EnvironmentMap, count: int = 1500) -> DirectedLight:
    """The light of a map from about `count` directions; the irradiances sum to the map's.

    The block with the greatest power times extent is divided next, down to single texels.

    Fainter leaves are to be looked at through fewer rays a pixel. Which leaves there are depends on the map: a picture
    under two maps' leaves is the sum of the two pictures, but the leaves of two maps' sum are not theirs together, and
    the picture is another as far as leaves stand for texels.

    count : 1500 moves shadows' edges on a rendered head by less than the pictures resolve
    Raises ValueError unless count is at least 1.
    """
    if count < 1:
        raise ValueError(f"count is {count}; expected 1 direction or more")
    angles = illumination.mapping.solid_angles(illumination.size)
    directions = pixel_directions(illumination.mapping, illumination.size)
    power = illumination.radiance.astype(np.float64) * angles[..., None]
    total = np.pad(power.sum(axis=2).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))

    def queued(top: int, left: int, bottom: int, right: int) -> tuple[float, int, int, int, int]:
        inside = total[bottom, right] - total[top, right] - total[bottom, left] + total[top, left]
        extent = max(bottom - top, right - left)
        return (-inside * extent if extent > 1 else 0.0, top, left, bottom, right)

    heap = [queued(0, 0, *power.shape[:2])]
    while len(heap) < count and heap[0][0] < 0:
        _, top, left, bottom, right = heapq.heappop(heap)
        rows = sorted({top, (top + bottom) // 2, bottom} if bottom - top > 1 else {top, bottom})
        columns = sorted({left, (left + right) // 2, right} if right - left > 1 else {left, right})
        for i in range(len(rows) - 1):
            for j in range(len(columns) - 1):
                heapq.heappush(heap, queued(rows[i], columns[j], rows[i + 1], columns[j + 1]))
    leaves = [_leaf(power[a:c, b:d], directions[a:c, b:d], angles[a:c, b:d]) for _, a, b, c, d in sorted(heap)]
    lit = [leaf for leaf in leaves if leaf is not None]
    if not lit:
        return DirectedLight(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    towards, irradiances, radii = zip(*lit, strict=True)
    return DirectedLight(np.array(towards), np.array(irradiances), np.array(radii), _rays_of(np.array(irradiances)))


def _rays_of(irradiances: np.ndarray) -> np.ndarray:
    """How many rays look at each leaf and which is the first, others each turn: over many all rays serve alike."""
    share = irradiances.sum(axis=1) / irradiances.sum()
    wanted = np.where(share < _MIDDLING, 1, np.where(share < _BRIGHT, 3, ALL_RAYS))
    return np.stack([wanted, np.arange(len(share)) * np.where(wanted < ALL_RAYS, wanted, 0)], axis=1)


def _leaf(power: np.ndarray, directions: np.ndarray, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """A block's mean direction by power, irradiance and radius; None where it is dark."""
    share = power.sum(axis=2)
    if not share.sum() > 0:
        return None
    mean = np.einsum("ij,ijk->k", share, directions)
    length = float(np.linalg.norm(mean))
    # Power all around has no mean direction: its strongest texel stands for it.
    strongest = directions.reshape(-1, 3)[np.argmax(share)]
    towards = mean / length if length > 1e-6 * share.sum() else strongest
    return towards, power.sum(axis=(0, 1)), float(min(np.sqrt(angles.sum() / np.pi), 0.5))
