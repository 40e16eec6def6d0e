"""Constellation of lights: distant lights that stand for an environment map (Debevec 2005; course slides 5).

The sphere is divided into regions, by one of three methods, and a light stands in the middle of the light of each:
`MedianCut`, `VarianceMinimisation` and `KMeans`, from the quickest to the one of the least error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS
from relume.sphere.environment_map import EnvironmentMap

if TYPE_CHECKING:
    from relume.light.constellations.cells import Cells
    from relume.light.constellations.k_means import Regions


@dataclass(frozen=True, eq=False)
class Constellation:
    """Parallel lights that stand for a map.

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


def constellation(light: EnvironmentMap, count: int = 64, method: Regions | None = None) -> Constellation:
    """At most `count` lights with all of a map's light, each in the mean direction of what it stands for.

    The strongest is the first.

    light : in any mapping; its pixels are summed in double precision, so that nothing is lost or added
    count : they are fewer only where the map has fewer bright pixels; a black map has none. 64 light a scene so that
        irradiance errs by about a percent
    method : `MedianCut()` unless given

    Raises ValueError when no light is asked for. Source: Debevec 2005; Viriyothai & Debevec 2009.
    """
    from relume.light.constellations.cells import cells_of
    from relume.light.constellations.rectangles import MedianCut

    if count < 1:
        raise ValueError(f"a constellation of {count} lights; expected 1 or more, like 64")
    cells = cells_of(light)
    return _lights(cells, (method or MedianCut()).regions(cells, count))


def together(first: Constellation, second: Constellation) -> Constellation:
    """The lights of both, those of the first before; a pixel that both have a light for is the first's."""
    directions = np.concatenate([first.directions, second.directions])
    irradiance = np.concatenate([first.irradiance, second.irradiance])
    labels = second.labels
    if labels is not None:
        labels = np.where(labels >= 0, labels + len(first.directions), -1).astype(np.int32)
    if first.labels is not None:
        labels = first.labels if labels is None else np.where(first.labels >= 0, first.labels, labels)
    return Constellation(
        directions,
        irradiance,
        _both(first.angular_radii, second.angular_radii),
        _both(first.solid_angles, second.solid_angles),
        labels,
    )


def irradiance_error(
    light: EnvironmentMap, lights: Constellation, residual: EnvironmentMap | None = None
) -> tuple[float, float]:
    """How far lights and residual are from lighting surfaces as the map does: mean and largest difference.

    Both are shares of the mean irradiance, in the channel where they are largest; pixels are taken together in cells of
    0.7°, which puts them off by 1e-4 or less.
    """
    from relume.light.constellations.cells import cells_of

    # Spiral points (Saff & Kuijlaars 1997), as far from each other as so many can be.
    height, turn = 1 - (2 * np.arange(512) + 1) / 512, np.pi * (1 + np.sqrt(5)) * np.arange(512)
    ring = np.sqrt(1 - height**2)
    normals = np.stack([ring * np.sin(turn), height, ring * np.cos(turn)], axis=-1)

    def irradiance(map_: EnvironmentMap) -> np.ndarray:
        cells = cells_of(map_, 256)
        lit = cells.luminance > 0
        moments, flux = cells.moment[lit], cells.flux[lit]
        directions = (moments / np.linalg.norm(moments, axis=-1, keepdims=True)).astype(np.float32)
        return np.stack([np.maximum(directions @ n, 0) @ flux for n in normals.astype(np.float32)])

    truth = irradiance(light)
    found = lights.irradiance_on(normals) + (0 if residual is None else irradiance(residual))
    difference = np.abs(found - truth) / np.maximum(truth.mean(axis=0), 1e-300)
    return float(difference.mean(axis=0).max()), float(difference.max())


def _both(first: np.ndarray | None, second: np.ndarray | None) -> np.ndarray | None:
    return None if first is None or second is None else np.concatenate([first, second])


def _lights(cells: Cells, regions: np.ndarray) -> Constellation:
    """A light for every region that has light, the strongest first."""
    every = lights_of_regions(cells, regions, int(regions.max()) + 1)
    order = np.argsort(-(every.irradiance @ LUMINANCE_WEIGHTS), kind="stable")
    order = order[every.irradiance[order].sum(axis=-1) > 0]
    rank = np.full(len(every.directions) + 1, -1, np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    assert every.angular_radii is not None and every.solid_angles is not None
    return Constellation(
        every.directions[order], every.irradiance[order], every.angular_radii[order], every.solid_angles[order],
        cells.in_pixels(rank[regions]),
    )  # fmt: skip


def lights_of_regions(cells: Cells, regions: np.ndarray, number: int) -> Constellation:
    """A light for each of so many regions (R, C) of cells, in their order; without any light where that has none."""
    inside = np.flatnonzero(regions.ravel() >= 0)
    labels = regions.ravel()[inside]

    def summed(values: np.ndarray) -> np.ndarray:
        flat = values.reshape(-1, 3)[inside]
        return np.stack([np.bincount(labels, flat[:, k], number) for k in range(3)], axis=-1)

    flux, moments = summed(cells.flux), summed(cells.moment)
    areas = np.bincount(labels, cells.areas.ravel()[inside], number)
    strengths, lengths = flux @ LUMINANCE_WEIGHTS, np.linalg.norm(moments, axis=-1)
    directions = moments / np.maximum(lengths, 1e-300)[:, None]
    for light in np.flatnonzero(lengths <= 1e-6 * strengths):
        # Light from everywhere alike has no mean direction; the middle of its region is as good as any.
        directions[light] = _middle(cells, regions == light)
    # Of an even disc of angular radius a the mean direction is (1 + cos a)/2 = cos²(a/2) long.
    short = (strengths - lengths) / np.maximum(strengths, 1e-300)
    radii = 2 * np.arcsin(np.sqrt(np.clip(short, 0, 1)))
    return Constellation(directions, flux, radii, areas, cells.in_pixels(regions))


def _middle(cells: Cells, region: np.ndarray) -> np.ndarray:
    directions = cells.directions()[region]
    mean = cells.areas[region] @ directions
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-6 * float(cells.areas[region].sum()) else np.array([0.0, 0.0, -1.0])
