"""Constellation of lights: distant lights that stand for an illumination map (Debevec 2005; course slides 5).

The sphere is divided into regions, by one of three methods, and a light stands in the middle of the light of each:
`MedianCut`, `VarianceMinimisation` and `KMeans`, from the quickest to the one of the least error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS
from relume.sphere.illumination import IlluminationMap

if TYPE_CHECKING:
    from relume.light.constellation_cells import Cells
    from relume.light.k_means import Regions


@dataclass(frozen=True, eq=False)
class Constellation:
    """Parallel lights, the strongest first.

    directions : (N, 3) float64, unit, towards the lights
    irradiance : (N, 3) float64, on a surface that faces the light, in the map's unit times sr; lux where that is cd/m²
    angular_radii : (N,) float64, radians of an even disc of light as spread out as the light it stands for, for hosts
        whose distant lights have a size; 0 for a single pixel. None where unknown
    solid_angles : (N,) float64, steradians of the regions. None where unknown
    labels : (rows, columns) int32, the light that each pixel of the map belongs to, −1 for none. None where unknown
    """

    directions: np.ndarray
    irradiance: np.ndarray
    angular_radii: np.ndarray | None = None
    solid_angles: np.ndarray | None = None
    labels: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.directions.ndim != 2 or self.directions.shape[1] != 3 or self.irradiance.shape != self.directions.shape:
            raise ValueError(
                f"directions are {self.directions.shape} and irradiance {self.irradiance.shape}; expected (N, 3) both"
            )

    def total(self) -> np.ndarray:
        """∫ L dω of the light they stand for, (3,): the sum of their irradiance."""
        return self.irradiance.sum(axis=0)

    def irradiance_on(self, normals: np.ndarray) -> np.ndarray:
        """What surfaces of unit normals (…, 3) get from all the lights, nothing in the way: (…, 3)."""
        return np.maximum(np.asarray(normals, np.float64) @ self.directions.T, 0) @ self.irradiance


def constellation(light: IlluminationMap, count: int = 64, method: Regions | None = None) -> Constellation:
    """At most `count` lights with all of a map's light, each in the mean direction of the light it stands for.

    light : in any mapping; its pixels are summed in double precision, so that nothing is lost or added
    count : they are fewer only where the map has fewer bright pixels; a black map has none. 64 light a scene so that
        irradiance errs by about a percent
    method : `MedianCut()` unless given

    Raises ValueError when no light is asked for. Source: Debevec 2005; Viriyothai & Debevec 2009.
    """
    from relume.light.constellation_cells import cells_of
    from relume.light.median_cut import MedianCut

    if count < 1:
        raise ValueError(f"a constellation of {count} lights; expected 1 or more, like 64")
    cells = cells_of(light)
    return _lights(cells, (method or MedianCut()).regions(cells, count))


def _lights(cells: Cells, regions: np.ndarray) -> Constellation:
    """A light for every region that has light, the strongest first."""
    number = int(regions.max()) + 1
    inside = np.flatnonzero(regions.ravel() >= 0)
    labels = regions.ravel()[inside]

    def summed(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(-1, 3)[inside]
        return np.stack([np.bincount(labels, flat[:, k], number) for k in range(3)], axis=-1)

    flux, moments = summed(cells.flux), summed(cells.moment)
    areas = np.bincount(labels, cells.areas.ravel()[inside], number)
    strengths = flux @ LUMINANCE_WEIGHTS
    order = np.argsort(-strengths, kind="stable")
    order = order[flux[order].sum(axis=-1) > 0]
    flux, moments, areas, strengths = flux[order], moments[order], areas[order], strengths[order]
    lengths = np.linalg.norm(moments, axis=-1)
    directions = moments / np.maximum(lengths, 1e-300)[:, None]
    for light in np.flatnonzero(lengths <= 1e-6 * strengths):
        # Light from everywhere alike has no mean direction; the middle of its region is as good as any.
        directions[light] = _middle(cells, regions == order[light])
    # Of an even disc of angular radius a the mean direction is (1 + cos a)/2 = cos²(a/2) long.
    short = (strengths - lengths) / strengths
    radii = 2 * np.arcsin(np.sqrt(np.clip(short, 0, 1)))
    rank = np.full(number + 1, -1, np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    return Constellation(directions, flux, radii, areas, cells.in_pixels(rank[regions]))


def _middle(cells: Cells, region: np.ndarray) -> np.ndarray:
    directions = cells.directions()[region]
    mean = cells.areas[region] @ directions
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-6 * float(cells.areas[region].sum()) else np.array([0.0, 0.0, -1.0])
