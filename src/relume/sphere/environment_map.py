"""An environment map (HDRI): radiance as a function of direction, in one of the mappings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from relume.image.bilinear import bilinear
from relume.sphere.directions import required_rotation
from relume.sphere.mappings.layouts import layout
from relume.sphere.mappings.mapping import LatLong, Mapping, continued_round, matching_size, pixel_directions

if TYPE_CHECKING:
    from relume.sphere.audit import Audit

_BAND = 2**20
"""Pixels that are summed at once."""


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """Light from every direction, measured at one point.

    radiance : (rows, columns, 3) float32, in `unit`; directions point from the centre towards the light
    mapping : how directions are laid out, `LatLong()` unless said otherwise
    unit : "cd/m²" when calibrated, else "relative"
    clipped : (rows, columns) uint8, what no photograph could measure, in the codes of `RadianceMap`. Where it is 1,
        saturated, radiance is a lower bound; where it is 3, outside, no view saw and radiance is filled in. None where
        nothing is known of that
    attributes : other text from the map's file, as where its sun was recovered from; conversions keep it
    """

    radiance: np.ndarray
    mapping: Mapping = LatLong()
    unit: str = "relative"
    clipped: np.ndarray | None = None
    attributes: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        shape = self.radiance.shape
        if self.radiance.ndim < 2 or self.radiance.size == 0:
            raise ValueError(f"radiance has shape {shape}; a map has at least one row, and three channels")
        expected = (*self.mapping.shape(shape[0]), 3)
        if shape != expected:
            article = "an" if self.mapping.name[0] in "aeiou" else "a"
            raise ValueError(
                f"radiance has shape {shape}; {article} {self.mapping.name} map of {shape[0]} rows has {expected}"
            )
        if self.clipped is not None and self.clipped.shape != shape[:2]:
            raise ValueError(f"clipped has shape {self.clipped.shape}; expected the radiance's {shape[:2]}")
        # What is no number is the least and the greatest, and compares as false.
        if not (self.radiance.min() >= 0 and self.radiance.max() < np.inf):
            raise ValueError("radiance holds negative or non-finite values; light must be finite and not below 0")

    @property
    def size(self) -> int:
        """The number of rows."""
        return self.radiance.shape[0]

    def lookup(self, directions: np.ndarray) -> np.ndarray:
        """Radiance (…, 3) from unit directions (…, 3), bilinear; 0 where the map does not show them.

        Over a lat-long's seam and poles it is continuous; at the rims of discs and cube faces the outermost pixel goes
        on.
        """
        points = self.mapping.image_points(directions)
        rows, columns = self.radiance.shape[:2]
        if isinstance(self.mapping, LatLong):
            return bilinear(continued_round(self.radiance), points[..., 0] * columns + 1, points[..., 1] * rows + 1)
        outside = np.isnan(points[..., 0])
        points = np.where(outside[..., None], 0.5, points)
        # Each face or disc has a cell of its own: what lies in the next one is no neighbour.
        grid = np.array(getattr(self.mapping, "grid", (1, 1)))[::-1]
        cell = np.minimum(np.floor(points * grid), grid - 1)
        half = 0.5 / np.array([columns, rows])
        x, y = np.moveaxis(np.clip(points, cell / grid + half, (cell + 1) / grid - half) * [columns, rows], -1, 0)
        lit = (self.mapping.solid_angles(self.size) > 0)[..., None].astype(np.float32)
        found = bilinear(self.radiance * lit, x, y) / np.maximum(bilinear(lit, x, y), 1e-6)
        return np.where(outside[..., None], 0.0, found)

    def total(self) -> np.ndarray:
        """∫ L dω over the whole sphere, (3,): the sum of radiance × solid angle."""
        areas = self.mapping.solid_angles(self.size)
        parts = [np.einsum("hwc,hw->c", self.radiance[rows].astype(np.float64), areas[rows]) for rows in self._bands()]
        return np.sum(parts, axis=0)

    def irradiance(self, normals: np.ndarray) -> np.ndarray:
        """E = ∫ L max(0, ω·n) dω on surfaces of unit normals (…, 3): (…, 3), π·L under constant light.

        >>> even = EnvironmentMap(np.ones((64, 128, 3), np.float32))
        >>> even.irradiance(np.array([0.0, 1.0, 0.0])).round(2)
        array([3.14, 3.14, 3.14])
        """
        areas = self.mapping.solid_angles(self.size)
        flat = np.atleast_2d(np.asarray(normals, np.float64).reshape(-1, 3))
        parts = []
        for rows in self._bands():
            directions = pixel_directions(self.mapping, self.size, rows).reshape(-1, 3)
            flux = self.radiance[rows].reshape(-1, 3) * areas[rows].reshape(-1, 1)
            parts.append(np.stack([np.maximum(directions @ n, 0) @ flux for n in flat]))
        return np.sum(parts, axis=0).reshape(np.shape(normals))

    def _bands(self) -> list[slice]:
        """The rows in bands of `_BAND` pixels: a large map's directions would take four times its own memory."""
        step = max(1, _BAND // self.radiance.shape[1])
        return [slice(begin, begin + step) for begin in range(0, self.size, step)]

    def _repr_html_(self) -> str:
        """What a notebook shows: the map at a fair exposure, and its energy."""
        from relume.image.files.photographs.notebook_html import picture_html

        return picture_html(self.radiance, self._facts())

    def _facts(self) -> dict[str, str]:
        from relume.image.files.photographs.notebook_html import three

        columns = self.radiance.shape[1]
        return {
            "environment map": f"{columns} × {self.size} pixels, {self.mapping.name}, {self.unit}",
            "∫ L dω": three(self.total()),
            "irradiance from above": three(self.irradiance(np.array([0.0, 1.0, 0.0]))),
            "most": three(self.radiance.reshape(-1, 3).max(axis=0)),
        }

    def remapped(self, mapping: Mapping, size: int | None = None, rotation: np.ndarray | None = None) -> EnvironmentMap:
        """The same light in another mapping or size (rows; as fine as now unless given), energy kept.

        rotation : turned by it as well, in one step, which blurs less than two
        """
        from relume.sphere.resampling.resampling import moved, whole_columns

        turn = np.eye(3) if rotation is None else required_rotation(rotation)
        here, there = (self.mapping, self.size), (mapping, self.matching_size(mapping) if size is None else size)
        columns = whole_columns(here, there, turn)
        if columns == 0:
            return self
        if columns is None:
            radiance, clipped, _ = moved(self.radiance, self.clipped, layout(*here), layout(*there), turn)
        else:
            radiance = np.roll(self.radiance, -columns, axis=1)
            clipped = None if self.clipped is None else np.roll(self.clipped, -columns, axis=1)
        return EnvironmentMap(radiance, mapping, self.unit, clipped, self.attributes)

    def matching_size(self, mapping: Mapping) -> int:
        """Rows of a map in `mapping` with at least as many pixels a steradian, on average."""
        return matching_size(self.mapping, self.size, mapping)

    def rotated(self, rotation: np.ndarray) -> EnvironmentMap:
        """The light turned by an active rotation: what came from ω comes from `rotation` @ ω; energy kept."""
        return self.remapped(self.mapping, self.size, rotation)

    def audit(self, rotation: np.ndarray | None = None) -> Audit:
        """The map's energy: total, irradiance, brightest pixel, and what is clipped or unseen.

        rotation : active; the audit is of the light turned by it, without resampling
        """
        from relume.sphere.audit import audit

        return audit(self.radiance, self.mapping, self.clipped, self.unit, rotation)
